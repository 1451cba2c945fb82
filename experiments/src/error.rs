//! Why experiments cannot be run.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::instance::InstanceError;
use crate::measure::processes::ProcessError;
use crate::measure::protocol::ProtocolError;

/// Why one cell could not be measured.
#[derive(Debug, Error)]
pub enum CellError {
    /// There is no instance.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The agents did not plan.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The processes did not plan.
    #[error(transparent)]
    Processes(#[from] ProcessError),
}

/// Why experiments cannot be run, or not be finished.
#[derive(Debug, Error)]
pub enum ExperimentError {
    /// There is no experiment of this name.
    #[error("there is no experiment {given}; there are: {}", known.join(", "))]
    UnknownName {
        /// The name that was given.
        given: String,
        /// All names.
        known: Vec<&'static str>,
    },
    /// An average over nothing.
    #[error("runs must be 1 to {most}, got {given}")]
    Runs {
        /// What was given.
        given: u64,
        /// The most that is allowed.
        most: u64,
    },
    /// A file cannot be read or written.
    #[error("{path}: {what}")]
    File {
        /// The file or directory.
        path: PathBuf,
        /// What was tried.
        what: &'static str,
        /// Why it failed.
        source: io::Error,
    },
    /// The directory holds results of other settings.
    #[error(
        "{path}: these results were made with other settings ({differences}); choose another directory, give the same \
         settings, or remove this one"
    )]
    OtherSettings {
        /// The file of settings.
        path: PathBuf,
        /// What differs.
        differences: String,
    },
    /// A file in the directory is none of ours.
    #[error("{path}, line {line}: is no result of an experiment: {reason}")]
    BrokenResults {
        /// The file.
        path: PathBuf,
        /// The line.
        line: usize,
        /// What is wrong there.
        reason: String,
    },
    /// A cell could not be measured; all others so far are kept.
    #[error(
        "{label} could not be measured; all else is kept, and the same command goes on from there"
    )]
    Cell {
        /// Which cell.
        label: String,
        /// Why.
        source: CellError,
    },
    /// A plot could not be drawn.
    #[error("{name}: the plot cannot be drawn: {reason}")]
    Plot {
        /// The experiment's name.
        name: &'static str,
        /// Why.
        reason: String,
    },
    /// The user asked to stop.
    #[error(
        "interrupted; what was measured so far is kept, and the same command goes on from there"
    )]
    Interrupted,
}

impl ExperimentError {
    /// Whether the input, or what lies in the directory, forbids to begin.
    #[must_use]
    pub fn is_bad_input(&self) -> bool {
        matches!(
            self,
            Self::UnknownName { .. }
                | Self::Runs { .. }
                | Self::OtherSettings { .. }
                | Self::BrokenResults { .. }
        )
    }
}
