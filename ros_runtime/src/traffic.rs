//! What a process sent, received and refused, counted by topic.

use std::collections::BTreeMap;
use std::fmt;

/// Why a sample went no further.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RefusalKind {
    /// Its bytes do not decode as the topic's type.
    Malformed,
    /// It decodes, but contradicts itself or its bounds.
    Invalid,
    /// It speaks for a module that another process speaks for.
    Misattributed,
}

impl fmt::Display for RefusalKind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Malformed => "malformed",
            Self::Invalid => "invalid",
            Self::Misattributed => "misattributed",
        })
    }
}

/// The counts of one topic.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TopicTraffic {
    /// Samples handed to the DDS library.
    pub sent: u64,
    /// Samples of others that were taken in.
    pub received: u64,
    /// Samples of others that were refused, by kind.
    pub refused: BTreeMap<RefusalKind, u64>,
    /// Samples that waited for room in the library's send window.
    pub delayed: u64,
    /// Waiting samples that a newer one of the same publisher replaced.
    pub superseded: u64,
    /// Samples that could not be sent at all.
    pub lost: u64,
}

/// The counts of all topics of one process.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    topics: BTreeMap<&'static str, TopicTraffic>,
}

impl Traffic {
    /// The counts by topic.
    #[must_use]
    pub fn topics(&self) -> &BTreeMap<&'static str, TopicTraffic> {
        &self.topics
    }

    /// The counts of a topic.
    pub fn on(&mut self, topic: &'static str) -> &mut TopicTraffic {
        self.topics.entry(topic).or_default()
    }

    /// Counts a refused sample and logs it, ever more rarely, so that a flood of them does not flood the log too.
    pub fn refuse(&mut self, topic: &'static str, kind: RefusalKind, reason: &dyn fmt::Display) {
        let count = self.on(topic).refused.entry(kind).or_default();
        *count += 1;
        if worth_a_line(*count) {
            tracing::warn!(topic, %kind, count = *count, "refused a sample: {reason}");
        }
    }

    /// Counts samples that could not be sent and logs it.
    pub fn lose(&mut self, topic: &'static str, reason: &dyn fmt::Display) {
        let lost = &mut self.on(topic).lost;
        *lost += 1;
        if worth_a_line(*lost) {
            tracing::error!(topic, count = *lost, "lost a sample: {reason}");
        }
    }
}

/// The first ten, then every power of two.
pub fn worth_a_line(count: u64) -> bool {
    count <= 10 || count.is_power_of_two()
}

impl fmt::Display for Traffic {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, (topic, traffic)) in self.topics.iter().enumerate() {
            if index > 0 {
                formatter.write_str("; ")?;
            }
            write!(
                formatter,
                "{topic}: {} sent, {} received",
                traffic.sent, traffic.received
            )?;
            for (kind, count) in &traffic.refused {
                write!(formatter, ", {count} {kind}")?;
            }
            for (what, count) in [
                ("delayed", traffic.delayed),
                ("superseded", traffic.superseded),
                ("lost", traffic.lost),
            ] {
                if count > 0 {
                    write!(formatter, ", {count} {what}")?;
                }
            }
        }
        Ok(())
    }
}
