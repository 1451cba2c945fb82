//! The stages of an epoch. Each owns what exists only while it lasts, and a step leads to the next.

mod acting;
mod agreeing;
mod claims;
mod gathering;
mod held_plan;
mod invalid_start;
mod off_path;
mod planning;
mod proofs;
mod route;

use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    ClosedRoster, DriveState, Epoch, ModuleId, ModulePhase, ModuleState, Pose, Roster, SpotClaim,
};
use formation_motion::MotionGoal;

pub(super) use acting::Acting;
pub(super) use agreeing::Agreeing;
pub(super) use gathering::Gathering;
pub(super) use held_plan::HeldPlan;
pub(super) use planning::Planning;

use super::context::Context;
use super::refusal::Refusal;

/// The progress of a module in the latest epoch that it knows.
#[derive(Clone, Hash)]
pub(super) enum Stage {
    /// No roster or gathering includes this module; the epoch is the last that did.
    Listening(Option<Epoch>),
    /// Halted and frozen; a roster is awaited, or collected if this module convenes.
    Gathering(Gathering),
    /// The units take turns.
    Planning(Box<Planning>),
    /// The plan is complete; all members have to show its digest.
    Agreeing(Box<Agreeing>),
    /// All members have agreed; the units move.
    Acting(Box<Acting>),
    /// The latest roster does not list this module.
    Outsider(Outsider),
}

/// A roster that does not list this module.
#[derive(Clone)]
pub(super) struct Outsider {
    pub roster: Arc<ClosedRoster>,
    /// When this module stood aside for it.
    pub since: Duration,
}

impl Hash for Outsider {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let Self { roster, since } = self;
        hash_roster(roster, state);
        since.hash(state);
    }
}

/// Hashes a roster. The revision identifies its target.
pub(super) fn hash_roster(roster: &Roster, state: &mut impl Hasher) {
    (roster.epoch, roster.target.revision).hash(state);
    (&roster.members, &roster.voters, &roster.bodies).hash(state);
}

/// The result of a step.
pub(super) enum Transition {
    /// The stage lasts until the next input.
    Stay(Stage),
    /// Another stage begins, and takes its first step at once.
    Enter(Stage),
}

impl Stage {
    /// Does what is due.
    pub fn step(self, context: &mut Context) -> Transition {
        match self {
            Self::Gathering(gathering) => gathering.step(context),
            Self::Planning(planning) => planning.step(context),
            Self::Agreeing(agreeing) => agreeing.step(context),
            Self::Acting(acting) => acting.step(context),
            Self::Listening(_) | Self::Outsider(_) => Transition::Stay(self),
        }
    }

    /// The latest epoch that this module has entered.
    pub fn epoch(&self) -> Option<Epoch> {
        match self {
            Self::Listening(epoch) => *epoch,
            Self::Gathering(gathering) => Some(gathering.epoch),
            _ => self.roster().map(|roster| roster.epoch),
        }
    }

    /// The roster of the epoch, whether or not it lists this module.
    pub fn roster(&self) -> Option<&Arc<ClosedRoster>> {
        match self {
            Self::Planning(planning) => Some(&planning.roster),
            Self::Agreeing(agreeing) => Some(&agreeing.held.roster),
            Self::Acting(acting) => Some(&acting.held.roster),
            Self::Outsider(Outsider { roster, .. }) => Some(roster),
            Self::Listening(_) | Self::Gathering(_) => None,
        }
    }

    /// Whether the module has settled.
    pub fn is_settled(&self) -> bool {
        matches!(self, Self::Acting(acting) if acting.is_settled())
    }

    /// Whether every member of the plan has done its part.
    pub fn is_carried_out(&mut self, context: &Context) -> bool {
        match self {
            Self::Acting(acting) => acting.have_all_acted(context),
            _ => false,
        }
    }

    /// The complete plan that this module holds.
    pub fn held_plan(&self) -> Option<&HeldPlan> {
        match self {
            Self::Agreeing(agreeing) => Some(&agreeing.held),
            Self::Acting(acting) => Some(&acting.held),
            _ => None,
        }
    }

    pub fn phase(&self) -> ModulePhase {
        match self {
            Self::Listening(_) => ModulePhase::Listening,
            Self::Gathering(gathering) => gathering.phase(),
            Self::Planning(planning) => planning.phase(),
            Self::Agreeing(_) => ModulePhase::Agreeing,
            Self::Acting(acting) => acting.phase(),
            Self::Outsider(_) => ModulePhase::Spare,
        }
    }

    /// The number of turns of the epoch that this module has applied.
    pub fn applied_turns(&self) -> u32 {
        match self {
            Self::Planning(planning) => planning.applied(),
            _ => self.held_plan().map_or(0, |held| held.turns),
        }
    }

    /// Whether this module is measured off what its plan lets it do.
    pub fn is_off_path(&self) -> bool {
        matches!(self, Self::Acting(acting) if acting.is_off_path())
    }

    /// Compares where another module shows itself with what the plan lets it do.
    pub fn follow_place(&mut self, state: &ModuleState, context: &Context) {
        if let Self::Acting(acting) = self {
            acting.held.follow_place(state, context);
        }
    }

    /// Whether it may change what is due for this module how far another one is on its way.
    pub fn waits_for(&self, module: ModuleId) -> bool {
        match self {
            Self::Acting(acting) => acting.waits_for(module),
            _ => true,
        }
    }

    /// The number of steps of its path that this module has done in the epoch.
    pub fn steps_done(&self) -> u32 {
        match self {
            Self::Acting(acting) => acting.steps_done(),
            _ => 0,
        }
    }

    /// The goals of the present step and of all after it, while modules act.
    pub fn path_ahead(&self) -> Vec<Pose> {
        match self {
            Self::Acting(acting) => acting.path_ahead(),
            _ => Vec::new(),
        }
    }

    /// Whether a changed state may be published now. Others take a module that carries out no plan of theirs to stand where its
    /// state shows it, so such a module publishes at rest only, with no port at work.
    /// Enforces G1.
    pub fn may_publish_state(&self, context: &Context) -> bool {
        let carries_out = matches!(
            self,
            Self::Planning(_) | Self::Agreeing(_) | Self::Acting(_)
        );
        carries_out || context.robot.is_at_rest()
    }

    /// Adds to a state what this stage knows.
    pub fn describe(&mut self, state: &mut ModuleState, context: &mut Context) {
        if let Self::Planning(_) | Self::Agreeing(_) = self
            && let Some(member) = self.roster().and_then(|roster| roster.member(state.module))
            && member.module.pose.distance_to(&state.pose) > context.spot_limit()
        {
            state.drive = DriveState::Displaced;
        }
        match self {
            Self::Gathering(gathering) => gathering.describe(state, context),
            Self::Agreeing(agreeing) => agreeing.held.describe(state),
            Self::Acting(acting) => acting.describe(state),
            Self::Listening(_) | Self::Planning(_) | Self::Outsider(_) => {}
        }
    }

    /// Takes a claim of the present epoch.
    pub fn take_claim(&mut self, claim: Arc<SpotClaim>) -> Result<(), Refusal> {
        match self {
            Self::Gathering(gathering) => gathering.claims.keep(claim),
            Self::Planning(planning) => planning.take_claim(claim),
            _ => Err(Refusal::StaleEpoch),
        }
    }

    /// The goal that is published again with each heartbeat, if the module may move.
    pub fn repeated_goal(&self, context: &Context) -> Option<MotionGoal> {
        match self {
            Self::Acting(acting) => acting.repeated_goal(context),
            _ => None,
        }
    }
}
