//! The planner's facade: every agent steps through the same turns and reaches the same plan.
//!
//! Units take turns in a fixed order. Each turn is one atomic [`Decision`]: which spots change hands, who is evicted,
//! who leaves a configuration. A replica accepts a decision only if it equals what it computes itself.

use std::sync::Arc;

use thiserror::Error;

use crate::model::{
    Decision, EvictionRecord, MicroUnits, ModuleId, Plan, PlanningProblem, Policy, SpotId,
    SpotSelection, Target, TurnOrder,
};
use crate::planner::assembly;
use crate::planner::assignment::eviction::{Allocation, ChainSearch};
use crate::planner::assignment::spot_allocation::{self, Displacement};
use crate::planner::assignment::{Holder, Instance, exact_finish};
use crate::planner::baseline::paper::{Favourites, PaperTurn};
use crate::planner::baseline::{self, AuctionCounts, CentralAssignment};
use crate::planner::turns::turn_order::{TurnQueue, Unit};

pub use outcome::{PlanOutcome, plan};

pub(crate) mod block_allocation;
mod outcome;
mod trimming;
pub(crate) mod turn_order;

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

/// Why a claim was refused; nothing has changed.
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
        /// What this replica computed.
        expected: Box<Decision>,
        /// What was claimed.
        claimed: Box<Decision>,
    },
}

/// The replicated state of one epoch's planning; every agent steps through the same turns.
#[derive(Clone, Debug)]
pub struct Planning {
    instance: Instance,
    /// The spots of the problem's target that are not formed, ascending.
    trimmed_spots: Vec<SpotId>,
    queue: TurnQueue,
    allocation: Allocation,
    search: ChainSearch,
    /// What the policy `paper` remembers between turns.
    favourites: Favourites,
    /// What a central policy has assigned before the first turn.
    central: Option<CentralAssignment>,
    applied_turns: u32,
    /// The blocks that keep together, in the order of their turns.
    blocks: Vec<Vec<usize>>,
    proven: bool,
    /// What the unit whose turn it is decides, once it has been computed.
    pending: Option<Pending>,
    /// The memory of an earlier turn's allocation.
    spare: Allocation,
}

/// A computed turn that is not applied yet.
#[derive(Clone, Debug)]
struct Pending {
    decision: Decision,
    allocation: Allocation,
    /// The blocks that keep together from this turn on.
    blocks: Vec<Vec<usize>>,
    /// What leaves its configuration and has turns to come.
    remainder: Vec<Vec<usize>>,
    proven: bool,
}

impl Planning {
    /// Begins to plan. With fewer modules than spots the target is trimmed first, unless the parameters forbid it.
    #[must_use]
    pub fn new(problem: Arc<PlanningProblem>) -> Self {
        let full = Arc::clone(problem.target());
        if problem.parameters().keep_all_spots || problem.modules().len() >= full.spots().len() {
            let order = problem.parameters().order;
            return Self::for_target(problem, full, order, &[]);
        }
        let order = problem.parameters().order;
        let dry_run = {
            let mut planning = Self::for_target(
                Arc::clone(&problem),
                Arc::clone(&full),
                TurnOrder::SizeFirst,
                &[],
            );
            planning.take_all_turns();
            planning
        };
        let trimmed = trimming::trim(&dry_run.instance, &dry_run.holding_sizes());
        let closed: Vec<SpotId> = trimmed
            .closed
            .iter()
            .map(|&spot| full.spots()[spot].id)
            .collect();
        // Peeling keeps the target connected, so that this cannot be refused.
        let target = full.restricted_to(&trimmed.kept).map_or(full, Arc::new);
        Self::for_target(problem, target, order, &closed)
    }

    /// Plans for a target made of spots of the problem's own, of which those `closed` must stay open.
    fn for_target(
        problem: Arc<PlanningProblem>,
        target: Arc<Target>,
        order: TurnOrder,
        closed: &[SpotId],
    ) -> Self {
        let instance = Instance::new(problem, target);
        let problem = &instance.problem;
        let (module_count, spot_count) = (problem.modules().len(), instance.target.spots().len());
        let mut allocation = Allocation::new(module_count, spot_count);
        let mut queue = TurnQueue::new(order);
        let mut single = vec![true; module_count];
        for (position, module) in problem.modules().iter().enumerate() {
            if let Some(spot) = module.pin.and_then(|pin| instance.target.position_of(pin)) {
                allocation.table.give(spot, Holder::Fixed(position));
                single[position] = false;
            }
        }
        for spot in closed {
            if let Some(position) = instance.target.position_of(*spot) {
                allocation.table.close(position);
            }
        }
        let configurations = match problem.parameters().policy {
            Policy::Exact | Policy::Paper => problem.configurations(),
            // These treat every module as a singleton.
            Policy::Auction | Policy::Hungarian => Vec::new(),
        };
        for configuration in configurations {
            let members: Vec<usize> = configuration
                .modules
                .iter()
                .filter_map(|&module| problem.position_of(module))
                .collect();
            for &member in &members {
                single[member] = false;
            }
            let leader = problem
                .position_of(configuration.leader)
                .unwrap_or(members[0]);
            queue.insert(&instance, Unit { leader, members });
        }
        for (module, _) in single.iter().enumerate().filter(|&(_, &single)| single) {
            queue.insert(&instance, Unit::single(module));
        }
        let trimmed_spots = problem
            .target()
            .spots()
            .iter()
            .map(|spot| spot.id)
            .filter(|&spot| instance.target.position_of(spot).is_none())
            .collect();
        Self {
            queue,
            search: ChainSearch::default(),
            favourites: Favourites::new(module_count),
            central: baseline::assign_centrally(&instance, &allocation.table),
            allocation,
            trimmed_spots,
            instance,
            applied_turns: 0,
            blocks: Vec::new(),
            proven: true,
            pending: None,
            spare: Allocation::default(),
        }
    }

    /// The whole input.
    #[must_use]
    pub fn problem(&self) -> &Arc<PlanningProblem> {
        &self.instance.problem
    }

    /// The problem as it is laid out for planning, with the target that is formed.
    #[must_use]
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// The spots of the problem's target that are left out, ascending; empty unless there are too few modules.
    #[must_use]
    pub fn trimmed_spots(&self) -> &[SpotId] {
        &self.trimmed_spots
    }

    /// The spots of the formed target that must stay open, ascending: there are some only if settled modules stand so
    /// far apart that there are too few others to join them.
    pub fn closed_spots(&self) -> impl Iterator<Item = SpotId> + '_ {
        let holders = self.allocation.table.holders().iter().enumerate();
        holders
            .filter(|&(_, &holder)| holder == Holder::Closed)
            .map(|(spot, _)| self.spot_id(spot))
    }

    /// Whether every block so far took the best place there is; `false` when a search on a graph with cycles was cut
    /// at its budget.
    #[must_use]
    pub fn is_proven(&self) -> bool {
        self.proven
    }

    /// Whose turn it is; `None` when every turn has been taken.
    #[must_use]
    pub fn turn(&self) -> Option<Turn> {
        let unit = self.queue.next()?;
        Some(Turn {
            number: self.applied_turns,
            claimant: self.module_id(unit.leader),
            modules: unit
                .members
                .iter()
                .map(|&member| self.module_id(member))
                .collect(),
        })
    }

    /// What the unit whose turn it is decides; `None` when every turn has been taken.
    ///
    /// Changes nothing that shows; the answer is kept until it is applied.
    pub fn decide(&mut self) -> Option<Decision> {
        self.compute().map(|pending| pending.decision.clone())
    }

    /// Applies a claimed decision if it is the turn of `claimant` and the decision equals this replica's own.
    ///
    /// # Errors
    /// Says why the claim was refused; then nothing has changed.
    pub fn apply(&mut self, claimant: ModuleId, decision: &Decision) -> Result<(), ClaimRefused> {
        let expected = self
            .queue
            .next()
            .map(|unit| self.module_id(unit.leader))
            .ok_or(ClaimRefused::NoTurnLeft)?;
        if claimant != expected {
            return Err(ClaimRefused::WrongClaimant { expected });
        }
        let turn = self.applied_turns;
        let Some(pending) = self.compute() else {
            return Err(ClaimRefused::NoTurnLeft);
        };
        if pending.decision != *decision {
            return Err(ClaimRefused::DifferentDecision {
                turn,
                expected: Box::new(pending.decision.clone()),
                claimed: Box::new(decision.clone()),
            });
        }
        self.advance();
        Ok(())
    }

    /// How many turns have been applied.
    #[must_use]
    pub fn applied_turns(&self) -> u32 {
        self.applied_turns
    }

    /// The spot that a module holds at this point.
    #[must_use]
    pub fn spot_of(&self, module: ModuleId) -> Option<SpotId> {
        let position = self.problem().position_of(module)?;
        self.allocation
            .table
            .spot_of(position)
            .map(|spot| self.spot_id(spot))
    }

    /// What the auction said before the first turn; `None` under every other policy.
    #[must_use]
    pub fn auction_counts(&self) -> Option<AuctionCounts> {
        self.central.as_ref()?.auction
    }

    /// The plan, once no turn is left. Computes the acting order anew at each call.
    #[must_use]
    pub fn finish(&self) -> Option<Plan> {
        if self.queue.next().is_some() {
            return None;
        }
        let mut plan = self.allocated();
        let full = self.problem().target();
        let values: Vec<MicroUnits> = full
            .spots()
            .iter()
            .map(|spot| {
                self.instance
                    .target
                    .position_of(spot.id)
                    .map_or(MicroUnits::ZERO, |position| {
                        self.instance.utilities.value(position)
                    })
            })
            .collect();
        plan.assembly = assembly::order(self.problem(), &plan, &values);
        Some(plan)
    }

    /// Takes all turns that are left, and returns them with their decisions.
    pub fn take_all_turns(&mut self) -> Vec<(Turn, Decision)> {
        self.search.expect_to_be_alone();
        let mut decisions = Vec::new();
        while let Some(turn) = self.turn() {
            self.compute();
            let Some(decision) = self.advance() else {
                break;
            };
            decisions.push((turn, decision));
        }
        decisions
    }

    fn module_id(&self, position: usize) -> ModuleId {
        self.instance.problem.modules()[position].id
    }

    fn spot_id(&self, position: usize) -> SpotId {
        self.instance.target.spots()[position].id
    }

    /// Computes the turn of the unit whose turn it is, unless that was done before.
    fn compute(&mut self) -> Option<&Pending> {
        if self.pending.is_none() {
            let unit = self.queue.next()?;
            let mut allocation = std::mem::take(&mut self.spare);
            allocation.copy_from(&self.allocation);
            let mut evictions = Vec::new();
            let mut blocks = Vec::new();
            let mut remainder = Vec::new();
            let mut detached = Vec::new();
            let mut proven = true;
            match self.instance.problem.parameters().policy {
                Policy::Exact if unit.is_block() => {
                    let outcome = block_allocation::allocate(
                        &self.instance,
                        &mut self.search,
                        &mut allocation,
                        &unit.members,
                        &mut evictions,
                        &self.queue,
                    );
                    blocks.push(outcome.placed.iter().map(|&(member, _)| member).collect());
                    detached.extend(outcome.remainder.iter().flatten());
                    detached.extend(self.linked_among(&outcome.readmitted));
                    remainder = outcome.remainder;
                    proven = outcome.proven;
                }
                Policy::Exact if exact_finish::is_due(&self.instance, &self.queue) => {
                    let entered = exact_finish::finish(
                        &self.instance,
                        &mut allocation,
                        Vec::new(),
                        &mut evictions,
                    );
                    detached.extend(self.linked_among(&entered));
                }
                Policy::Exact => {
                    spot_allocation::allocate(
                        &self.instance,
                        &mut self.search,
                        &mut allocation,
                        unit.leader,
                        &mut evictions,
                    );
                }
                Policy::Paper => {
                    let mut turn = PaperTurn {
                        instance: &self.instance,
                        favourites: &mut self.favourites,
                        table: &mut allocation.table,
                        evictions: &mut evictions,
                    };
                    if unit.is_block() {
                        let outcome = turn.allocate_block(&unit.members);
                        blocks = outcome.blocks;
                        detached = outcome.detached;
                    } else {
                        turn.allocate_spot(unit.leader);
                    }
                }
                Policy::Auction | Policy::Hungarian => {
                    let module = unit.leader;
                    let spots = self.central.as_ref().map(|central| &central.spot_of);
                    if let Some(spot) = spots.and_then(|spots| spots[module]) {
                        allocation.table.give(spot, Holder::Singleton(module));
                    }
                    if self.instance.links.degree(module) > 0 {
                        detached.push(module);
                    }
                }
            }
            let decision = self.decision_between(&allocation, &evictions, &detached);
            self.pending = Some(Pending {
                decision,
                allocation,
                blocks,
                remainder,
                proven,
            });
        }
        self.pending.as_ref()
    }

    /// Those of some modules that were docked at the start; they now enter singly.
    fn linked_among(&self, modules: &[usize]) -> impl Iterator<Item = usize> {
        let links = &self.instance.links;
        modules
            .iter()
            .copied()
            .filter(move |&module| links.degree(module) > 0)
    }

    /// Puts a turn's outcome into identifiers.
    fn decision_between(
        &self,
        after: &Allocation,
        evictions: &[Displacement],
        detached: &[usize],
    ) -> Decision {
        let selections = self
            .allocation
            .table
            .holders()
            .iter()
            .zip(after.table.holders())
            .enumerate()
            .filter_map(|(spot, (before, after))| match *after {
                Holder::Singleton(module) | Holder::Fixed(module) if before != after => {
                    Some(SpotSelection {
                        spot: self.spot_id(spot),
                        module: self.module_id(module),
                    })
                }
                _ => None,
            })
            .collect();
        let evictions = evictions
            .iter()
            .map(|displacement| EvictionRecord {
                evicted: self.module_id(displacement.evicted),
                by: self.module_id(displacement.by),
                from: self.spot_id(displacement.from),
                to: displacement.to.map(|spot| self.spot_id(spot)),
            })
            .collect();
        let mut detached: Vec<ModuleId> = detached
            .iter()
            .map(|&module| self.module_id(module))
            .collect();
        detached.sort_unstable();
        Decision {
            selections,
            evictions,
            detached,
        }
    }

    /// Makes the pending turn's outcome the state, and returns its decision.
    fn advance(&mut self) -> Option<Decision> {
        let pending = self.pending.take()?;
        self.queue.pop()?;
        self.queue
            .insert_remainder(&self.instance, &pending.remainder);
        self.spare = std::mem::replace(&mut self.allocation, pending.allocation);
        let blocks = pending.blocks.into_iter();
        self.blocks.extend(blocks.filter(|block| block.len() > 1));
        self.proven &= pending.proven;
        self.applied_turns += 1;
        Some(pending.decision)
    }

    /// For each spot, how many modules the unit that holds it has; 0 for a free spot.
    fn holding_sizes(&self) -> Vec<usize> {
        let mut unit_sizes = vec![1; self.problem().modules().len()];
        for block in &self.blocks {
            for &member in block {
                unit_sizes[member] = block.len();
            }
        }
        self.allocation
            .table
            .holders()
            .iter()
            .map(|holder| match *holder {
                Holder::Nobody | Holder::Closed => 0,
                Holder::Singleton(module) | Holder::Fixed(module) => unit_sizes[module],
            })
            .collect()
    }
}
