//! What a process sent, received and refused, counted by topic.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt;
use std::rc::Rc;

use crate::diagnostics::{DiagnosticLevel, Report};
use crate::words::{Words, by_words};

/// Why a sample was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RefusalKind {
    /// Its bytes do not decode as the topic's type.
    Malformed,
    /// It decodes, but contradicts itself or its bounds.
    Invalid,
    /// Its sender is not the participant that it speaks for.
    Misattributed,
}

impl Words for RefusalKind {
    const WORDS: &'static [(&'static str, Self)] = &[
        ("malformed", Self::Malformed),
        ("invalid", Self::Invalid),
        ("misattributed", Self::Misattributed),
    ];
}

by_words!(RefusalKind);

/// The counts of one topic.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TopicCounts {
    /// Samples handed to the middleware.
    pub sent: u64,
    /// Samples of other participants that were accepted.
    pub received: u64,
    /// Samples of other participants that were refused, by kind.
    pub refused: BTreeMap<RefusalKind, u64>,
    /// Samples that waited for room in the library's send window.
    pub delayed: u64,
    /// Waiting samples that a newer one of the same publisher replaced.
    pub superseded: u64,
    /// Samples that could not be sent at all, or for which the process had no room.
    pub lost: u64,
}

impl TopicCounts {
    /// The counts with their names; those that are rarely other than 0 only when they are.
    fn named(&self) -> impl Iterator<Item = (String, u64)> {
        let refused = self.refused.iter();
        let refused = refused.map(|(kind, &count)| (format!("refused.{kind}"), count));
        let rare = [
            ("delayed", self.delayed),
            ("superseded", self.superseded),
            ("lost", self.lost),
        ];
        let rare = rare.into_iter().filter(|(_, count)| *count > 0);
        [("sent", self.sent), ("received", self.received)]
            .into_iter()
            .map(|(name, count)| (name.to_owned(), count))
            .chain(refused)
            .chain(rare.map(|(name, count)| (name.to_owned(), count)))
    }
}

/// The counts of all topics of one process.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TopicStatistics {
    topics: BTreeMap<&'static str, TopicCounts>,
}

/// Statistics that the queues of one process write.
pub type SharedStatistics = Rc<RefCell<TopicStatistics>>;

impl TopicStatistics {
    /// The counts by topic.
    #[must_use]
    pub fn topics(&self) -> &BTreeMap<&'static str, TopicCounts> {
        &self.topics
    }

    pub(crate) fn on(&mut self, topic: &'static str) -> &mut TopicCounts {
        self.topics.entry(topic).or_default()
    }

    /// Counts a refused sample and logs it, less and less often, so that a flood of samples does not flood the log.
    pub fn refuse(&mut self, topic: &'static str, kind: RefusalKind, reason: &dyn fmt::Display) {
        let count = self.on(topic).refused.entry(kind).or_default();
        *count += 1;
        if is_logged(*count) {
            tracing::warn!(topic, %kind, count = *count, "refused a sample: {reason}");
        }
    }

    /// Counts a sample that could not be sent, and logs it less and less often.
    pub(crate) fn lose(&mut self, topic: &'static str, reason: &dyn fmt::Display) {
        let lost = &mut self.on(topic).lost;
        *lost += 1;
        if is_logged(*lost) {
            tracing::error!(topic, count = *lost, "lost a sample: {reason}");
        }
    }

    /// Counts samples that arrived and found no room, and logs them less and less often.
    #[cfg(any(test, feature = "zenoh"))]
    pub(crate) fn overflow(&mut self, topic: &'static str, samples: u64) {
        let lost = &mut self.on(topic).lost;
        let before = *lost;
        *lost += samples;
        if (before + 1..=*lost).any(is_logged) {
            tracing::error!(
                topic,
                count = *lost,
                "lost samples: they came faster than the process takes them"
            );
        }
    }

    /// The counts as a status for `/diagnostics`.
    pub(crate) fn report(&self) -> Report {
        let total = |count: fn(&TopicCounts) -> u64| self.topics.values().map(count).sum::<u64>();
        let lost = total(|counts| counts.lost);
        let refused = total(|counts| counts.refused.values().sum());
        let (level, message) = match (lost, refused) {
            (0, 0) => (
                DiagnosticLevel::Ok,
                "no sample was refused or lost".to_owned(),
            ),
            (0, refused) => (
                DiagnosticLevel::Warning,
                format!("{refused} samples were malformed or contradicted themselves"),
            ),
            (lost, _) => (DiagnosticLevel::Error, format!("{lost} samples were lost")),
        };
        let values = self.topics.iter().flat_map(|(topic, counts)| {
            let counts = counts.named();
            counts.map(move |(name, count)| (format!("{topic}.{name}"), count.to_string()))
        });
        Report {
            part: "topic statistics".to_owned(),
            hardware_id: String::new(),
            level,
            message,
            values: values.collect(),
        }
    }
}

/// Whether the event of this number is logged: the first ten, then every power of two.
#[must_use]
pub fn is_logged(count: u64) -> bool {
    count <= 10 || count.is_power_of_two()
}

impl fmt::Display for TopicStatistics {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let topics = self.topics.iter().map(|(topic, counts)| {
            let counts = counts
                .named()
                .map(|(name, count)| format!("{name} {count}"));
            format!("{topic}: {}", counts.collect::<Vec<_>>().join(", "))
        });
        formatter.write_str(&topics.collect::<Vec<_>>().join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_samples_outrank_refused_ones() {
        let mut statistics = TopicStatistics::default();
        statistics.on("claims").sent += 2;
        assert_eq!(statistics.report().level, DiagnosticLevel::Ok);
        statistics.refuse("claims", RefusalKind::Malformed, &"no");
        let report = statistics.report();
        assert_eq!(report.level, DiagnosticLevel::Warning);
        let refused = ("claims.refused.malformed".to_owned(), "1".to_owned());
        assert!(report.values.contains(&refused), "{:?}", report.values);
        statistics.lose("claims", &"gone");
        let status = statistics.report().into_status("/fleet/camera");
        assert_eq!(
            (status.level, status.name.as_str()),
            (2, "/fleet/camera: topic statistics")
        );
        assert_eq!(
            statistics.to_string(),
            "claims: sent 2, received 0, refused.malformed 1, lost 1"
        );
    }
}
