//! Subscribing topics: samples become what the node understands, or counted refusals.

use std::future::ready;

use futures::StreamExt;
use futures::stream::LocalBoxStream;
use serde::de::DeserializeOwned;

use crate::arguments::Resource;
use crate::raw_sample::RawSample;
use crate::session::{ParticipantId, Session, SessionError};
use crate::topic::Topic;
use crate::topic_statistics::{RefusalKind, TopicStatistics};

/// What a middleware takes from a topic.
pub(crate) enum Taken<M> {
    /// A sample and the process that sent it.
    Sample(ParticipantId, M),
    /// A sample that does not decode, and the reason.
    Malformed(String),
    /// The number of samples for which the process had no room.
    #[cfg(any(test, feature = "zenoh"))]
    Lost(u64),
}

impl Session {
    /// Subscribes a topic: every sample of other participants that decodes and that `convert` accepts. Samples
    /// that are refused are counted and logged.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn subscription<M: DeserializeOwned + 'static, T: 'static>(
        &mut self,
        topic: &Topic<M>,
        convert: impl FnMut(ParticipantId, M) -> Result<T, String> + 'static,
    ) -> Result<LocalBoxStream<'static, T>, SessionError> {
        let name = self.resolve(Resource::Topic, &topic.path())?;
        let samples = self.graph.subscription(topic, &name)?;
        Ok(self.accepted(samples, topic.name(), convert))
    }

    /// Subscribes a topic without decoding its samples, those that do not decode included.
    ///
    /// Over DDS, tools list the subscription without its node: the library registers with a node only the subscriptions
    /// that decode.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn raw_subscription<M: 'static>(
        &mut self,
        topic: &Topic<M>,
    ) -> Result<LocalBoxStream<'static, RawSample>, SessionError> {
        let name = self.resolve(Resource::Topic, &topic.path())?;
        let samples = self.graph.raw_subscription(topic, &name)?;
        Ok(self.accepted(samples, topic.name(), |_, sample| Ok(sample)))
    }

    /// The samples that `convert` accepts; the others are counted.
    fn accepted<M: 'static, T: 'static>(
        &self,
        samples: LocalBoxStream<'static, Taken<M>>,
        topic: &'static str,
        mut convert: impl FnMut(ParticipantId, M) -> Result<T, String> + 'static,
    ) -> LocalBoxStream<'static, T> {
        let (own, statistics) = (self.participant(), self.statistics());
        let accepted = samples.filter_map(move |taken| {
            let mut statistics = statistics.borrow_mut();
            ready(accept(taken, own, topic, &mut statistics, &mut convert))
        });
        accepted.boxed_local()
    }
}

/// Converts and counts a sample, or the reason why it does not decode; ignores those of the process's own participant.
fn accept<M, T>(
    taken: Taken<M>,
    own: ParticipantId,
    topic: &'static str,
    statistics: &mut TopicStatistics,
    convert: &mut impl FnMut(ParticipantId, M) -> Result<T, String>,
) -> Option<T> {
    let (kind, reason) = match taken {
        Taken::Sample(sender, _) if sender == own => return None,
        Taken::Sample(sender, sample) => match convert(sender, sample) {
            Ok(accepted) => {
                statistics.on(topic).received += 1;
                return Some(accepted);
            }
            Err(reason) => (RefusalKind::Invalid, reason),
        },
        Taken::Malformed(reason) => (RefusalKind::Malformed, reason),
        #[cfg(any(test, feature = "zenoh"))]
        Taken::Lost(count) => {
            statistics.overflow(topic, count);
            return None;
        }
    };
    statistics.refuse(topic, kind, &reason);
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_converted_refused_or_ignored_and_counted() {
        let mut statistics = TopicStatistics::default();
        let (own, other) = (ParticipantId(1), ParticipantId(7));
        let mut take = |taken| {
            let mut convert =
                |_, sample: i32| u32::try_from(sample).map_err(|_| "negative".to_owned());
            accept(taken, own, "test", &mut statistics, &mut convert)
        };
        assert_eq!(take(Taken::Sample(other, 5)), Some(5));
        assert_eq!(
            take(Taken::Sample(own, 5)),
            None,
            "its own samples are ignored"
        );
        assert_eq!(take(Taken::Sample(other, -5)), None);
        assert_eq!(take(Taken::Malformed("too short".to_owned())), None);
        assert_eq!(take(Taken::Lost(3)), None);
        let counts = &statistics.topics()["test"];
        assert_eq!((counts.received, counts.lost), (1, 3));
        let refused = [(RefusalKind::Malformed, 1), (RefusalKind::Invalid, 1)];
        assert_eq!(counts.refused, refused.into());
    }
}
