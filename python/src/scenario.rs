//! Scenarios.

use std::sync::Arc;

use formation_model::{Policy, RawScenario, Scenario, Target};
use formation_offline::{PolicyInstance, as_in_a_file, oddities, whole_yaml};
use formation_planner::assignment::Instance;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays;
use crate::errors::{json, scenario_refused, scenario_unsuited};
use crate::plan::NativePlan;

/// A validated scenario, and the lists that it was made of.
#[pyclass(frozen, module = "formation._native")]
pub struct NativeScenario {
    raw: RawScenario,
    scenario: Arc<Scenario>,
}

impl NativeScenario {
    /// Validates a scenario.
    ///
    /// # Errors
    /// A `ScenarioError`, with the line if the text is given.
    pub fn of(py: Python<'_>, raw: RawScenario, text: Option<&str>) -> PyResult<Self> {
        let validated = py.detach(|| Scenario::try_from(raw.clone()));
        match validated {
            Ok(scenario) => Ok(Self {
                raw,
                scenario: Arc::new(scenario),
            }),
            Err(error) => Err(scenario_refused(py, &error, text)),
        }
    }

    /// The validated scenario.
    pub fn scenario(&self) -> &Arc<Scenario> {
        &self.scenario
    }

    fn target(&self) -> &Target {
        self.scenario.problem().target()
    }
}

#[pymethods]
impl NativeScenario {
    /// Reads the text of a scenario file. `is_file` says whether people wrote this text, so that its lines mean something.
    #[staticmethod]
    fn from_yaml(py: Python<'_>, text: &str, is_file: bool) -> PyResult<Self> {
        let shown = is_file.then_some(text);
        let raw = py.detach(|| RawScenario::from_yaml(text));
        let raw = raw.map_err(|error| scenario_refused(py, &error, shown))?;
        Self::of(py, raw, shown)
    }

    /// The scenario as lists, as JSON.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        let whole = as_in_a_file(&self.raw);
        json(
            py,
            &whole.map_err(|error| scenario_unsuited(py, &error.to_string()))?,
        )
    }

    /// The text of a scenario file.
    fn to_yaml(&self, py: Python<'_>) -> PyResult<String> {
        whole_yaml(&self.raw).map_err(|error| scenario_unsuited(py, &error.to_string()))
    }

    /// The sections `target` and `modules` of a scenario file that draws this scenario.
    fn to_maps(&self, py: Python<'_>) -> PyResult<String> {
        let drawn = self.scenario.to_maps();
        drawn.map_err(|error| scenario_unsuited(py, &error.to_string()))
    }

    /// What is valid and yet looks like a mistake.
    fn oddities(&self) -> Vec<String> {
        oddities(self.scenario.problem())
    }

    #[getter]
    fn name(&self) -> &str {
        self.scenario.name()
    }

    /// The identifiers of the modules, ascending.
    fn module_ids(&self) -> Vec<u32> {
        let modules = self.scenario.problem().modules().iter();
        modules.map(|module| module.id.0).collect()
    }

    /// The identifiers of the spots, ascending.
    fn spot_ids(&self) -> Vec<u32> {
        self.target().spots().iter().map(|spot| spot.id.0).collect()
    }

    /// Where the modules start: rows of x, y, theta.
    fn starts<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let modules = self.scenario.problem().modules().iter();
        PyBytes::new(py, &arrays::pose_rows(modules.map(|module| &module.pose)))
    }

    /// Where the spots are: rows of x, y, theta.
    fn spots<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let spots = self.target().spots().iter();
        PyBytes::new(py, &arrays::pose_rows(spots.map(|spot| &spot.pose)))
    }

    /// The docked pairs of the target, as positions among the spots.
    fn edges<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &pairs(self.target().topology().edges()))
    }

    /// The docked pairs at the start, as positions among the modules.
    fn links<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &pairs(self.scenario.problem().links().edges()))
    }

    /// The utility of each spot (column) to each module (row).
    fn utilities<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let bytes = py.detach(|| {
            let problem = self.scenario.problem();
            let target = Arc::clone(problem.target());
            let utilities = Instance::new(Arc::new(problem.clone()), target).utilities;
            let spots = problem.target().spots().len();
            let modules = 0..problem.modules().len();
            let each = modules.flat_map(|module| (0..spots).map(move |spot| (module, spot)));
            arrays::numbers(each.map(|(module, spot)| utilities.of(module, spot).to_units()))
        });
        PyBytes::new(py, &bytes)
    }

    /// The choices that only the policy `paper` has, by name; empty for other policies.
    fn policy_options(&self) -> Vec<(&'static str, String)> {
        let parameters = self.scenario.problem().parameters();
        match parameters.policy {
            Policy::Paper => parameters.paper.named().to_vec(),
            _ => Vec::new(),
        }
    }

    /// Plans it by an allocation: pairs of a module and its spot.
    #[expect(clippy::needless_pass_by_value, reason = "Python gives values")]
    fn plan_by_allocation(&self, py: Python<'_>, pairs: Vec<(u32, u32)>) -> PyResult<NativePlan> {
        NativePlan::by_allocation(py, Arc::clone(&self.scenario), &pairs)
    }

    /// The instance for a policy, as programs read it.
    fn instance_json(&self, py: Python<'_>) -> PyResult<String> {
        let problem = self.scenario.problem();
        json(py, &py.detach(|| PolicyInstance::of(problem)))
    }

    /// Plans it.
    fn plan(&self, py: Python<'_>) -> PyResult<NativePlan> {
        NativePlan::of(py, Arc::clone(&self.scenario))
    }
}

fn pairs(edges: &[(usize, usize)]) -> Vec<u8> {
    let ends = edges.iter().flat_map(|&(one, other)| [one, other]);
    arrays::integers(ends.filter_map(|end| i64::try_from(end).ok()))
}
