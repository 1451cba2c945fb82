//! The names of the topics, relative to the namespace of the nodes.

use formation_model::ModuleId;

/// Carries [`crate::TargetConfiguration`].
pub const TARGET: &str = "target";
/// Carries [`crate::ModuleStates`].
pub const MODULE_STATES: &str = "module_states";
/// Carries [`crate::Roster`].
pub const ROSTER: &str = "roster";
/// Carries [`crate::SpotClaim`].
pub const CLAIMS: &str = "claims";
/// Carries [`crate::Eviction`].
pub const EVICTIONS: &str = "evictions";
/// Carries [`crate::Heartbeat`].
pub const HEARTBEATS: &str = "heartbeats";
/// Carries [`crate::OperatorCommand`].
pub const COMMANDS: &str = "commands";
/// Carries [`crate::Verdict`].
pub const VERDICT: &str = "verdict";

/// Under [`prefix_of`]: where a driver is to go, a `geometry_msgs/msg/PoseStamped`.
pub const GOAL_POSE: &str = "goal_pose";
/// Under [`prefix_of`]: the poses that a driver is to pass from its goal on, a `nav_msgs/msg/Path`.
pub const PATH: &str = "path";
/// Under [`prefix_of`]: where a driver says that it stands, a `geometry_msgs/msg/PoseStamped`.
pub const POSE: &str = "pose";
/// Under [`prefix_of`]: the same as a `nav_msgs/msg/Odometry`.
pub const ODOMETRY: &str = "odom";
/// Under [`prefix_of`]: carries [`crate::DockingRequest`].
pub const DOCKING: &str = "docking";
/// Under [`prefix_of`]: carries [`crate::DockingResult`].
pub const DOCKING_RESULT: &str = "docking_result";

/// The prefix of one module's own topics.
#[must_use]
pub fn prefix_of(module: ModuleId) -> String {
    format!("module_{}", module.0)
}
