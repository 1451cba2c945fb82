//! What happens in a formation, for programs that show it while it happens or afterwards.
//!
//! The same entries describe a plan, a run that was observed on the topics, and a simulated run. A [`Recorder`] makes
//! them of messages, a [`Scene`] is the state to which they lead, and a [`SceneChange`] is one of its changes in words. None of
//! these judges anything; the crate `formation_verify` does.

mod recorder;
mod scene;
mod scene_change;

use std::collections::BTreeSet;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use formation_model::{Decision, Digest, Epoch, ModuleId, ModulePhase, Pose, SpotId};

pub use recorder::{POSE_INTERVAL, Recorder};
pub use scene::{AppliedEntry, Scene, SceneModule};
pub use scene_change::SceneChange;

/// A time or a duration, in milliseconds.
#[must_use]
pub fn milliseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_millis()).unwrap_or(u64::MAX)
}

/// Something that happened, and when.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    /// Milliseconds since the observation began.
    pub at_ms: u64,
    /// What happened.
    #[serde(flatten)]
    pub event: LogEvent,
}

/// What can happen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LogEvent {
    /// A convener gathers the members of a new epoch. What an earlier epoch decided no longer counts.
    Gathering(Epoch),
    /// The members of an epoch are fixed and begin to plan.
    Roster {
        /// The epoch.
        epoch: Epoch,
        /// Its members, ascending.
        modules: Vec<ModuleId>,
        /// Those of them that take no spot, because they are retired or their motion failed; ascending.
        #[serde(default)]
        out_of_service: Vec<ModuleId>,
        /// The digest of the problem for which they plan; `None` if they have nothing to plan.
        #[serde(default)]
        problem: Option<Digest>,
    },
    /// A unit took its turn. Within an epoch these come in the order of turns, without a gap.
    Claim {
        /// The epoch.
        epoch: Epoch,
        /// Counts the turns of the epoch, from 0.
        turn: u32,
        /// The module that published the decision.
        claimant: ModuleId,
        /// What it decided.
        decision: Decision,
    },
    /// Something other than the pose of a module changed.
    State(ModuleSnapshot),
    /// The pose of a module changed, and nothing else.
    Pose {
        /// The module.
        module: ModuleId,
        /// Where it stands.
        pose: Pose,
    },
}

/// A module at one moment, by its own report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModuleSnapshot {
    /// The module.
    pub module: ModuleId,
    /// What it is doing.
    pub phase: ModulePhase,
    /// Where it stands.
    pub pose: Pose,
    /// The modules that it is docked to.
    pub links: BTreeSet<ModuleId>,
    /// The spot that the plan gives it.
    pub spot: Option<SpotId>,
    /// The module whose acting unit it moves with.
    pub unit: Option<ModuleId>,
    /// Whether it takes a spot if the plan gives it one: it is not retired, and its drive has not failed.
    #[serde(default = "is_so", skip_serializing_if = "Clone::clone")]
    pub in_service: bool,
}

fn is_so() -> bool {
    true
}
