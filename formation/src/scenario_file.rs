//! Reading a scenario, with errors that name the file and the place in it.

use std::io::stdin;
use std::path::Path;

use anyhow::{Context, anyhow};
use formation_model::{Scenario, ScenarioError};
use ros_runtime::arguments::{read_bounded, text_of};
use ros_runtime::exit::{Failure, shortened};

/// Files above this size are refused; the largest valid scenario is far smaller.
pub const SCENARIO_FILE_BYTES_MAX: u64 = 16 * 1024 * 1024;

/// A longer message of the parser is cut.
const MESSAGE_BYTES_MAX: usize = 400;

/// Reads and validates a scenario file; `-` stands for the standard input.
///
/// # Errors
/// Names the file, and the line and column or the field that is wrong.
pub fn load(path: &Path) -> Result<Scenario, Failure> {
    read(&text(path)?)
        .with_context(|| named(path))
        .map_err(Failure::BadInput)
}

/// Validates the text of a scenario.
///
/// # Errors
/// Names the line and column or the field that is wrong.
pub fn read(text: &str) -> anyhow::Result<Scenario> {
    Scenario::from_yaml(text).map_err(|error| bounded(&error))
}

/// Reads the text of a scenario file, valid or not; `-` stands for the standard input.
///
/// # Errors
/// Names the file, which cannot be read or is too long.
pub fn text(path: &Path) -> Result<String, Failure> {
    let text = match is_standard_input(path) {
        true => text_of(stdin().lock(), SCENARIO_FILE_BYTES_MAX),
        false => read_bounded(path, SCENARIO_FILE_BYTES_MAX),
    };
    text.map_err(anyhow::Error::from)
        .with_context(|| named(path))
        .map_err(Failure::BadInput)
}

/// Like [`load`], and refuses a target that modules cannot dock into one formation.
///
/// # Errors
/// Names the file and what is wrong with it.
pub fn load_formable(path: &Path) -> Result<Scenario, Failure> {
    let scenario = load(path)?;
    let formable = scenario.check_formable().with_context(|| named(path));
    formable.map_err(Failure::BadInput)?;
    Ok(scenario)
}

/// Whether a path stands for the standard input.
pub fn is_standard_input(path: &Path) -> bool {
    path == Path::new("-")
}

/// The path in messages.
pub fn named(path: &Path) -> String {
    match is_standard_input(path) {
        true => "standard input".to_owned(),
        false => path.display().to_string(),
    }
}

/// The parser quotes what it does not understand, however long it is.
fn bounded(error: &ScenarioError) -> anyhow::Error {
    let message = error.to_string();
    match error {
        ScenarioError::Yaml(_) => anyhow!(shortened(message, MESSAGE_BYTES_MAX)),
        _ => anyhow!(message),
    }
}
