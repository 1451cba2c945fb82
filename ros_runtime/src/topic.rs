//! Topics as values: name, type and quality of service.

use std::marker::PhantomData;

use ros2_client::log::Log;
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};

use crate::diagnostics::DiagnosticArray;

/// A topic that carries samples of type `M`.
#[derive(Debug)]
pub struct Topic<M> {
    prefix: Option<String>,
    name: &'static str,
    package: &'static str,
    type_name: &'static str,
    quality: Quality,
    message: PhantomData<fn() -> M>,
}

/// Samples whose type the program does not have, or need not know.
#[derive(Debug)]
pub struct Untyped;

/// What a topic guarantees to its subscribers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// Reliable and transient local: a late subscriber gets the last `depth` samples of every publisher.
    TransientLocal {
        /// How many samples a publisher keeps.
        depth: usize,
    },
    /// Best effort and volatile: a sample that is lost is replaced by the next.
    BestEffort,
    /// Reliable and volatile, the default of ROS 2: a late subscriber gets no earlier sample.
    ReliableVolatile {
        /// How many samples wait for a slow subscriber.
        depth: usize,
    },
}

/// Log lines, in the quality that ROS 2 gives them, but not as deep: a writer keeps samples that no subscriber reads.
pub(crate) const ROSOUT: Topic<Log> = Topic::new(
    "/rosout",
    "rcl_interfaces",
    "Log",
    Quality::TransientLocal { depth: 100 },
);
/// The status of nodes.
pub(crate) const DIAGNOSTICS: Topic<DiagnosticArray> = Topic::new(
    "/diagnostics",
    "diagnostic_msgs",
    "DiagnosticArray",
    Quality::ReliableVolatile { depth: 1 },
);

/// How many publishers of a topic may send all the samples that they keep at once: more than twice the participants
/// that one host can have in a domain.
const PUBLISHERS: usize = 256;
/// The least number of reliable samples that wait for the process: some seconds of a flood.
const RELIABLE_STORE_MIN: usize = 1_024;
/// The greatest number: the claims of an epoch of a thousand modules, and the latched samples of earlier epochs.
const RELIABLE_STORE_MAX: usize = 4_096;

impl<M> Topic<M> {
    /// A topic named `name`, relative to the node's namespace, that carries `package/msg/type_name`.
    #[must_use]
    pub const fn new(
        name: &'static str,
        package: &'static str,
        type_name: &'static str,
        quality: Quality,
    ) -> Self {
        Self {
            prefix: None,
            name,
            package,
            type_name,
            quality,
            message: PhantomData,
        }
    }

    /// The topic of the same name below `prefix`; both count as one in the topic statistics.
    #[must_use]
    pub fn below(self, prefix: String) -> Self {
        Self {
            prefix: Some(prefix),
            ..self
        }
    }

    /// The same topic, for lists of topics of several types.
    #[must_use]
    pub fn untyped(self) -> Topic<Untyped> {
        Topic {
            prefix: self.prefix,
            name: self.name,
            package: self.package,
            type_name: self.type_name,
            quality: self.quality,
            message: PhantomData,
        }
    }

    /// The last part of the name, under which its samples are counted.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The whole name, relative to the namespace of the node.
    #[must_use]
    pub fn path(&self) -> String {
        match &self.prefix {
            Some(prefix) => format!("{prefix}/{}", self.name),
            None => self.name.to_owned(),
        }
    }

    /// The package of the type, and the type in it.
    #[must_use]
    pub fn type_name(&self) -> (&'static str, &'static str) {
        (self.package, self.type_name)
    }

    /// What the topic guarantees.
    #[must_use]
    pub fn quality(&self) -> Quality {
        self.quality
    }
}

impl Quality {
    /// The quality of service of a publisher.
    #[must_use]
    pub fn publisher_qos(self) -> QosProfile {
        match self {
            Self::TransientLocal { depth } | Self::ReliableVolatile { depth } => {
                self.profile(depth)
            }
            Self::BestEffort => self.profile(1),
        }
    }

    /// The quality of service of a subscription.
    ///
    /// RustDDS keeps one store a topic. From a full store it drops the oldest samples, even reliable ones that were not
    /// taken yet, so the store must hold everything that can arrive while the process is busy. From a store that is not
    /// full it drops nothing, so the store should hold no more than that: what a flood leaves in it stays in memory.
    /// The two ends need not agree on the history.
    #[must_use]
    pub fn subscription_qos(self) -> QosProfile {
        self.profile(match self {
            Self::TransientLocal { depth } | Self::ReliableVolatile { depth } => depth
                .saturating_mul(PUBLISHERS)
                .clamp(RELIABLE_STORE_MIN, RELIABLE_STORE_MAX),
            // One sample of each publisher; a dropped sample is replaced by the next.
            Self::BestEffort => PUBLISHERS,
        })
    }

    fn profile(self, depth: usize) -> QosProfile {
        let durability = match self {
            Self::BestEffort => {
                return QosProfile::subscription_default().history(History::KeepLast { depth });
            }
            Self::TransientLocal { .. } => Durability::TransientLocal,
            Self::ReliableVolatile { .. } => Durability::Volatile,
        };
        QosProfile::publisher_default()
            // The event loop must never wait inside the library; a sample that does not fit is kept and offered again.
            .reliability(Reliability::Reliable {
                when_full: WhenFull::Fail,
            })
            .durability(durability)
            .history(History::KeepLast { depth })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_of_a_transient_local_topic_are_reliable_and_transient_local() {
        let latched = Quality::TransientLocal { depth: 1 };
        for profile in [latched.publisher_qos(), latched.subscription_qos()] {
            assert_eq!(profile.durability, Durability::TransientLocal);
            assert!(matches!(
                profile.reliability,
                Reliability::Reliable {
                    when_full: WhenFull::Fail
                }
            ));
        }
        let beats = Quality::BestEffort.subscription_qos();
        assert_eq!(beats.reliability, Reliability::BestEffort);
        assert_eq!(beats.durability, Durability::Volatile);
        let prompt = Quality::ReliableVolatile { depth: 1 }.publisher_qos();
        assert_eq!(prompt.durability, Durability::Volatile);
    }

    #[test]
    fn subscriptions_store_enough_for_many_publishers_and_no_more() {
        let store = |quality: Quality| match quality.subscription_qos().history {
            History::KeepLast { depth } => depth,
            History::KeepAll => usize::MAX,
        };
        assert_eq!(store(Quality::BestEffort), 256);
        assert_eq!(store(Quality::TransientLocal { depth: 1 }), 1_024);
        assert_eq!(store(Quality::TransientLocal { depth: 64 }), 4_096);
        assert_eq!(store(Quality::TransientLocal { depth: 40_000 }), 4_096);
    }
}
