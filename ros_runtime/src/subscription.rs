//! Subscribing topics: samples become what the node understands, or counted refusals.

use std::future::{Future, ready};
use std::pin::pin;

use futures::StreamExt;
use futures::stream::{LocalBoxStream, poll_fn};
use serde::de::DeserializeOwned;

use crate::session::{ParticipantId, Session, SessionError, sender_of};
use crate::topic::Topic;
use crate::topic_statistics::{RefusalKind, TopicStatistics};

impl Session {
    /// Subscribes a topic: every sample of other participants that decodes and that `convert` accepts. Samples
    /// that are refused are counted and logged.
    ///
    /// # Errors
    /// The name cannot be used, or the library refuses.
    pub fn subscription<M: DeserializeOwned + 'static, T: 'static>(
        &mut self,
        topic: &Topic<M>,
        mut convert: impl FnMut(ParticipantId, M) -> Result<T, String> + 'static,
    ) -> Result<LocalBoxStream<'static, T>, SessionError> {
        let quality = topic.quality().subscription_qos();
        let dds_topic = self.dds_topic(topic, &quality)?;
        let what = format!("subscribe `{}`", topic.path());
        let subscription = self.create(&what, |node| {
            node.create_subscription::<M>(&dds_topic, Some(quality))
        })?;
        let (own, statistics, topic) = (self.participant(), self.statistics(), topic.name());
        let samples =
            poll_fn(move |context| pin!(subscription.async_take()).poll(context).map(Some));
        let accepted = samples.filter_map(move |taken| {
            let sample = match taken {
                Ok((sample, info)) => Ok((sender_of(&info), sample)),
                Err(error) => Err(error.to_string()),
            };
            let mut statistics = statistics.borrow_mut();
            ready(accept(sample, own, topic, &mut statistics, &mut convert))
        });
        Ok(accepted.boxed_local())
    }
}

/// Converts and counts a sample, or the reason why it does not decode; ignores those of the process's own participant.
fn accept<M, T>(
    sample: Result<(ParticipantId, M), String>,
    own: ParticipantId,
    topic: &'static str,
    statistics: &mut TopicStatistics,
    convert: &mut impl FnMut(ParticipantId, M) -> Result<T, String>,
) -> Option<T> {
    let (kind, reason) = match sample {
        Ok((sender, _)) if sender == own => return None,
        Ok((sender, sample)) => match convert(sender, sample) {
            Ok(accepted) => {
                statistics.on(topic).received += 1;
                return Some(accepted);
            }
            Err(reason) => (RefusalKind::Invalid, reason),
        },
        Err(reason) => (RefusalKind::Malformed, reason),
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
        let mut take = |sample| {
            let mut convert =
                |_, sample: i32| u32::try_from(sample).map_err(|_| "negative".to_owned());
            accept(sample, own, "test", &mut statistics, &mut convert)
        };
        assert_eq!(take(Ok((other, 5))), Some(5));
        assert_eq!(take(Ok((own, 5))), None, "its own samples are ignored");
        assert_eq!(take(Ok((other, -5))), None);
        assert_eq!(take(Err("too short".to_owned())), None);
        let counts = &statistics.topics()["test"];
        assert_eq!(counts.received, 1);
        let refused = [(RefusalKind::Malformed, 1), (RefusalKind::Invalid, 1)];
        assert_eq!(counts.refused, refused.into());
    }
}
