//! Writing to the terminal without a panic when the reader is gone.

use std::io::{ErrorKind, Write, stderr, stdout};

use anyhow::anyhow;
use ros_runtime::exit::Failure;
use serde::Serialize;

/// Writes one line of result to the standard output.
///
/// # Errors
/// The reader closed the output, or writing failed.
pub fn result_line(line: &str) -> Result<(), Failure> {
    let mut output = stdout().lock();
    writeln!(output, "{line}")
        .and_then(|()| output.flush())
        .map_err(|error| match error.kind() {
            ErrorKind::BrokenPipe => Failure::OutputClosed,
            _ => Failure::Failed(anyhow!(error).context("cannot write the result")),
        })
}

/// Writes a result as one JSON object on one line.
///
/// # Errors
/// As [`result_line`].
pub fn result_json(result: &impl Serialize) -> Result<(), Failure> {
    let json = serde_json::to_string(result)
        .map_err(|error| Failure::Failed(anyhow!(error).context("cannot write the result")))?;
    result_line(&json)
}

/// Writes one line about the progress to the standard error output. If that is closed, the line is lost.
pub fn note(line: &str) {
    let _ = writeln!(stderr().lock(), "{line}");
}
