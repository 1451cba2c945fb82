//! The topics: their names, types and quality of service, in one place.

use std::marker::PhantomData;

use formation::model::ModuleId;
use formation_msgs::foreign::geometry_msgs::PoseStamped;
use formation_msgs::foreign::nav_msgs::Odometry;
use formation_msgs::foreign::tf2_msgs::TFMessage;
use formation_msgs::foreign::visualization_msgs::MarkerArray;
use formation_msgs::{
    DockingRequest, DockingResult, Eviction, Heartbeat, ModuleStates, Roster, SpotClaim,
    TargetConfiguration, Verdict, topic,
};
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};

use crate::diagnostics::DiagnosticArray;
use crate::rosout::Log;

/// A topic that carries samples of type `M`.
#[derive(Debug)]
pub struct Topic<M> {
    /// Whose topic it is, where each module has one.
    module: Option<ModuleId>,
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
    /// Reliable and volatile: whoever is there gets it, as ROS 2 nodes expect by default, and nobody gets an old one.
    Prompt {
        /// How many samples wait for a slow subscriber.
        depth: usize,
    },
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

/// Log lines, in the quality that ROS 2 gives them, but not as deep: writers do not forget what nobody reads.
pub(crate) const ROSOUT: Topic<Log> = Topic::latched("/rosout", 100);
/// How nodes are doing.
pub(crate) const DIAGNOSTICS: Topic<DiagnosticArray> = Topic::prompt("/diagnostics", 1);
/// The formation as shapes, whole.
pub const MARKERS: Topic<MarkerArray> = Topic::latched("markers", 1);
/// Where modules stand, for all of ROS 2.
pub const TRANSFORMS: Topic<TFMessage> = Topic::prompt("/tf", 1);
/// Where spots lie, for all of ROS 2.
pub const FIXED_TRANSFORMS: Topic<TFMessage> = Topic::latched("/tf_static", 1);

/// How far the goals of an action have come, in the quality that ROS 2 gives it.
pub(crate) fn action_feedback<M>() -> Topic<M> {
    Topic::prompt("feedback", 10)
}

/// In which state the goals of an action are, in the quality that ROS 2 gives it.
pub(crate) fn action_status<M>() -> Topic<M> {
    Topic::latched("status", 1)
}

/// A module decides once as a singleton, or once for each ever smaller piece of its configuration that it leads.
const CLAIMS_PER_MODULE: usize = 4;
/// So many decisions a process keeps at least, which leaves room for modules that are added.
const CLAIMS_MIN: usize = 64;
/// And so many at the most, as RustDDS does.
const CLAIMS_MAX: usize = 8_192;

/// What units decide in their turns, kept for the whole of an epoch by a process that starts with `modules` modules.
#[must_use]
pub fn claims(modules: usize) -> Topic<SpotClaim> {
    Topic::latched(topic::CLAIMS, claims_depth(modules))
}

fn claims_depth(modules: usize) -> usize {
    modules
        .saturating_mul(CLAIMS_PER_MODULE)
        .clamp(CLAIMS_MIN, CLAIMS_MAX)
}

/// How many modules a process can come to host that starts with `modules` modules.
pub(crate) fn room_for_modules(modules: usize) -> usize {
    modules.max(claims_depth(modules) / CLAIMS_PER_MODULE)
}

/// Where a module's driver is to go; repeated while the goal holds.
#[must_use]
pub fn goal_pose(module: ModuleId) -> Topic<PoseStamped> {
    Topic::of_module(module, topic::GOAL_POSE, Quality::Prompt { depth: 1 })
}

/// What a module's driver is to do with its ports; repeated until it is answered.
#[must_use]
pub fn docking(module: ModuleId) -> Topic<DockingRequest> {
    Topic::of_module(module, topic::DOCKING, Quality::Prompt { depth: 1 })
}

/// Where a module's driver says that it stands. A best-effort subscription matches whatever the driver offers.
#[must_use]
pub fn driver_pose(module: ModuleId) -> Topic<PoseStamped> {
    Topic::of_module(module, topic::POSE, Quality::Fleeting)
}

/// The same as odometry.
#[must_use]
pub fn driver_odometry(module: ModuleId) -> Topic<Odometry> {
    Topic::of_module(module, topic::ODOMETRY, Quality::Fleeting)
}

/// What a module's driver answers. Requests repeat, so an answer that is lost comes again.
#[must_use]
pub fn docking_result(module: ModuleId) -> Topic<DockingResult> {
    Topic::of_module(module, topic::DOCKING_RESULT, Quality::Fleeting)
}

/// So many publishers of a topic may say all that they keep of it at once: more than twice the participants that a host
/// can have in a domain.
const PUBLISHERS: usize = 256;
/// Reliable samples wait for the process at least so many at a time, which is some seconds of a flood.
const RELIABLE_STORE_MIN: usize = 1_024;
/// An epoch's decisions of a thousand modules, and what is latched of earlier ones.
const RELIABLE_STORE_MAX: usize = 4_096;

/// How many samples RustDDS keeps for a subscription, over all publishers together.
///
/// It keeps one store a topic. Of a full one it drops the oldest samples even when they are reliable and were not taken
/// yet, so the store must hold whatever can come in while the process is busy. Of one that is not full it drops nothing,
/// neither what was taken long ago nor what is large, so the store should hold no more than that: what a flood leaves
/// in it stays in memory. History is no matter of agreement between the two ends.
fn store_depth(quality: Quality) -> usize {
    match quality {
        Quality::Latched { depth } | Quality::Prompt { depth } => depth
            .saturating_mul(PUBLISHERS)
            .clamp(RELIABLE_STORE_MIN, RELIABLE_STORE_MAX),
        // One of each publisher; what is dropped is replaced by the next.
        Quality::Fleeting => PUBLISHERS,
    }
}

impl<M> Topic<M> {
    const fn latched(name: &'static str, depth: usize) -> Self {
        Self {
            module: None,
            name,
            quality: Quality::Latched { depth },
            message: PhantomData,
        }
    }

    const fn fleeting(name: &'static str) -> Self {
        Self {
            module: None,
            name,
            quality: Quality::Fleeting,
            message: PhantomData,
        }
    }

    const fn prompt(name: &'static str, depth: usize) -> Self {
        Self {
            module: None,
            name,
            quality: Quality::Prompt { depth },
            message: PhantomData,
        }
    }

    const fn of_module(module: ModuleId, name: &'static str, quality: Quality) -> Self {
        Self {
            module: Some(module),
            name,
            quality,
            message: PhantomData,
        }
    }

    /// The last part of the name, under which its traffic is counted.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The whole name, relative to the namespace of the nodes.
    #[must_use]
    pub fn path(&self) -> String {
        self.module.map_or_else(
            || self.name.to_owned(),
            |module| topic::of_module(module, self.name),
        )
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
            Quality::Prompt { depth } => prompt(depth),
        }
    }

    pub(crate) fn subscription_qos(&self) -> QosProfile {
        let depth = store_depth(self.quality);
        match self.quality {
            Quality::Latched { .. } => latched(depth),
            Quality::Fleeting => fleeting(depth),
            Quality::Prompt { .. } => prompt(depth),
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

fn prompt(depth: usize) -> QosProfile {
    latched(depth).durability(Durability::Volatile)
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
    fn each_module_has_topics_of_its_own() {
        let topic = goal_pose(ModuleId(4));
        assert_eq!(
            (topic.name(), topic.path()),
            ("goal_pose", "module_4/goal_pose".to_owned())
        );
        assert_eq!(topic.publisher_qos().durability, Durability::Volatile);
        assert_eq!(TARGET.path(), "target");
    }

    #[test]
    fn subscriptions_store_enough_for_many_publishers_and_no_more() {
        let store = |qos: QosProfile| match qos.history {
            History::KeepLast { depth } => depth,
            History::KeepAll => usize::MAX,
        };
        assert_eq!(store(HEARTBEATS.subscription_qos()), 256);
        assert_eq!(store(MODULE_STATES.subscription_qos()), 1_024);
        assert_eq!(store(claims(1).subscription_qos()), 4_096);
        assert_eq!(store(claims(10_000).subscription_qos()), 4_096);
    }

    #[test]
    fn claims_of_an_epoch_fit_whatever_a_process_hosts() {
        assert_eq!(claims(1).quality(), Quality::Latched { depth: 64 });
        assert_eq!(room_for_modules(1), 16);
        assert_eq!(room_for_modules(100), 100);
        assert_eq!(claims(100).quality(), Quality::Latched { depth: 400 });
        assert_eq!(claims(10_000).quality(), Quality::Latched { depth: 8_192 });
    }
}
