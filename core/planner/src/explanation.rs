//! Why a module got its spot, or none: the turns that concerned it, and what other spots would have been worth.

use serde::Serialize;

use super::barrier::Barrier;
use super::turns::{PlanOutcome, SwappedModule};
use super::value::Utilities;
use formation_model::{Decision, FreeCells, MicroUnits, ModuleId, PlanningProblem, SpotId};

/// Why a module got its spot, or none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Explanation {
    /// The module.
    pub module: ModuleId,
    /// The spot that the plan gives it.
    pub spot: Option<SpotId>,
    /// Whether walls leave it no way to the target, so that it is no candidate.
    pub cut_off: bool,
    /// By how much its way to its spot is longer than the straight one.
    pub detour: MicroUnits,
    /// What is in its way to its spot, if it makes a detour; to the first spot, if the module is cut off.
    pub barrier: Option<Barrier>,
    /// The turns that concerned it, in their order.
    pub turns: Vec<ConcernedTurn>,
    /// The change of its spot after the claims, if there is one.
    pub swapped: Option<SwappedModule>,
    /// What each spot of the formed target would have been worth to it, the best first; without its own. None if it is cut off.
    pub alternatives: Vec<Alternative>,
}

/// A turn that concerned a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConcernedTurn {
    /// Counts the turns, from 0.
    pub number: u32,
    /// The module that decided.
    pub claimant: ModuleId,
    /// What was decided.
    pub decision: Decision,
    /// What the turn meant for the module.
    pub outcome: TurnOutcome,
}

/// What a turn meant for a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum TurnOutcome {
    /// It got a spot.
    Takes {
        /// The spot.
        spot: SpotId,
    },
    /// It lost a spot to another module.
    Loses {
        /// The spot.
        spot: SpotId,
        /// The module that took it.
        to: ModuleId,
        /// The spot that it got instead.
        instead: Option<SpotId>,
    },
    /// Its unit decided, and it got no spot.
    FindsNone,
}

/// What a spot would have been worth to a module that did not get it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Alternative {
    /// The spot.
    pub spot: SpotId,
    /// By how much the module's way to it is longer than the straight one.
    pub detour: MicroUnits,
    /// What is in the way, if there is a detour.
    pub barrier: Option<Barrier>,
    /// Its utility for the module, every link end charged.
    pub utility: MicroUnits,
    /// The module that the plan gives it to, and its utility for that one.
    pub holder: Option<(ModuleId, MicroUnits)>,
    /// How much the total utility falls if the two exchange their spots, or the module takes the spot where it is free;
    /// one of them may have none. What links that stay docked save is left out, so it may be negative for docked modules.
    pub loss: MicroUnits,
}

impl Explanation {
    /// Explains the spot of a module of the problem; `None` if the problem does not have it.
    #[must_use]
    pub fn of(problem: &PlanningProblem, outcome: &PlanOutcome, module: ModuleId) -> Option<Self> {
        let position = problem.position_of(module)?;
        let spot = outcome.plan.assignments.get(&module).copied();
        let turns = outcome.decisions.iter().filter_map(|(turn, decision)| {
            Some(ConcernedTurn {
                number: turn.number,
                claimant: turn.claimant,
                decision: decision.clone(),
                outcome: concern(module, turn.modules.contains(&module), decision)?,
            })
        });
        let (ways, cut_off) = (Ways::new(problem, outcome), problem.is_cut_off(position));
        let (detour, barrier) = match spot.and_then(|spot| outcome.target.position_of(spot)) {
            Some(own) => ways.way(position, own),
            None if cut_off => (MicroUnits::ZERO, ways.barrier(position, 0)),
            None => (MicroUnits::ZERO, None),
        };
        let alternatives = match cut_off {
            true => Vec::new(),
            false => alternatives(&ways, position, spot),
        };
        Some(Self {
            module,
            spot,
            cut_off,
            detour,
            barrier,
            turns: turns.collect(),
            swapped: outcome
                .swapped
                .as_ref()
                .and_then(|swapped| swapped.of(module)),
            alternatives,
        })
    }
}

/// What a decision meant for a module.
fn concern(module: ModuleId, is_of_unit: bool, decision: &Decision) -> Option<TurnOutcome> {
    let mut evictions = decision.evictions.iter();
    if let Some(eviction) = evictions.find(|eviction| eviction.evicted == module) {
        return Some(TurnOutcome::Loses {
            spot: eviction.from,
            to: eviction.by,
            instead: eviction.to,
        });
    }
    let mut selections = decision.selections.iter();
    match selections.find(|selection| selection.module == module) {
        Some(selection) => Some(TurnOutcome::Takes {
            spot: selection.spot,
        }),
        None => is_of_unit.then_some(TurnOutcome::FindsNone),
    }
}

/// The ways of all modules to the spots of the formed target.
struct Ways<'a> {
    problem: &'a PlanningProblem,
    outcome: &'a PlanOutcome,
    utilities: Utilities,
    cells: Option<FreeCells>,
}

impl<'a> Ways<'a> {
    fn new(problem: &'a PlanningProblem, outcome: &'a PlanOutcome) -> Self {
        Self {
            problem,
            outcome,
            utilities: Utilities::new(problem, &outcome.target),
            cells: problem.free_cells(),
        }
    }

    /// The detour of a module to a spot, and what is in the way if there is one.
    fn way(&self, module: usize, spot: usize) -> (MicroUnits, Option<Barrier>) {
        let detour = self.utilities.detour(module, spot);
        let barrier = (detour > MicroUnits::ZERO).then(|| self.barrier(module, spot));
        (detour, barrier.flatten())
    }

    fn barrier(&self, module: usize, spot: usize) -> Option<Barrier> {
        let spot = self.outcome.target.spots().get(spot)?;
        let position = self.problem.target().position_of(spot.id)?;
        Barrier::between(self.problem, self.cells.as_ref()?, module, position)
    }
}

fn alternatives(ways: &Ways, module: usize, own: Option<SpotId>) -> Vec<Alternative> {
    let Ways {
        problem,
        outcome,
        utilities,
        ..
    } = ways;
    let target = &outcome.target;
    let held = outcome.plan.assignments.iter();
    let holders = held.filter_map(|(&holder, &spot)| Some((target.position_of(spot)?, holder)));
    let mut holder_of = vec![None; target.spots().len()];
    for (spot, holder) in holders {
        holder_of[spot] = Some(holder);
    }
    let own = own.and_then(|spot| target.position_of(spot));
    let on_own = |module: usize| own.map_or(MicroUnits::ZERO, |own| utilities.of(module, own));
    let spots = target.spots().iter().enumerate();
    let mut alternatives: Vec<Alternative> = spots
        .filter(|&(position, _)| Some(position) != own)
        .map(|(position, spot)| {
            let utility = utilities.of(module, position);
            let holder =
                holder_of[position].and_then(|holder| Some((holder, problem.position_of(holder)?)));
            let now = holder.map(|(_, holder)| utilities.of(holder, position));
            let exchanged = holder.map(|(_, holder)| on_own(holder));
            let before = on_own(module) + now.unwrap_or_default();
            let after = utility + exchanged.unwrap_or_default();
            let (detour, barrier) = ways.way(module, position);
            Alternative {
                spot: spot.id,
                detour,
                barrier,
                utility,
                holder: holder.map(|(holder, _)| holder).zip(now),
                loss: before - after,
            }
        })
        .collect();
    alternatives.sort_by_key(|one| (std::cmp::Reverse(one.utility), one.spot));
    alternatives
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::plan;
    use formation_model::{EvictionRecord, Scenario, SpotSelection};

    /// Two spots in a row, and three single modules: two near the spots, one far away.
    const CONTESTED: &str = "
target:
  spots: [{id: 1, x: 0, y: 0}, {id: 2, x: 1, y: 0}]
  edges: [[1, 2]]
singletons: [{id: 1, x: 9, y: 0}, {id: 2, x: 0, y: 2}, {id: 3, x: 1, y: 2}]
";

    fn explained(module: u32) -> Option<Explanation> {
        let scenario = Scenario::from_yaml(CONTESTED).unwrap();
        let outcome = plan(Arc::new(scenario.problem().clone()));
        Explanation::of(scenario.problem(), &outcome, ModuleId(module))
    }

    #[test]
    fn a_module_without_a_spot_learns_what_one_would_cost() {
        let far = explained(1).unwrap();
        assert_eq!(far.spot, None);
        let outcomes: Vec<TurnOutcome> = far.turns.iter().map(|turn| turn.outcome).collect();
        assert_eq!(outcomes, [TurnOutcome::FindsNone]);
        assert_eq!(far.alternatives.len(), 2);
        for alternative in &far.alternatives {
            let (holder, worth) = alternative.holder.unwrap();
            assert_ne!(holder, ModuleId(1));
            assert!(alternative.loss > MicroUnits::ZERO);
            assert_eq!(alternative.loss, worth - alternative.utility);
        }
    }

    #[test]
    fn an_eviction_concerns_the_one_that_loses_its_spot() {
        let eviction = EvictionRecord {
            evicted: ModuleId(4),
            by: ModuleId(7),
            from: SpotId(1),
            to: Some(SpotId(2)),
        };
        let selection = |module, spot| SpotSelection {
            spot: SpotId(spot),
            module: ModuleId(module),
        };
        let decision = Decision {
            selections: vec![selection(7, 1), selection(4, 2)],
            evictions: vec![eviction],
            ..Decision::default()
        };
        let loses = TurnOutcome::Loses {
            spot: SpotId(1),
            to: ModuleId(7),
            instead: Some(SpotId(2)),
        };
        assert_eq!(concern(ModuleId(4), false, &decision), Some(loses));
        let takes = TurnOutcome::Takes { spot: SpotId(1) };
        assert_eq!(concern(ModuleId(7), true, &decision), Some(takes));
        assert_eq!(concern(ModuleId(9), false, &decision), None);
    }

    #[test]
    fn a_placed_module_learns_what_an_exchange_would_cost() {
        let near = explained(2).unwrap();
        assert_eq!(near.spot, Some(SpotId(1)));
        assert_eq!(near.alternatives.len(), 1);
        assert!(near.alternatives[0].loss > MicroUnits::ZERO);
        assert_eq!(explained(4), None);
    }
}
