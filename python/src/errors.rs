//! Errors of Rust as the exceptions of `formation.errors`.

use formation_model::{ScenarioError, place_of_field};
use formation_offline::TraceError;
use formation_planner::PlanTooLong;
use pyo3::prelude::*;
use pyo3::types::PyAnyMethods;

/// An exception of `formation.errors` with these arguments; whatever prevents that is the exception instead.
fn raised<'py>(py: Python<'py>, name: &str, arguments: impl pyo3::call::PyCallArgs<'py>) -> PyErr {
    let made = py
        .import("formation.errors")
        .and_then(|errors| errors.getattr(name))
        .and_then(|class| class.call1(arguments));
    match made {
        Ok(value) => PyErr::from_value(value),
        Err(error) => error,
    }
}

/// A scenario that was refused. The text, where there is one, tells the line of a field.
pub fn scenario_refused(py: Python<'_>, error: &ScenarioError, text: Option<&str>) -> PyErr {
    let (field, place, reason) = match error {
        ScenarioError::Yaml(error) => {
            let (field, reason) = error.field_and_reason();
            (field.map(str::to_owned), error.location, reason.to_owned())
        }
        ScenarioError::TooDeep { line, column } => {
            (None, Some((*line, *column)), error.to_string())
        }
        ScenarioError::Field(error) => {
            let place = text.and_then(|text| place_of_field(text, &error.field));
            (Some(error.field.clone()), place, error.reason.clone())
        }
        ScenarioError::Given(error) => {
            let whole = error.to_string();
            let (field, reason) = whole.split_once(": ").unwrap_or(("target", &whole));
            let place = text.and_then(|text| place_of_field(text, field));
            (Some(field.to_owned()), place, reason.to_owned())
        }
        ScenarioError::Problem(error) => (Some("modules".to_owned()), None, error.to_string()),
    };
    let place = place.filter(|_| text.is_some());
    let (line, column) = place.unzip();
    raised(py, "ScenarioError", (reason, field, line, column))
}

/// A scenario with a property that this use of it refuses.
pub fn scenario_unsuited(py: Python<'_>, reason: &str) -> PyErr {
    raised(py, "ScenarioError", (reason,))
}

/// An argument that is out of its range.
pub fn option_refused(py: Python<'_>, reason: &str) -> PyErr {
    raised(py, "OptionError", (reason,))
}

/// A plan that was refused.
pub fn plan_refused(py: Python<'_>, reason: &str) -> PyErr {
    raised(py, "PlanError", (reason,))
}

/// A plan that no module can carry out.
pub fn motion_refused(py: Python<'_>, reason: &str) -> PyErr {
    raised(py, "MotionError", (reason,))
}

/// A value as the JSON that the launcher prints.
pub fn json(py: Python<'_>, value: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| plan_refused(py, &error.to_string()))
}

/// A scenario whose plan takes longer than real processes are given.
pub fn scenario_too_large(py: Python<'_>, error: &PlanTooLong) -> PyErr {
    let text = error.to_string();
    let field = error.field;
    let reason = text.strip_prefix(&format!("{field}: ")).unwrap_or(&text);
    raised(py, "ScenarioError", (reason, field))
}

/// A trace that cannot be read.
pub fn trace_refused(py: Python<'_>, error: &TraceError) -> PyErr {
    raised(py, "TraceError", (error.reason.as_str(), error.line))
}
