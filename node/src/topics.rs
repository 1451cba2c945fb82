//! The topics: their names, types and quality of service, in one place.

use std::marker::PhantomData;

use formation_msgs::{
    Eviction, Heartbeat, ModuleStates, Roster, SpotClaim, TargetConfiguration, Verdict, topic,
};
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};

/// A topic that carries samples of type `M`.
#[derive(Debug)]
pub struct Topic<M> {
    name: &'static str,
    quality: Quality,
    message: PhantomData<fn() -> M>,
}

/// What a topic promises to its subscribers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// Reliable and transient local: whoever comes late still gets the last `depth` samples of every publisher.
    Latched {
        /// How many samples a publisher keeps.
        depth: usize,
    },
    /// Best effort and volatile: a sample that is lost is replaced by the next.
    Fleeting,
}

/// The target that all modules are to form.
pub const TARGET: Topic<TargetConfiguration> = Topic::latched(topic::TARGET, 1);
/// What the modules of a process are doing.
pub const MODULE_STATES: Topic<ModuleStates> = Topic::latched(topic::MODULE_STATES, 1);
/// What the convener announces.
pub const ROSTER: Topic<Roster> = Topic::latched(topic::ROSTER, 1);
/// Who was evicted, for those who watch.
pub const EVICTIONS: Topic<Eviction> = Topic::latched(topic::EVICTIONS, 100);
/// Signs of life.
pub const HEARTBEATS: Topic<Heartbeat> = Topic::fleeting(topic::HEARTBEATS);
/// What the verifier found.
pub const VERDICT: Topic<Verdict> = Topic::latched(topic::VERDICT, 1);

/// What units decide in their turns, kept for the whole of an epoch by a process that hosts `modules` modules.
///
/// A module decides once as a singleton, or once for each ever smaller piece of its configuration that it leads.
#[must_use]
pub fn claims(modules: usize) -> Topic<SpotClaim> {
    Topic::latched(topic::CLAIMS, modules.saturating_mul(4).clamp(16, 8_192))
}

/// So many samples of a topic wait for the process to take them, over all publishers together.
///
/// RustDDS keeps one store a topic and drops the oldest samples of a full one even when they are reliable and were
/// not taken yet, so it must hold whatever can come in while the process is busy: the publishers' own depths,
/// being per publisher, do not help here. History is no matter of agreement between the two ends.
const SUBSCRIPTION_DEPTH: usize = 4_096;

impl<M> Topic<M> {
    const fn latched(name: &'static str, depth: usize) -> Self {
        Self {
            name,
            quality: Quality::Latched { depth },
            message: PhantomData,
        }
    }

    const fn fleeting(name: &'static str) -> Self {
        Self {
            name,
            quality: Quality::Fleeting,
            message: PhantomData,
        }
    }

    /// The name, relative to the namespace of the nodes.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// What it promises.
    #[must_use]
    pub fn quality(&self) -> Quality {
        self.quality
    }

    pub(crate) fn publisher_qos(&self) -> QosProfile {
        match self.quality {
            Quality::Latched { depth } => latched(depth),
            Quality::Fleeting => fleeting(1),
        }
    }

    pub(crate) fn subscription_qos(&self) -> QosProfile {
        match self.quality {
            Quality::Latched { .. } => latched(SUBSCRIPTION_DEPTH),
            Quality::Fleeting => fleeting(SUBSCRIPTION_DEPTH),
        }
    }
}

fn latched(depth: usize) -> QosProfile {
    QosProfile::publisher_default()
        // The loop must never wait inside the library; what does not fit is kept and tried again.
        .reliability(Reliability::Reliable {
            when_full: WhenFull::Fail,
        })
        .durability(Durability::TransientLocal)
        .history(History::KeepLast { depth })
}

fn fleeting(depth: usize) -> QosProfile {
    QosProfile::subscription_default().history(History::KeepLast { depth })
}

/// A topic for tests of what does not need DDS.
#[cfg(test)]
pub(crate) fn test_topic<M>(depth: usize) -> Topic<M> {
    Topic::latched("test", depth)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_of_a_latched_topic_are_reliable_and_transient_local() {
        for profile in [ROSTER.publisher_qos(), ROSTER.subscription_qos()] {
            assert_eq!(profile.durability, Durability::TransientLocal);
            assert!(matches!(
                profile.reliability,
                Reliability::Reliable {
                    when_full: WhenFull::Fail
                }
            ));
        }
        let beats = HEARTBEATS.subscription_qos();
        assert_eq!(beats.reliability, Reliability::BestEffort);
        assert_eq!(beats.durability, Durability::Volatile);
    }

    #[test]
    fn claims_of_an_epoch_fit_whatever_a_process_hosts() {
        assert_eq!(claims(1).quality(), Quality::Latched { depth: 16 });
        assert_eq!(claims(100).quality(), Quality::Latched { depth: 400 });
        assert_eq!(claims(10_000).quality(), Quality::Latched { depth: 8_192 });
    }
}
