//! Reading a scenario file, with errors that name the file and the place in it.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use anyhow::{Context, anyhow, bail};
use formation::model::{Scenario, ScenarioError};

use crate::failure::Failure;

/// Files above this size are refused; the largest valid scenario is far smaller.
pub const SCENARIO_FILE_BYTES_MAX: u64 = 16 * 1024 * 1024;

/// A longer message of the parser is cut.
const MESSAGE_CHARACTERS_MAX: usize = 400;

/// Reads and validates a scenario file.
///
/// # Errors
/// Names the file, and the line and column or the field that is wrong.
pub fn load(path: &Path) -> Result<Scenario, Failure> {
    read_text(path)
        .and_then(|text| Scenario::from_yaml(&text).map_err(|error| located(&error)))
        .with_context(|| path.display().to_string())
        .map_err(Failure::BadInput)
}

fn read_text(path: &Path) -> anyhow::Result<String> {
    let file = File::open(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => anyhow!("there is no such file"),
        _ => anyhow!(error).context("cannot be opened"),
    })?;
    if file.metadata().is_ok_and(|metadata| metadata.is_dir()) {
        bail!("is a directory, not a scenario file");
    }
    // The length of a pipe is unknown, so the limit applies to what is read.
    let mut bytes = Vec::new();
    file.take(SCENARIO_FILE_BYTES_MAX + 1)
        .read_to_end(&mut bytes)
        .context("cannot be read")?;
    if bytes.len() as u64 > SCENARIO_FILE_BYTES_MAX {
        bail!(
            "is too large; a scenario file holds at most {} MiB",
            SCENARIO_FILE_BYTES_MAX / (1024 * 1024)
        );
    }
    String::from_utf8(bytes).map_err(|error| {
        anyhow!(
            "is no UTF-8 text (byte {})",
            error.utf8_error().valid_up_to() + 1
        )
    })
}

/// Puts the place of a syntax error first, where editors and people look for it.
fn located(error: &ScenarioError) -> anyhow::Error {
    let message = error.to_string();
    let ScenarioError::Yaml(yaml) = error else {
        return anyhow!(message);
    };
    // The parser quotes what it does not understand, however long it is.
    let message = shortened(&message);
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

fn shortened(message: &str) -> String {
    match message.char_indices().nth(MESSAGE_CHARACTERS_MAX) {
        Some((end, _)) => format!("{}...", &message[..end]),
        None => message.to_owned(),
    }
}
