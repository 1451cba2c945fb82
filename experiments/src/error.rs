//! The errors of experiments.

use std::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};

use formation_generate::GenerateError;
use formation_model::ScenarioError;
use thiserror::Error;

/// Why one cell could not be measured.
#[derive(Debug, Error)]
pub enum CellError {
    /// The generator failed.
    #[error(transparent)]
    Generate(#[from] GenerateError),
    /// The scenario is not valid.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A file cannot be written, or the launcher cannot be started.
    #[error("{what}")]
    Io {
        /// The failed operation.
        what: &'static str,
        /// The cause.
        source: io::Error,
    },
    /// The agents in the simulator, or the processes, did not plan as expected.
    #[error("{0}")]
    Planning(String),
}

/// Why experiments cannot be run, or not be finished.
#[derive(Debug, Error)]
pub enum ExperimentError {
    /// The choice of experiments or the directory of results is not valid; nothing was measured.
    #[error("{0}")]
    BadInput(String),
    /// A file cannot be read or written.
    #[error("{path}: {what}")]
    File {
        /// The file or directory.
        path: PathBuf,
        /// The failed operation.
        what: &'static str,
        /// The cause.
        source: io::Error,
    },
    /// A cell could not be measured; all others so far are kept.
    #[error(
        "{label} could not be measured; all else is kept, and the same command goes on from there"
    )]
    Cell {
        /// The name of the cell.
        label: String,
        /// The cause.
        source: CellError,
    },
    /// The user asked to stop.
    #[error(
        "interrupted; what was measured so far is kept, and the same command goes on from there"
    )]
    Interrupted,
}

impl ExperimentError {
    /// A line of a file that is not a result.
    pub(crate) fn broken(path: &Path, line: usize, reason: &impl Display) -> Self {
        let path = path.display();
        Self::BadInput(format!(
            "{path}, line {line}: is no result of an experiment: {reason}"
        ))
    }
}
