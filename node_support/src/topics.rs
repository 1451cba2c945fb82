//! The topics of the formation: their names, types, quality of service and senders, in one table.

use formation_model::ModuleId;
use formation_msgs::external::geometry_msgs::PoseStamped;
use formation_msgs::external::nav_msgs::{Odometry, Path};
use formation_msgs::external::tf2_msgs::TFMessage;
use formation_msgs::external::visualization_msgs::MarkerArray;
use formation_msgs::{
    DockingRequest, DockingResult, Eviction, Heartbeat, InterfaceType, ModuleStates,
    OperatorCommand, Roster, SpotClaim, TargetConfiguration, Verdict, WorldReport, topic,
};
use ros_runtime::topic::{Quality, Topic, Untyped};

/// The last sample of every publisher reaches late subscribers.
const LATCHED: Quality = Quality::TransientLocal { depth: 1 };
/// A subscriber that is there gets the latest sample.
const RELIABLE: Quality = Quality::ReliableVolatile { depth: 1 };

const fn topic<M: InterfaceType>(name: &'static str, quality: Quality) -> Topic<M> {
    Topic::new(name, M::PACKAGE, M::NAME, quality)
}

/// The programs of a formation, by what they may publish.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// Hosts modules, or drives their robots.
    Module,
    /// The target publisher.
    TargetPublisher,
    /// The verifier.
    Verifier,
    /// Commands of an operator.
    Operator,
    /// The visualiser.
    Visualiser,
}

/// A topic of the formation.
#[derive(Debug)]
pub struct ListedTopic {
    /// Its name, type and quality of service.
    pub topic: Topic<Untyped>,
    /// Who may publish it.
    pub senders: &'static [Sender],
}

/// Declares the topics of the formation, each with its name, quality of service and senders. Recorders record all of them, and
/// routers over Zenoh let the senders publish them.
macro_rules! topics {
    ($($(#[$documentation:meta])* $constant:ident: $message:ty = $name:expr, $quality:expr, [$($sender:ident),+];)+) => {
        $($(#[$documentation])*
        pub const $constant: Topic<$message> = topic($name, $quality);)+

        /// Every topic of the formation that is not of one module.
        #[must_use]
        pub fn all() -> Vec<ListedTopic> {
            vec![$(ListedTopic {
                topic: $constant.untyped(),
                senders: &[$(Sender::$sender),+],
            }),+]
        }
    };
}

topics! {
    /// The target that all modules are to form.
    TARGET: TargetConfiguration = topic::TARGET, LATCHED, [TargetPublisher];
    /// The states of the modules of a process.
    MODULE_STATES: ModuleStates = topic::MODULE_STATES, LATCHED, [Module];
    /// What the convener announces.
    ROSTER: Roster = topic::ROSTER, LATCHED, [Module];
    /// The claims of units, as a process with few modules keeps them; [`claims`] is for any number.
    CLAIMS: SpotClaim = topic::CLAIMS, Quality::TransientLocal { depth: CLAIMS_MIN }, [Module];
    /// Evictions, for observers.
    EVICTIONS: Eviction = topic::EVICTIONS, Quality::TransientLocal { depth: 100 }, [Module];
    /// Heartbeats of modules.
    HEARTBEATS: Heartbeat = topic::HEARTBEATS, Quality::BestEffort, [Module];
    /// What operators command to all modules.
    COMMANDS: OperatorCommand = topic::COMMANDS, LATCHED, [TargetPublisher, Operator];
    /// The verifier's verdict.
    VERDICT: Verdict = topic::VERDICT, LATCHED, [Verifier];
    /// What a physical world counts.
    WORLD_REPORT: WorldReport = "world_report", LATCHED, [Module];
    /// The formation as markers; each sample is the whole picture.
    MARKERS: MarkerArray = "markers", LATCHED, [Visualiser];
    /// The poses of modules.
    TRANSFORMS: TFMessage = "/tf", RELIABLE, [Visualiser];
    /// The poses of spots.
    FIXED_TRANSFORMS: TFMessage = "/tf_static", LATCHED, [Visualiser];
}

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

/// The topics between a module and its driver.
#[must_use]
pub fn all_of_module(module: ModuleId) -> [Topic<Untyped>; 6] {
    [
        goal_pose(module).untyped(),
        path(module).untyped(),
        docking(module).untyped(),
        driver_pose(module).untyped(),
        driver_odometry(module).untyped(),
        docking_result(module).untyped(),
    ]
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
    fn the_page_of_topics_has_a_row_for_each_with_a_type_of_ours() {
        let page = include_str!("../../docs/topics.md");
        for ListedTopic { topic, .. } in all() {
            let (package, type_name) = topic.type_name();
            let row = format!("| `{}` | `{type_name}`", topic.path());
            assert!(package != "formation_msgs" || page.contains(&row), "{row}");
        }
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
