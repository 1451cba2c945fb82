//! The names of the topics, relative to the namespace of the nodes.

use formation::model::ModuleId;

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
/// Carries [`crate::Verdict`].
pub const VERDICT: &str = "verdict";

/// Under [`of_module`]: where a driver is to go, a `geometry_msgs/msg/PoseStamped`.
pub const GOAL_POSE: &str = "goal_pose";
/// Under [`of_module`]: where a driver says that it stands, a `geometry_msgs/msg/PoseStamped`.
pub const POSE: &str = "pose";
/// Under [`of_module`]: the same as a `nav_msgs/msg/Odometry`.
pub const ODOMETRY: &str = "odom";
/// Under [`of_module`]: carries [`crate::DockingRequest`].
pub const DOCKING: &str = "docking";
/// Under [`of_module`]: carries [`crate::DockingResult`].
pub const DOCKING_RESULT: &str = "docking_result";

/// The name of one module's own topic.
#[must_use]
pub fn of_module(module: ModuleId, name: &str) -> String {
    format!("module_{}/{name}", module.0)
}
