//! What comes of a plan whose motion swaps spots after the claims.

use super::{PlanOutcome, PlannedTurns, Swapped, SwappedModule};
use crate::value::Utilities;
use formation_model::{MicroUnits, Plan, PlanningProblem, SpotSelection};

impl PlanOutcome {
    /// Takes the plan that the motion made of this one, with the units that it takes apart and the spots that it swaps.
    pub fn follow(&mut self, problem: &PlanningProblem, plan: Plan) {
        let claimed = std::mem::replace(&mut self.plan, plan);
        if self.plan.swaps.is_empty() {
            return;
        }
        if let Some((_, last)) = self.decisions.last_mut() {
            last.swaps.clone_from(&self.plan.swaps);
        }
        let assignments = &self.plan.assignments;
        let modules = || problem.modules().iter().map(|module| module.id);
        let swapped = modules().map(|module| SwappedModule {
            module,
            claimed: claimed.assignments.get(&module).copied(),
            spot: assignments.get(&module).copied(),
        });
        let swapped = swapped.filter(|one| one.claimed != one.spot);
        let utilities = Utilities::new(problem, &self.target);
        let [before, after] =
            [&claimed, &self.plan].map(|plan| totals(problem, &utilities, self, plan));
        self.swapped = Some(Swapped {
            modules: swapped.collect(),
            utility: before.utility - after.utility,
            distance: after.distance - before.distance,
            claimed_longest: before.longest,
        });
        self.unassigned = modules()
            .filter(|module| !assignments.contains_key(module))
            .collect();
        self.total_utility = after.utility;
        self.total_distance = after.distance;
        self.longest_distance = after.longest;
    }
}

impl PlannedTurns {
    /// The same turns, with the spots that are swapped after the last one.
    #[must_use]
    pub fn with_swaps(mut self, swaps: &[SpotSelection]) -> Self {
        if let Some((_, last)) = self.last_decision() {
            last.swaps = swaps.to_vec();
        }
        self
    }
}

struct Totals {
    utility: MicroUnits,
    distance: MicroUnits,
    longest: MicroUnits,
}

fn totals(
    problem: &PlanningProblem,
    utilities: &Utilities,
    outcome: &PlanOutcome,
    plan: &Plan,
) -> Totals {
    let blocks = plan
        .blocks
        .iter()
        .map(|block| utilities.retention_reward(block.len()));
    let mut totals = Totals {
        utility: utilities.kept_link().times(plan.kept_links.len()) + blocks.sum(),
        distance: MicroUnits::ZERO,
        longest: MicroUnits::ZERO,
    };
    for (&module, &spot) in &plan.assignments {
        let ends = problem
            .position_of(module)
            .zip(outcome.target.position_of(spot));
        let Some((module, spot)) = ends else { continue };
        let distance = utilities.distance(module, spot);
        totals.utility += utilities.plain(module, spot);
        totals.distance += distance;
        totals.longest = totals.longest.max(distance);
    }
    totals
}
