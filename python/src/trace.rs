//! Traces of runs, judged.

use formation_offline::{read_trace, verify_trace};
use pyo3::prelude::*;

use crate::errors::{json, trace_refused};
use crate::scenario::NativeScenario;

/// Judges the lines of a trace against a scenario; the verdict as JSON.
#[pyfunction]
pub fn verify_json(py: Python<'_>, scenario: &NativeScenario, trace: &str) -> PyResult<String> {
    let problem = scenario.scenario().problem();
    let judged = py.detach(|| read_trace(trace).map(|trace| verify_trace(problem, &trace)));
    json(py, &judged.map_err(|error| trace_refused(py, &error))?)
}
