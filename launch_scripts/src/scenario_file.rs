//! Reading a scenario file, with errors that name the file and the place in it.

use std::path::Path;

use anyhow::{Context, anyhow};
use formation::model::{Scenario, ScenarioError};
use ros_runtime::arguments::read_bounded;
use ros_runtime::exit::{Failure, shortened};

/// Files above this size are refused; the largest valid scenario is far smaller.
pub const SCENARIO_FILE_BYTES_MAX: u64 = 16 * 1024 * 1024;

/// A longer message of the parser is cut.
const MESSAGE_BYTES_MAX: usize = 400;

/// Reads and validates a scenario file.
///
/// # Errors
/// Names the file, and the line and column or the field that is wrong.
pub fn load(path: &Path) -> Result<Scenario, Failure> {
    read_bounded(path, SCENARIO_FILE_BYTES_MAX)
        .map_err(anyhow::Error::from)
        .and_then(|text| Scenario::from_yaml(&text).map_err(|error| located(&error)))
        .with_context(|| path.display().to_string())
        .map_err(Failure::BadInput)
}

/// Puts the place of a syntax error first, where editors and people look for it.
fn located(error: &ScenarioError) -> anyhow::Error {
    let message = error.to_string();
    let ScenarioError::Yaml(yaml) = error else {
        return anyhow!(message);
    };
    // The parser quotes what it does not understand, however long it is.
    let message = shortened(message, MESSAGE_BYTES_MAX);
    let Some(location) = yaml.location() else {
        return anyhow!("is no scenario: {message}");
    };
    let (line, column) = (location.line(), location.column());
    let reason = message
        .replacen(&format!(" at line {line} column {column}"), "", 1)
        .trim()
        .to_owned();
    anyhow!("line {line} column {column}: {reason}")
}
