//! The offline plan on the terminal: its progress, its warnings, and why it is refused.

use std::path::Path;
use std::sync::Arc;

use formation_model::{PlanningProblem, Scenario};
use formation_offline::{CheckedPlan, PlanStage};
use ros_runtime::exit::Failure;

use crate::console;
use crate::progress::PlanProgress;
use crate::scenario_file::named;

/// A plan as a command deals with it.
pub trait PlanOutput: Sized {
    /// Plans a scenario, and shows on a terminal how far it has come.
    ///
    /// # Errors
    /// Lists the guarantees that the plan does not keep.
    fn of(scenario: &Scenario) -> Result<Self, Failure>;

    /// The same for a problem.
    ///
    /// # Errors
    /// As [`Self::of`].
    fn shown(problem: Arc<PlanningProblem>) -> Result<Self, Failure>;

    /// Fails if the plan has a hole, once its results are printed.
    ///
    /// # Errors
    /// Names the open spots.
    fn refuse_hole(&self, path: &Path) -> Result<(), Failure>;

    /// Refuses a plan by which no module would move.
    ///
    /// # Errors
    /// Names the unit and its spots, and the reason.
    fn refuse_without_motion(&self, path: &Path) -> Result<(), Failure>;

    /// Prints the warnings about a plan, before anything moves.
    fn warn(&self, path: &Path);

    /// Says so if a placement is not proven to be the best.
    fn warn_of_cut_search(&self, path: &Path);
}

fn warn_of(path: &Path, warnings: impl IntoIterator<Item = impl std::fmt::Display>) {
    for warning in warnings {
        console::note(&format!("warning: {}: {warning}", named(path)));
    }
}

impl PlanOutput for CheckedPlan {
    fn of(scenario: &Scenario) -> Result<Self, Failure> {
        Self::shown(Arc::new(scenario.problem().clone()))
    }

    fn shown(problem: Arc<PlanningProblem>) -> Result<Self, Failure> {
        let mut progress = PlanProgress::new();
        let plan = Self::with_progress(problem, |stage| match stage {
            PlanStage::Turns(taken, left) => progress.show_turns(taken, left),
            PlanStage::Motion => progress.show_motion(),
        });
        plan.map_err(Failure::failed)
    }

    fn refuse_hole(&self, path: &Path) -> Result<(), Failure> {
        match self.hole_text() {
            None => Ok(()),
            Some(text) => Err(Failure::failed(format_args!("{}: {text}", named(path)))),
        }
    }

    fn refuse_without_motion(&self, path: &Path) -> Result<(), Failure> {
        match self.unmovable_text() {
            None => Ok(()),
            Some(text) => Err(Failure::bad_input(format_args!("{}: {text}", named(path)))),
        }
    }

    fn warn(&self, path: &Path) {
        warn_of(path, self.warnings());
    }

    fn warn_of_cut_search(&self, path: &Path) {
        warn_of(path, self.cut_search_text());
    }
}
