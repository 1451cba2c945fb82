//! The names of the topics, relative to the namespace of the nodes.

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
