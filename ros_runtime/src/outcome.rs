//! How a process ends: what it says, and with which status.

use std::process::ExitCode;

use crate::environment::EnvironmentError;
use crate::session::SessionError;

/// What the process was to do is done.
pub const STATUS_DONE: u8 = 0;
/// What the process was to do failed, or was found wrong.
pub const STATUS_FAILED: u8 = 1;
/// The process was not started as it must be.
pub const STATUS_BAD_INPUT: u8 = 2;

/// Why a process could not do what it was to do.
#[derive(Debug)]
pub enum Failure {
    /// Files, arguments or the environment are wrong; nothing was started.
    BadInput(anyhow::Error),
    /// Something failed on the way.
    Failed(anyhow::Error),
}

impl Failure {
    /// Input that is wrong in one line.
    pub fn bad_input(what: impl std::fmt::Display) -> Self {
        Self::BadInput(anyhow::anyhow!("{what}"))
    }

    /// What failed, in one line.
    pub fn failed(what: impl std::fmt::Display) -> Self {
        Self::Failed(anyhow::anyhow!("{what}"))
    }
}

impl From<EnvironmentError> for Failure {
    fn from(error: EnvironmentError) -> Self {
        Self::BadInput(error.into())
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Name { .. } | SessionError::Parameter(_) | SessionError::Discovery(_) => {
                Self::BadInput(error.into())
            }
            SessionError::Drivers(_) | SessionError::Library { .. } | SessionError::Deaf => {
                Self::Failed(error.into())
            }
        }
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Failed(error.into())
    }
}

/// Ends a `main`: a failure is told in one line on the standard error stream.
#[must_use]
pub fn conclude(result: Result<u8, Failure>) -> ExitCode {
    let (error, status) = match result {
        Ok(status) => return status.into(),
        Err(Failure::BadInput(error)) => (error, STATUS_BAD_INPUT),
        Err(Failure::Failed(error)) => (error, STATUS_FAILED),
    };
    eprintln!("error: {}", one_line(&format!("{error:#}")));
    status.into()
}

/// A parser may quote a whole file; nobody reads more than this.
const CHARACTERS_MAX: usize = 1_000;

fn one_line(told: &str) -> String {
    let words: Vec<&str> = told.split_whitespace().collect();
    let line = words.join(" ");
    match line.char_indices().nth(CHARACTERS_MAX) {
        Some((end, _)) => format!("{} ...", &line[..end]),
        None => line,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_told_in_one_line_of_bearable_length() {
        assert_eq!(one_line("a:\n  b\tc\n"), "a: b c");
        let long = one_line(&"\u{e4}".repeat(5_000));
        assert_eq!(long.chars().count(), CHARACTERS_MAX + 4);
    }
}
