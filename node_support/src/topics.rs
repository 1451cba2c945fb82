//! The topics of the formation: their names, types and quality of service, in one table.

use formation_model::ModuleId;
use formation_msgs::external::geometry_msgs::PoseStamped;
use formation_msgs::external::nav_msgs::{Odometry, Path};
use formation_msgs::external::tf2_msgs::TFMessage;
use formation_msgs::external::visualization_msgs::MarkerArray;
use formation_msgs::{
    DockingRequest, DockingResult, Eviction, Heartbeat, InterfaceType, ModuleStates,
    OperatorCommand, Roster, SpotClaim, TargetConfiguration, Verdict, topic,
};
use ros_runtime::topic::{Quality, Topic};

/// The last sample of every publisher reaches late subscribers.
const LATCHED: Quality = Quality::TransientLocal { depth: 1 };
/// A subscriber that is there gets the latest sample.
const RELIABLE: Quality = Quality::ReliableVolatile { depth: 1 };

const fn topic<M: InterfaceType>(name: &'static str, quality: Quality) -> Topic<M> {
    Topic::new(name, M::PACKAGE, M::NAME, quality)
}

/// The target that all modules are to form.
pub const TARGET: Topic<TargetConfiguration> = topic(topic::TARGET, LATCHED);
/// The states of the modules of a process.
pub const MODULE_STATES: Topic<ModuleStates> = topic(topic::MODULE_STATES, LATCHED);
/// What the convener announces.
pub const ROSTER: Topic<Roster> = topic(topic::ROSTER, LATCHED);
/// Evictions, for observers.
pub const EVICTIONS: Topic<Eviction> =
    topic(topic::EVICTIONS, Quality::TransientLocal { depth: 100 });
/// Heartbeats of modules.
pub const HEARTBEATS: Topic<Heartbeat> = topic(topic::HEARTBEATS, Quality::BestEffort);
/// What operators command to all modules.
pub const COMMANDS: Topic<OperatorCommand> = topic(topic::COMMANDS, LATCHED);
/// The verifier's verdict.
pub const VERDICT: Topic<Verdict> = topic(topic::VERDICT, LATCHED);
/// The formation as markers; each sample is the whole picture.
pub const MARKERS: Topic<MarkerArray> = topic("markers", LATCHED);
/// The poses of modules.
pub const TRANSFORMS: Topic<TFMessage> = topic("/tf", RELIABLE);
/// The poses of spots.
pub const FIXED_TRANSFORMS: Topic<TFMessage> = topic("/tf_static", LATCHED);

/// A module claims once as a singleton, or once for each smaller piece of its configuration that it leads.
const CLAIMS_PER_MODULE: usize = 4;
/// The least number of claims that a process keeps, which leaves room for modules that are added.
const CLAIMS_MIN: usize = 64;
/// The deepest history that RustDDS allows.
const CLAIMS_MAX: usize = 8_192;

/// The claims of units, kept for the whole of an epoch by a process that starts with `modules` modules.
#[must_use]
pub fn claims(modules: usize) -> Topic<SpotClaim> {
    let depth = claims_depth(modules);
    topic(topic::CLAIMS, Quality::TransientLocal { depth })
}

fn claims_depth(modules: usize) -> usize {
    modules
        .saturating_mul(CLAIMS_PER_MODULE)
        .clamp(CLAIMS_MIN, CLAIMS_MAX)
}

/// How many modules a process can come to host that starts with `modules` modules.
#[must_use]
pub fn room_for_modules(modules: usize) -> usize {
    modules.max(claims_depth(modules) / CLAIMS_PER_MODULE)
}

fn of_module<M: InterfaceType>(module: ModuleId, name: &'static str, quality: Quality) -> Topic<M> {
    topic(name, quality).below(topic::prefix_of(module))
}

/// The goal of a module's driver; repeated while the goal holds.
#[must_use]
pub fn goal_pose(module: ModuleId) -> Topic<PoseStamped> {
    of_module(module, topic::GOAL_POSE, RELIABLE)
}

/// The path of a module: its goal and the poses after it. For drivers that look ahead; it is no command to move.
#[must_use]
pub fn path(module: ModuleId) -> Topic<Path> {
    of_module(module, topic::PATH, LATCHED)
}

/// What a module's driver is to do with its ports; repeated until it is answered.
#[must_use]
pub fn docking(module: ModuleId) -> Topic<DockingRequest> {
    of_module(module, topic::DOCKING, RELIABLE)
}

/// The pose of a module, from its driver. A best-effort subscription matches any quality that the driver offers.
#[must_use]
pub fn driver_pose(module: ModuleId) -> Topic<PoseStamped> {
    of_module(module, topic::POSE, Quality::BestEffort)
}

/// The pose of a module as odometry, from its driver.
#[must_use]
pub fn driver_odometry(module: ModuleId) -> Topic<Odometry> {
    of_module(module, topic::ODOMETRY, Quality::BestEffort)
}

/// The answers of a module's driver. Requests repeat, so an answer that is lost comes again.
#[must_use]
pub fn docking_result(module: ModuleId) -> Topic<DockingResult> {
    of_module(module, topic::DOCKING_RESULT, Quality::BestEffort)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_module_has_topics_of_its_own() {
        let topic = goal_pose(ModuleId(4));
        assert_eq!(
            (topic.name(), topic.path()),
            ("goal_pose", "module_4/goal_pose".to_owned())
        );
        assert_eq!(topic.type_name(), ("geometry_msgs", "PoseStamped"));
        assert_eq!(topic.quality(), Quality::ReliableVolatile { depth: 1 });
        assert_eq!(TARGET.path(), "target");
    }

    #[test]
    fn claims_of_an_epoch_fit_however_many_modules_a_process_hosts() {
        let depth = |depth| Quality::TransientLocal { depth };
        assert_eq!(claims(1).quality(), depth(64));
        assert_eq!(room_for_modules(1), 16);
        assert_eq!(room_for_modules(100), 100);
        assert_eq!(claims(100).quality(), depth(400));
        assert_eq!(claims(10_000).quality(), depth(8_192));
    }
}
