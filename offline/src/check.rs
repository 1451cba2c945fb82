//! What `formation check --json` says of a valid scenario.

use formation_model::{ModuleId, PlanningProblem, Scenario, SpotId};
use serde::Serialize;

use crate::checked_plan::{CheckedPlan, PlanTurn};
use crate::warnings;

/// What `formation check --json` prints of a valid scenario.
#[derive(Debug, Serialize)]
pub struct CheckReport<'a> {
    name: &'a str,
    modules: usize,
    configurations: usize,
    singletons: usize,
    spots: usize,
    /// Whether the target has no cycle.
    tree: bool,
    /// Whether the plan fills all spots that the modules suffice for.
    complete: bool,
    /// Whether each placement of a configuration is proven to be the best.
    proven: bool,
    unassigned: &'a [ModuleId],
    open_spots: &'a [SpotId],
    turns: Vec<PlanTurn>,
    warnings: Vec<String>,
}

impl<'a> CheckReport<'a> {
    /// What to print of a scenario and its plan.
    pub fn of(scenario: &'a Scenario, plan: &'a CheckedPlan) -> Self {
        let problem = scenario.problem();
        let statistics = &plan.statistics;
        let warnings = warnings::of(problem);
        Self {
            name: scenario.name(),
            modules: problem.modules().len(),
            configurations: problem.configurations().len(),
            singletons: problem.modules().len() - docked_count(problem),
            spots: problem.target().spots().len(),
            tree: problem.target().topology().is_tree(),
            complete: plan.is_complete(),
            proven: statistics.proven,
            unassigned: &statistics.unassigned,
            open_spots: &statistics.open_spots,
            turns: plan.turns(),
            warnings,
        }
    }
}

/// The number of modules that start in a configuration.
pub fn docked_count(problem: &PlanningProblem) -> usize {
    let configurations = problem.configurations();
    configurations
        .iter()
        .map(|configuration| configuration.modules.len())
        .sum()
}
