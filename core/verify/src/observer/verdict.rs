//! The reports of an observer.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::violation::{Missing, Violation};
use formation_model::{BlockedSpot, Epoch, FormationStage, ModuleId, SpotId};

/// The outcome of a formation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum Outcome {
    /// Every spot of the target has exactly one module, at its pose and docked as in the target.
    Complete,
    /// There are fewer modules than spots, or bodies block spots. As many spots are filled and connected as there are modules
    /// or connected spots that no body blocks, with the poses and links of the target.
    Partial,
    /// There are violations, or the formation was not done in time.
    Failed,
    /// The formation is done, and bodies overlapped by no more than the stated uncertainty of both: whether they touched is not known.
    #[serde(rename = "NOT_JUDGED")]
    NotJudged,
}

/// Two bodies that overlapped, so that modules may have run into each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{first} and {second} overlapped in {epoch}")]
pub struct CollisionRisk {
    /// By the plan of this epoch.
    pub epoch: Epoch,
    /// One of the modules.
    pub first: ModuleId,
    /// The other.
    pub second: ModuleId,
}

/// The times of milestones, as received, since the observer's start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// The judged epoch's roster was received.
    pub roster_known: Option<Duration>,
    /// The last of its claims was received.
    pub last_claim: Option<Duration>,
    /// The first state MOVING or SETTLED of a module that was not pinned was received.
    pub first_moving: Option<Duration>,
    /// The end state was reached.
    pub completed: Option<Duration>,
}

/// The numbers of messages and their contents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Claims of the judged epoch, one for each turn.
    pub claims: usize,
    /// (spot, selector) pairs in them.
    pub pairs: usize,
    /// Evictions in them.
    pub evictions: usize,
    /// Modules in them that leave their configurations.
    pub detached: usize,
    /// Rosters of all epochs, each counted once.
    pub epochs: usize,
    /// Messages of any kind, repetitions included.
    pub messages: u64,
    /// Messages that were dropped because a limit was reached.
    pub dropped: u64,
    /// Segments of motion, from one published pose to the next, that were compared with the bodies of all other modules.
    #[serde(default)]
    pub segments: u64,
    /// States that did not arrive: the motion before and after them is not judged.
    #[serde(default)]
    pub missed_states: u64,
    /// Promises of epochs that have ended of which no message showed that they were kept: agreement before motion, and a placed
    /// neighbour.
    #[serde(default)]
    pub unproven: u64,
}

/// The verdict on a formation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// The outcome.
    pub outcome: Outcome,
    /// The epoch whose end state was judged; `None` without a roster for the target in force.
    pub epoch: Option<Epoch>,
    /// The number of spots with a settled module.
    pub filled_spots: usize,
    /// The spots without a settled module, ascending.
    pub open_spots: Vec<SpotId>,
    /// The spots that bodies block, by the judged roster, ascending.
    pub blocked_spots: Vec<BlockedSpot>,
    /// The spots of the settled modules.
    pub assignments: BTreeMap<ModuleId, SpotId>,
    /// The modules that have not settled on a spot, ascending.
    pub unassigned: Vec<ModuleId>,
    /// The violations of all epochs.
    pub violations: Vec<Violation>,
    /// What the formation lacks.
    pub missing: Vec<Missing>,
    /// The times of milestones.
    pub timings: Timings,
    /// The numbers of messages and their contents.
    pub counts: Counts,
    /// Why the motion was not free of collisions, if it was not.
    pub collision_risk: Option<CollisionRisk>,
    /// The moving modules of which it is not known whether they touched others, and for how long.
    pub unjudged: BTreeMap<ModuleId, Duration>,
}

/// A plan whose digest every member of its epoch has shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Agreement {
    /// The epoch.
    pub epoch: Epoch,
    /// The spots that the claims give to modules.
    pub assignments: BTreeMap<ModuleId, SpotId>,
    /// The time from the roster to the last claim, as received.
    pub planning: Duration,
    /// The violations that the epoch's messages show.
    pub violations: Vec<Violation>,
}

/// The progress of a formation in numbers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Progress {
    /// The stage.
    #[serde(rename = "phase")]
    pub stage: FormationStage,
    /// The epoch of the newest roster.
    pub epoch: Option<Epoch>,
    /// The number of modules of which messages were received.
    pub joined: usize,
    /// The number of modules expected, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<usize>,
    /// The number of modules with a spot by the claims so far.
    pub planned: usize,
    /// The number of members that have shown the plan's digest.
    pub agreed: usize,
    /// The number of modules that have settled.
    pub settled: usize,
    /// The number of spots that the plan fills: the lesser of the numbers of members and spots.
    pub to_fill: usize,
    /// Whether the modules stand still on command.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub stopped: bool,
    /// The modules for which the stage waits, ascending.
    pub waiting_for: Vec<ModuleId>,
}

impl Progress {
    /// Whether a target was announced and not withdrawn.
    pub fn knows_target(&self) -> bool {
        self.stage > FormationStage::WaitingForTarget
    }
}
