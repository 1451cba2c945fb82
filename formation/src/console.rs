//! Writing to the terminal without a panic when the reader is gone.

use std::fs;
use std::io::{ErrorKind, Write, stderr, stdout};
use std::os::unix::fs::MetadataExt;

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
    if is_closed() {
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

/// Whether the program was started without a standard output (`>&-`).
///
/// The Rust runtime then puts `/dev/null` in its place before `main`, open for reading as well, which a shell's `>/dev/null`
/// is not. Programs that start others with all output discarded open it likewise, but for the standard error output too.
fn is_closed() -> bool {
    replaces_closed(1) && !replaces_closed(2)
}

/// Whether a descriptor is `/dev/null`, open for reading and writing.
fn replaces_closed(descriptor: u8) -> bool {
    const READ_WRITE: u32 = 0o2;
    const ACCESS: u32 = 0o3;
    let device = |path: &str| fs::metadata(path).map(|file| file.rdev()).ok();
    let null = device("/dev/null");
    if null.is_none() || device(&format!("/proc/self/fd/{descriptor}")) != null {
        return false;
    }
    let info = fs::read_to_string(format!("/proc/self/fdinfo/{descriptor}")).unwrap_or_default();
    let mut lines = info.lines();
    let flags = lines.find_map(|line| line.strip_prefix("flags:"));
    let flags = flags.and_then(|flags| u32::from_str_radix(flags.trim(), 8).ok());
    flags.is_some_and(|flags| flags & ACCESS == READ_WRITE)
}

/// Writes one line about the progress to the standard error output. If that is closed, the line is lost.
pub fn note(line: &str) {
    let line = terminal::fitted(line, &stderr());
    let _ = writeln!(stderr().lock(), "{line}");
}
