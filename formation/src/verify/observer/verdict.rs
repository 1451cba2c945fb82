//! What an observer reports.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::model::{Epoch, FormationStage, ModuleId, SpotId};
use crate::verify::{Missing, Violation};

/// How a formation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum Outcome {
    /// Every spot of the target has exactly one module, where and docked as the target says.
    Complete,
    /// There are fewer modules than spots: as many spots as modules are filled, connected, and otherwise as they must be.
    Partial,
    /// Something is wrong, or was not done in time.
    Failed,
}

impl fmt::Display for Outcome {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Complete => "COMPLETE",
            Self::Partial => "PARTIAL",
            Self::Failed => "FAILED",
        })
    }
}

/// When the parts of an epoch were reached, since the observer's start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// The judged epoch's roster arrived.
    pub roster_known: Option<Duration>,
    /// The last of its claims arrived.
    pub last_claim: Option<Duration>,
    /// Its first unit reported that it moves.
    pub first_moving: Option<Duration>,
    /// The end state was reached.
    pub completed: Option<Duration>,
}

/// How many messages of each kind arrived.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Claims of the judged epoch, one a turn.
    pub claims: usize,
    /// (spot, selector) pairs in them.
    pub pairs: usize,
    /// Evictions in them.
    pub evictions: usize,
    /// Modules that they detached from their configurations.
    pub detached: usize,
    /// Rosters of all epochs, each counted once.
    pub epochs: usize,
    /// Messages of any kind, repetitions included.
    pub messages: u64,
    /// Messages that were dropped because a bound was reached or their sender takes no part.
    pub dropped: u64,
}

/// The judgement of a formation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// How it ended.
    pub outcome: Outcome,
    /// The epoch whose end state was judged; `None` when no roster arrived.
    pub epoch: Option<Epoch>,
    /// How many spots are filled by a settled module.
    pub filled_spots: usize,
    /// The spots that are not, ascending.
    pub open_spots: Vec<SpotId>,
    /// Which module settled on which spot.
    pub assignments: BTreeMap<ModuleId, SpotId>,
    /// The modules that are on no spot, ascending.
    pub unassigned: Vec<ModuleId>,
    /// The guarantees that were violated, in any epoch.
    pub violations: Vec<Violation>,
    /// What was not done in time.
    pub missing: Vec<Missing>,
    /// When the parts of the epoch were reached.
    pub timings: Timings,
    /// How many messages of each kind arrived.
    pub counts: Counts,
}

/// A plan that every member of its epoch has shown to hold, whether or not any module has moved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Agreement {
    /// The epoch.
    pub epoch: Epoch,
    /// Which module is to take which spot, by the claims.
    pub assignments: BTreeMap<ModuleId, SpotId>,
    /// From the arrival of the roster to that of the last claim.
    pub planning: Duration,
    /// The guarantees that the epoch's messages show to be violated.
    pub violations: Vec<Violation>,
}

/// How far a formation has come, in numbers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Progress {
    /// Which part of the work is being done.
    #[serde(rename = "phase")]
    pub stage: FormationStage,
    /// The epoch of the newest roster.
    pub epoch: Option<Epoch>,
    /// How many modules sent a message.
    pub joined: usize,
    /// How many are expected, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<usize>,
    /// How many modules hold a spot by the claims so far.
    pub planned: usize,
    /// How many members have shown the plan's digest.
    pub agreed: usize,
    /// How many modules have settled on their spots.
    pub settled: usize,
    /// How many spots the plan is to fill: the lower of the numbers of members and spots.
    pub to_fill: usize,
    /// The modules for which the present stage waits, ascending.
    pub waiting_for: Vec<ModuleId>,
}

impl Progress {
    /// Whether a target was announced and not withdrawn.
    #[must_use]
    pub fn knows_target(&self) -> bool {
        self.stage > FormationStage::WaitingForTarget
    }
}
