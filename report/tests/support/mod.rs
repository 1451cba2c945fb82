//! Scenarios and their plans.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::fs;
use std::sync::Arc;

use formation_model::{PlanningProblem, Scenario};
use formation_motion::PlannedMotion;
use formation_planner::{PlanOutcome, Statistics, plan};
use formation_report::{Subject, course_of_plan};

/// A scenario with its plan.
pub struct Formed {
    scenario: Scenario,
    pub outcome: PlanOutcome,
    pub motion: PlannedMotion,
}

impl Formed {
    pub fn of(yaml: &str) -> Self {
        Self::from_scenario(Scenario::from_yaml(yaml).unwrap())
    }

    pub fn from_scenario(scenario: Scenario) -> Self {
        let mut outcome = plan(Arc::new(scenario.problem().clone()));
        let (motion, plan) = PlannedMotion::of(scenario.problem(), outcome.plan);
        outcome.plan = plan;
        Self {
            scenario,
            outcome,
            motion,
        }
    }

    pub fn shipped(name: &str) -> Self {
        let directory = env!("CARGO_MANIFEST_DIR");
        let path = format!("{directory}/../launch_scripts/scenarios/{name}.yaml");
        Self::of(&fs::read_to_string(path).unwrap())
    }

    pub fn problem(&self) -> &PlanningProblem {
        self.scenario.problem()
    }

    pub fn subject(&self) -> Subject {
        let course = course_of_plan(self.problem(), &self.outcome, &self.motion, 1.0);
        let name = self.scenario.name();
        Subject::of_course(name, self.problem(), &self.outcome, &course, None)
            .with_paths(&self.motion)
    }

    pub fn statistics(&self) -> Statistics {
        Statistics::of(self.problem(), &self.outcome)
    }
}
