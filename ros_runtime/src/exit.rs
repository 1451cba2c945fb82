//! How a process ends: when it is asked to, with which status, and with which message.

use std::io::{self, Write};
use std::panic;
use std::process::{self, ExitCode};
use std::thread;
use std::time::{Duration, Instant};

use async_channel::{Receiver, bounded};
use rustix::process::{Signal, getppid, set_parent_process_death_signal};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use thiserror::Error;

use crate::terminal;

/// The process has done its work.
pub const STATUS_DONE: u8 = 0;
/// The work of the process failed, or what it judged is wrong.
pub const STATUS_FAILED: u8 = 1;
/// The arguments, files or environment of the process cannot be used.
pub const STATUS_BAD_INPUT: u8 = 2;
/// The work is done, and the poses are not exact enough to tell whether it is right.
pub const STATUS_NOT_JUDGED: u8 = 3;

/// How long a process that was asked to end has to leave the graph.
pub const EXIT_GRACE: Duration = Duration::from_millis(1_500);

/// Signals that follow the first within this time repeat it: Ctrl-C reaches a process from its terminal and from the program
/// that started it, such as `ros2 launch` or `formation run`.
pub const REPEATS_FOR: Duration = Duration::from_secs(1);

/// The longest error message, in bytes: a parser may quote a whole file.
const MESSAGE_BYTES_MAX: usize = 1_000;

/// Why a process could not do its work.
#[derive(Debug, Error)]
pub enum Failure {
    /// Files, arguments or the environment are wrong, for this process or for one that it started.
    #[error("{}", with_causes(.0))]
    BadInput(anyhow::Error),
    /// Something failed later.
    #[error("{}", with_causes(.0))]
    Failed(anyhow::Error),
    /// What was done cannot be judged.
    #[error("{0}")]
    NotJudged(String),
    /// A signal asked the process to end before its work was done.
    #[error("{0}")]
    Interrupted(String, i32),
    /// The reader of the standard output closed it, as `head` does; nothing is reported then.
    #[error("the standard output was closed")]
    OutputClosed,
}

/// An error and its causes in one line: parsers may quote the input, so a message can have line ends of its own.
fn with_causes(error: &anyhow::Error) -> String {
    one_line(&format!("{error:#}"))
}

impl Failure {
    /// Input that is wrong.
    pub fn bad_input(what: impl std::fmt::Display) -> Self {
        Self::BadInput(anyhow::anyhow!("{what}"))
    }

    /// What failed.
    pub fn failed(what: impl std::fmt::Display) -> Self {
        Self::Failed(anyhow::anyhow!("{what}"))
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Failed(error.into())
    }
}

/// Ends a `main`: reports a failure in one line on the standard error stream.
#[must_use]
pub fn conclude(result: Result<u8, Failure>) -> ExitCode {
    let failure = match result {
        Ok(status) => return status.into(),
        Err(failure) => failure,
    };
    if !matches!(failure, Failure::OutputClosed) {
        let message = shortened(failure.to_string(), MESSAGE_BYTES_MAX);
        let message = terminal::fitted(&format!("error: {message}"), &io::stderr());
        // If the stream is closed, the line is lost.
        let _ = writeln!(io::stderr().lock(), "{message}");
    }
    let status = match failure {
        Failure::BadInput(_) => STATUS_BAD_INPUT,
        Failure::NotJudged(_) => STATUS_NOT_JUDGED,
        // What a shell reports for a process that the signal ended.
        Failure::Interrupted(_, signal) => u8::try_from(128 + signal).unwrap_or(STATUS_FAILED),
        Failure::Failed(_) | Failure::OutputClosed => STATUS_FAILED,
    };
    status.into()
}

/// The text with every run of line ends, spaces and control characters replaced by one space.
#[must_use]
pub fn one_line(text: &str) -> String {
    let words = text.split(|symbol: char| symbol.is_whitespace() || symbol.is_control());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    words.join(" ")
}

/// The text, cut to `bytes_max` bytes and an ellipsis.
#[must_use]
pub fn shortened(mut text: String, bytes_max: usize) -> String {
    if text.len() > bytes_max {
        let mut ends = (0..=bytes_max).rev();
        let end = ends.find(|&end| text.is_char_boundary(end));
        text.truncate(end.unwrap_or_default());
        text.push_str(" ...");
    }
    text
}

/// What a signal asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndRequest {
    /// To end.
    First,
    /// What the first signal asked for already.
    Repeated,
    /// To end at once.
    Urgent,
}

/// The signals that asked a process to end.
#[derive(Clone, Copy, Debug, Default)]
pub struct EndSignals {
    first: Option<Instant>,
}

impl EndSignals {
    /// Takes in a signal that came at `now`.
    pub fn receive(&mut self, now: Instant) -> EndRequest {
        match self.first {
            None => {
                self.first = Some(now);
                EndRequest::First
            }
            Some(first) if now.saturating_duration_since(first) < REPEATS_FOR => {
                EndRequest::Repeated
            }
            Some(_) => EndRequest::Urgent,
        }
    }
}

/// The request to end; yields once, on the first SIGINT or SIGTERM.
///
/// The process then has [`EXIT_GRACE`] to end by itself. Signals that follow within [`REPEATS_FOR`] change nothing; a later one
/// ends it at once.
///
/// # Errors
/// The operating system did not let the signals be caught.
pub fn stop_requested() -> io::Result<Receiver<()>> {
    let (sender, receiver) = bounded(1);
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            let mut received = EndSignals::default();
            for _ in signals.forever() {
                match received.receive(Instant::now()) {
                    EndRequest::First => {
                        // A full channel means that the request is there already.
                        let _ = sender.try_send(());
                        limit_exit(EXIT_GRACE, STATUS_FAILED);
                    }
                    EndRequest::Repeated => {}
                    EndRequest::Urgent => process::exit(STATUS_FAILED.into()),
                }
            }
        })?;
    Ok(receiver)
}

/// Ends the process with `status` after this time if it has not ended by then, even while the libraries below wait.
pub fn limit_exit(after: Duration, status: u8) {
    let end = move || {
        thread::sleep(after);
        tracing::warn!("could not leave the ROS 2 graph in time; ending without");
        process::exit(status.into());
    };
    let limit = thread::Builder::new()
        .name("exit limit".to_owned())
        .spawn(end);
    if let Err(error) = limit {
        tracing::warn!(
            "the end of the process has no time limit, as no thread can be started: {error}"
        );
    }
}

/// From now on a panic in any thread, also of the DDS library, ends the process: without that thread it could no longer
/// send or receive.
pub(crate) fn end_on_panic() {
    let report = panic::take_hook();
    panic::set_hook(Box::new(move |panic| {
        report(panic);
        process::exit(STATUS_FAILED.into());
    }));
}

/// From now on the process is asked to end when the one that started it ends, for whatever reason.
///
/// # Errors
/// The operating system refuses.
pub fn end_with_parent() -> io::Result<()> {
    let parent = getppid();
    set_parent_process_death_signal(Some(Signal::TERM))?;
    if getppid() != parent {
        process::exit(STATUS_FAILED.into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_reported_in_one_bounded_line_with_all_its_causes() {
        let failure = Failure::BadInput(anyhow::anyhow!("line\r\n  end\tof it").context("file"));
        assert_eq!(failure.to_string(), "file: line end of it");
        assert_eq!(shortened("\u{e4}\u{e4}".to_owned(), 3), "\u{e4} ...");
        assert_eq!(shortened("\u{e4}\u{e4}".to_owned(), 4), "\u{e4}\u{e4}");
    }

    #[test]
    fn a_signal_that_repeats_within_a_second_changes_nothing_and_a_later_one_is_urgent() {
        let start = Instant::now();
        let after = |millis| start + Duration::from_millis(millis);
        let mut signals = EndSignals::default();
        assert_eq!(signals.receive(start), EndRequest::First);
        assert_eq!(signals.receive(start), EndRequest::Repeated);
        assert_eq!(signals.receive(after(999)), EndRequest::Repeated);
        assert_eq!(signals.receive(after(1_000)), EndRequest::Urgent);
    }
}
