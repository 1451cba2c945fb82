//! Subscribing topics: samples become what the node understands, or counted refusals.

use std::future::ready;

use futures::StreamExt;
use futures::stream::LocalBoxStream;

use crate::topic_statistics::{RefusalKind, SharedStatistics, TopicStatistics};

/// A process as its samples name it: over DDS the prefix of its endpoints' identifiers, over Zenoh its session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ParticipantId(pub u128);

impl ParticipantId {
    /// The participant whose identifiers over DDS begin with these bytes.
    pub(crate) fn of_prefix(prefix: &[u8]) -> Self {
        let bytes = prefix.iter();
        Self(bytes.fold(0, |number, &byte| (number << 8) | u128::from(byte)))
    }
}

/// Where a sample comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleOrigin {
    /// The process that sent it.
    pub participant: ParticipantId,
    /// When it was sent, by the clock of that process, in nanoseconds since 1970; `None` if it does not say.
    pub sent_ns: Option<u64>,
}

/// What a middleware takes from a topic.
pub(crate) enum Taken<M> {
    /// A sample, and where it comes from.
    Sample(SampleOrigin, M),
    /// A sample that does not decode, and the reason.
    Malformed(String),
    /// The number of samples for which the process had no room.
    #[cfg(any(test, feature = "zenoh"))]
    Lost(u64),
}

/// The samples that `convert` accepts; the others are counted.
pub(crate) fn accepted<M: 'static, T: 'static>(
    samples: LocalBoxStream<'static, Taken<M>>,
    own: ParticipantId,
    topic: &'static str,
    statistics: SharedStatistics,
    mut convert: impl FnMut(SampleOrigin, M) -> Result<T, String> + 'static,
) -> LocalBoxStream<'static, T> {
    let accepted = samples.filter_map(move |taken| {
        let mut statistics = statistics.borrow_mut();
        ready(accept(taken, own, topic, &mut statistics, &mut convert))
    });
    accepted.boxed_local()
}

/// Converts and counts a sample, or the reason why it does not decode; ignores those of the process's own participant.
fn accept<M, T>(
    taken: Taken<M>,
    own: ParticipantId,
    topic: &'static str,
    statistics: &mut TopicStatistics,
    convert: &mut impl FnMut(SampleOrigin, M) -> Result<T, String>,
) -> Option<T> {
    let (kind, reason) = match taken {
        Taken::Sample(origin, _) if origin.participant == own => return None,
        Taken::Sample(origin, sample) => match convert(origin, sample) {
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
        let [own, other] = [1, 7].map(|participant| SampleOrigin {
            participant: ParticipantId(participant),
            sent_ns: None,
        });
        let mut take = |taken| {
            let mut convert =
                |_, sample: i32| u32::try_from(sample).map_err(|_| "negative".to_owned());
            accept(
                taken,
                own.participant,
                "test",
                &mut statistics,
                &mut convert,
            )
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
