//! Plans: their numbers, explanations, checks, pictures and courses.

use std::sync::Arc;

use formation_model::text::joined;
use formation_model::{ModuleId, Scenario, SpotId};
use formation_motion::{PlannedMotion, check_differential_drives};
use formation_offline::{
    ByAllocationError, CgshopSolution, CheckReport, CheckedPlan, ExplanationReport, WithoutSpread,
    explanation_text,
};
use formation_planner::{Explanation, PlanSize};
use formation_report::{Colours, after, animation, before, page};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays;
use crate::errors::{json, motion_refused, plan_refused, scenario_refused, scenario_too_large};

/// A plan that the verifier's checks have passed.
#[pyclass(frozen, module = "formation._native")]
pub struct NativePlan {
    scenario: Arc<Scenario>,
    plan: CheckedPlan,
}

impl NativePlan {
    /// Plans a scenario.
    ///
    /// # Errors
    /// A `PlanError` if the plan does not keep its guarantees.
    pub fn of(py: Python<'_>, scenario: Arc<Scenario>) -> PyResult<Self> {
        let problem = Arc::new(scenario.problem().clone());
        let plan = py.detach(|| CheckedPlan::of_problem(problem));
        let plan = plan.map_err(|error| plan_refused(py, &error.to_string()))?;
        Ok(Self { scenario, plan })
    }

    /// Plans a scenario by an allocation.
    ///
    /// # Errors
    /// A `PlanError` that names what is wrong with the allocation, or with the plan that it leads to.
    pub fn by_allocation(
        py: Python<'_>,
        scenario: Arc<Scenario>,
        pairs: &[(u32, u32)],
    ) -> PyResult<Self> {
        let pairs = pairs.iter();
        let allocation: Vec<(ModuleId, SpotId)> = pairs
            .map(|&(module, spot)| (ModuleId(module), SpotId(spot)))
            .collect();
        let plan = py.detach(|| CheckedPlan::by_allocation(scenario.problem(), &allocation));
        // The caller knows no target section.
        let refused = |error: ByAllocationError| error.to_string().replacen("target.", "", 1);
        let plan = plan.map_err(|error| plan_refused(py, &refused(error)))?;
        Ok(Self { scenario, plan })
    }

    /// The plan, of a scenario that agents can form.
    ///
    /// # Errors
    /// A `ScenarioError` if the target is in several parts.
    pub fn formable(&self, py: Python<'_>) -> PyResult<&CheckedPlan> {
        let formable = self.scenario.check_formable();
        formable.map_err(|error| scenario_refused(py, &error.into(), None))?;
        Ok(&self.plan)
    }

    fn explanation(&self, py: Python<'_>, module: u32) -> PyResult<Explanation> {
        let module = ModuleId(module);
        let (problem, outcome) = (&self.plan.problem, &self.plan.outcome);
        let found = py.detach(|| Explanation::of(problem, outcome, module));
        found.ok_or_else(|| {
            let known = problem.modules().iter().map(|module| module.id.0);
            let known = joined(known, ", ");
            plan_refused(
                py,
                &format!("there is no {module}; the modules are {known}"),
            )
        })
    }

    /// The name in one line.
    fn title(&self) -> String {
        let words: Vec<&str> = self.scenario.name().split_whitespace().collect();
        words.join(" ")
    }
}

#[pymethods]
impl NativePlan {
    /// The object that `formation plan --json` prints.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        let report = py.detach(|| {
            let without_spread = WithoutSpread::of(&self.plan.problem);
            self.plan.whole_report(without_spread)
        });
        json(py, &report)
    }

    /// The plan without turns and motion, as JSON.
    fn numbers_json(&self, py: Python<'_>) -> PyResult<String> {
        json(py, &self.plan.report())
    }

    /// Each module with its spot, ascending by module.
    fn assignments(&self) -> Vec<(u32, u32)> {
        let pairs = self.plan.statistics.assignments.iter();
        pairs.map(|pair| (pair.module.0, pair.spot.0)).collect()
    }

    /// Whether all spots are filled, and connected, that the modules suffice for.
    fn is_complete(&self) -> bool {
        self.plan.is_complete()
    }

    /// What is wrong with the spots that are filled, if anything.
    fn hole(&self) -> Option<String> {
        self.plan.hole_text()
    }

    /// The warnings that the launcher prints about the plan.
    fn warnings(&self) -> Vec<String> {
        self.plan.warnings()
    }

    /// The steps until the last module arrives, and the bound; `None` without paths.
    fn makespan(&self) -> Option<(u32, u32)> {
        match &self.plan.motion {
            PlannedMotion::Paths(paths) => Some((paths.makespan, paths.bound)),
            PlannedMotion::Refused(_) => None,
        }
    }

    /// The path of a module as rows of x, y, theta and plan time; empty if it has none.
    fn waypoints<'py>(&self, py: Python<'py>, module: u32) -> Bound<'py, PyBytes> {
        let units = match &self.plan.motion {
            PlannedMotion::Paths(paths) => paths.units.as_slice(),
            PlannedMotion::Refused(_) => &[],
        };
        let modules = units.iter().flat_map(|unit| &unit.modules);
        let path = modules
            .filter(|one| one.module == ModuleId(module))
            .flat_map(|one| &one.waypoints);
        let rows = path.flat_map(|point| {
            let pose = [point.pose.x, point.pose.y, point.pose.theta];
            let pose = pose.map(|number| number.to_units());
            pose.into_iter().chain([f64::from(point.time)])
        });
        PyBytes::new(py, &arrays::numbers(rows))
    }

    /// What `formation plan --cgshop` prints.
    fn cgshop_json(&self, py: Python<'_>) -> PyResult<String> {
        let solution = CgshopSolution::of(self.scenario.name(), &self.plan);
        json(
            py,
            &solution.map_err(|error| plan_refused(py, &error.to_string()))?,
        )
    }

    /// The object that `formation explain --json` prints.
    fn explain_json(&self, py: Python<'_>, module: u32) -> PyResult<String> {
        let explanation = self.explanation(py, module)?;
        json(py, &ExplanationReport::of(&self.plan, &explanation))
    }

    /// What `formation explain` prints.
    fn explain_text(&self, py: Python<'_>, module: u32) -> PyResult<String> {
        Ok(explanation_text(&self.explanation(py, module)?))
    }

    /// The object that `formation check --json` prints.
    ///
    /// # Errors
    /// A `ScenarioError` if real processes are given too little time for the plan, a `MotionError` if no module would move, or
    /// differential drives cannot carry the plan out.
    fn check_json(&self, py: Python<'_>, is_differential: bool) -> PyResult<String> {
        let size = PlanSize::of(self.scenario.problem());
        size.check()
            .map_err(|refused| scenario_too_large(py, &refused))?;
        if let Some(reason) = self.plan.unmovable_text() {
            return Err(motion_refused(py, &reason));
        }
        if is_differential {
            let refused = check_differential_drives(self.scenario.problem());
            refused.map_err(|reason| motion_refused(py, &reason.to_string()))?;
        }
        json(py, &CheckReport::of(&self.scenario, &self.plan))
    }

    /// What happens when simulated drives carry the plan out, as JSON.
    fn course_json(&self, py: Python<'_>) -> PyResult<String> {
        let course = py.detach(|| self.plan.course());
        json(py, &course)
    }

    /// A picture of the modules where they start.
    fn picture_before(&self, py: Python<'_>) -> String {
        py.detach(|| before(&self.plan.subject(&self.title(), &self.plan.course())))
    }

    /// A picture of the modules where they end.
    fn picture_after(&self, py: Python<'_>) -> String {
        py.detach(|| after(&self.plan.subject(&self.title(), &self.plan.course())))
    }

    /// An animated picture of the plan.
    fn film(&self, py: Python<'_>, is_dark: bool) -> String {
        let colours = match is_dark {
            true => Colours::Dark,
            false => Colours::Light,
        };
        py.detach(|| {
            let course = self.plan.course();
            let subject = self.plan.subject(&self.title(), &course);
            animation(&subject, &course, &self.plan.summary().outcome, colours)
        })
    }

    /// The page that `formation plan --report` writes.
    fn page(&self, py: Python<'_>) -> String {
        py.detach(|| {
            let course = self.plan.course();
            let subject = self.plan.subject(&self.title(), &course);
            page(&subject, &course, &self.plan.summary())
        })
    }
}
