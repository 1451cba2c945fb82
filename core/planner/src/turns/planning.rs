//! The facade of the planner: every agent steps through the same turns and reaches the same plan.
//!
//! Units take turns in a fixed order. Each turn is one atomic [`Decision`]: which spots change hands, which modules are
//! evicted, which leave a configuration. A replica accepts a decision only if it equals its own computation.

use std::sync::Arc;

use thiserror::Error;

use super::turn_order::TurnQueue;
use super::turn_result::TurnResult;
use crate::assignment::{Allocation, ChainSearch, Holder, Instance};
use crate::baseline::Favourites;
use crate::placement::SearchBudget;
use crate::policies::WholeAllocation;
use formation_model::{Decision, ModuleId, PlanningProblem, SpotId};

/// One unit's turn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Turn {
    /// Counts the turns, from 0.
    pub number: u32,
    /// The module that decides: the unit's leader.
    pub claimant: ModuleId,
    /// The unit's modules, ascending.
    pub modules: Vec<ModuleId>,
}

/// Why a claim was refused. A refused claim changes nothing.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ClaimRefused {
    /// Every turn has been taken.
    #[error("every turn has been taken")]
    NoTurnLeft,
    /// It is another module's turn.
    #[error("it is the turn of {expected}")]
    WrongClaimant {
        /// The module whose turn it is.
        expected: ModuleId,
    },
    /// The decision differs from the one that follows from the shared input.
    #[error(
        "the decision differs from this replica's own in turn {turn}: {} pairs and {} evictions, expected {} and {}",
        claimed.selections.len(), claimed.evictions.len(), expected.selections.len(), expected.evictions.len()
    )]
    DifferentDecision {
        /// The turn.
        turn: u32,
        /// This replica's decision.
        expected: Box<Decision>,
        /// The claimed decision.
        claimed: Box<Decision>,
    },
}

/// The replicated state of one epoch's planning.
#[derive(Clone, Debug)]
pub struct Planning {
    pub(super) instance: Instance,
    pub(super) queue: TurnQueue,
    pub(super) allocation: Allocation,
    pub(super) search: ChainSearch,
    /// The state of the policy `paper` between turns.
    pub(super) favourites: Favourites,
    /// The allocation of a policy that decides at once.
    pub(super) whole: Option<WholeAllocation>,
    pub(super) applied_turns: u32,
    /// The groups of modules that stay together, in the order of their turns.
    pub(super) blocks: Vec<Vec<usize>>,
    pub(super) proven: bool,
    /// What the placements of the turns to come may spend.
    pub(super) budget: SearchBudget,
    /// The decision of the unit whose turn it is with its effects, once computed.
    pub(super) pending: Option<(Decision, TurnResult)>,
}

impl Planning {
    /// The input.
    pub fn problem(&self) -> &Arc<PlanningProblem> {
        &self.instance.problem
    }

    /// The problem as laid out for planning, with the target that is formed.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// The spots of the formed target that stay empty, ascending: the modules are too few to join the pinned ones.
    pub fn closed_spots(&self) -> impl Iterator<Item = SpotId> + '_ {
        let holders = self.allocation.table.holders().iter().enumerate();
        holders
            .filter(|&(_, &holder)| holder == Holder::Closed)
            .map(|(spot, _)| self.spot_id(spot))
    }

    /// The next turn; `None` when every turn has been taken.
    pub fn turn(&self) -> Option<Turn> {
        let unit = self.queue.next()?;
        let members = unit.members.iter();
        Some(Turn {
            number: self.applied_turns,
            claimant: self.module_id(unit.leader),
            modules: members.map(|&member| self.module_id(member)).collect(),
        })
    }

    /// The decision of the unit whose turn it is; `None` when every turn has been taken. Kept until it is applied.
    pub fn decide(&mut self) -> Option<Decision> {
        self.compute().cloned()
    }

    /// Applies a claimed decision if it is the turn of `claimant` and the decision equals this replica's own.
    ///
    /// # Errors
    /// Names the reason; then nothing has changed.
    pub fn apply(&mut self, claimant: ModuleId, decision: &Decision) -> Result<(), ClaimRefused> {
        let turn = self.applied_turns;
        let unit = self.queue.next().ok_or(ClaimRefused::NoTurnLeft)?;
        let expected = self.module_id(unit.leader);
        if claimant != expected {
            return Err(ClaimRefused::WrongClaimant { expected });
        }
        let expected = self.compute().ok_or(ClaimRefused::NoTurnLeft)?;
        if expected != decision {
            return Err(ClaimRefused::DifferentDecision {
                turn,
                expected: Box::new(expected.clone()),
                claimed: Box::new(decision.clone()),
            });
        }
        self.advance();
        Ok(())
    }

    /// The number of turns that have been applied.
    pub fn applied_turns(&self) -> u32 {
        self.applied_turns
    }

    /// The spot that a module holds after the turns applied so far.
    pub fn spot_of(&self, module: ModuleId) -> Option<SpotId> {
        let position = self.problem().position_of(module)?;
        let spot = self.allocation.table.spot_of(position)?;
        Some(self.spot_id(spot))
    }

    /// Takes all turns that are left, and returns them with their decisions.
    pub fn take_all_turns(&mut self) -> Vec<(Turn, Decision)> {
        self.take_all_turns_with(|_, _| {})
    }

    /// The same; after each turn, `report` gets the number of turns that are taken, and of those that are left. A
    /// configuration that is not placed whole adds turns.
    pub fn take_all_turns_with(
        &mut self,
        mut report: impl FnMut(usize, usize),
    ) -> Vec<(Turn, Decision)> {
        self.search.expect_to_be_alone();
        let mut decisions = Vec::new();
        while let Some(turn) = self.turn() {
            self.compute();
            let Some(decision) = self.advance() else {
                break;
            };
            decisions.push((turn, decision));
            report(decisions.len(), self.queue.len());
        }
        decisions
    }

    pub(super) fn module_id(&self, position: usize) -> ModuleId {
        self.instance.problem.modules()[position].id
    }

    pub(super) fn spot_id(&self, position: usize) -> SpotId {
        self.instance.target.spots()[position].id
    }

    /// Makes the pending turn's result the state, and returns its decision.
    fn advance(&mut self) -> Option<Decision> {
        let (decision, result) = self.pending.take()?;
        self.queue.pop()?;
        self.queue
            .insert_remainder(&self.instance, &result.remainder);
        self.allocation = result.allocation;
        let blocks = result.blocks.into_iter();
        self.blocks.extend(blocks.filter(|block| block.len() > 1));
        self.proven &= result.proven;
        self.budget.spend(result.nodes);
        self.applied_turns += 1;
        Some(decision)
    }
}
