//! Writing to the terminal without a panic when the reader is gone.

use std::io::{ErrorKind, Write, stderr, stdout};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::anyhow;
use ros_runtime::exit::Failure;
use ros_runtime::terminal;
use serde::Serialize;

/// Writes results for people to the standard output: on a terminal, lines end between words.
///
/// # Errors
/// As [`result_line`].
pub fn result_text(text: &str) -> Result<(), Failure> {
    result_line(&terminal::fitted(text, &stdout()))
}

/// Writes one line of result to the standard output.
///
/// # Errors
/// The reader closed the output, it was closed from the start, or writing failed.
pub fn result_line(line: &str) -> Result<(), Failure> {
    if IS_CLOSED.load(Ordering::Relaxed) {
        return Err(Failure::failed(
            "cannot write the result: the standard output is closed",
        ));
    }
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

static IS_CLOSED: AtomicBool = AtomicBool::new(false);

/// Notes whether the program was started without a standard output (`>&-`).
///
/// It runs before the Rust runtime, which puts `/dev/null` in the place of a closed descriptor before it calls `main`; from then on
/// nothing tells it from output that was discarded.
#[ctor::ctor]
fn note_closed_output() {
    let descriptors = Path::new("/proc/self/fd");
    let is_closed = descriptors.exists() && descriptors.join("1").symlink_metadata().is_err();
    IS_CLOSED.store(is_closed, Ordering::Relaxed);
}

/// Writes one line about the progress to the standard error output. If that is closed, the line is lost.
pub fn note(line: &str) {
    let line = terminal::fitted(line, &stderr());
    let _ = writeln!(stderr().lock(), "{line}");
}
