//! What happens in a formation, for those who watch it or look at it afterwards.
//!
//! The same entries tell of a plan, of a run that was heard on the topics, and of a simulated one. They judge nothing;
//! that is what [`crate::verify`] is for.

mod chronicler;

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::model::{Decision, Epoch, ModuleId, ModulePhase, Pose, SpotId};

pub use chronicler::Chronicler;

/// Something that happened, and when.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Entry {
    /// Milliseconds since the watching began.
    pub at_ms: u64,
    /// What happened.
    #[serde(flatten)]
    pub event: Event,
}

/// What can happen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// A convener gathers the members of a new epoch; whatever an earlier one decided no longer counts.
    Gathering(Epoch),
    /// The members of an epoch are fixed and begin to plan.
    Roster {
        /// The epoch.
        epoch: Epoch,
        /// Its members, ascending.
        modules: Vec<ModuleId>,
    },
    /// A unit took its turn. Within an epoch these come in the order of turns, without a gap.
    Claim {
        /// The epoch.
        epoch: Epoch,
        /// Counts the turns of the epoch, from 0.
        turn: u32,
        /// The module that decided.
        claimant: ModuleId,
        /// What it decided.
        decision: Decision,
    },
    /// A module told something new about itself.
    State(Told),
    /// A module that told nothing else stands elsewhere now.
    Pose {
        /// The module.
        module: ModuleId,
        /// Where it stands.
        pose: Pose,
    },
}

/// What a module tells about itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Told {
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
}
