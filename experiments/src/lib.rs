//! The evaluation of the paper, repeated: the paper's stated numbers, its algorithms and ours on the same instances.
//!
//! Every figure and table of the section "Experimental Evaluation" is an experiment with a name. An experiment consists
//! of cells, one for each instance and contender. [`run`] measures the cells, writes each to disk as soon as it is
//! finished, and then writes all tables. With the same settings, [`run`] continues where an earlier run stopped.
//!
//! What the settings determine is in `cells.jsonl`, and what the clock decides in `times.jsonl`. Every table follows from
//! these files and nothing else ([`Publication`]); no table mixes both, and `plot.py` draws the plots from the CSV files.
//!
//! Planning times are those of the core on one thread, and of real processes over DDS. Messages and completion are
//! recorded while the agents plan in the simulator.

#![allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts become floating-point numbers for averages and plots; all are small"
)]

mod case_studies;
mod cell;
mod comparison;
mod contender;
mod error;
mod figures;
mod instance;
mod measure;
mod measuring;
mod paper;
mod publication;
mod recomputation;
mod sample;
mod settings;
mod store;
mod summary;
mod table;

use std::fs;
use std::path::Path;

pub use error::{CellError, ExperimentError};
use figures::{FIGURES, Figure};
pub use publication::Publication;
pub use recomputation::{Recomputed, recompute};
pub use settings::{ExperimentSettings, Scale};
use store::{Store, at};

/// The maximum number of runs; seeds above it replace those for which the generator finds no instance.
pub const RUNS_MAX: u64 = 100_000;

/// Receives the progress of the work, and can stop it.
pub trait ProgressSink {
    /// The work begins.
    fn begin(&mut self, work: Work);
    /// The measurement of a cell begins; others may run at the same time.
    fn cell(&mut self, label: &str);
    /// A cell of this cost is finished.
    fn finished(&mut self, cost: u64);
    /// Whether to continue; called whenever a cell begins or is finished.
    fn goes_on(&self) -> bool;
}

/// The amount of work. Costs are estimates in tenths of a millisecond.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work {
    /// All cells of the chosen experiments.
    pub cells: usize,
    /// Cells that an earlier run has finished.
    pub finished_cells: usize,
    /// The cost of all cells.
    pub cost: u64,
    /// The cost of the finished cells.
    pub finished_cost: u64,
}

/// The names of all experiments, in the order of the paper.
#[must_use]
pub fn names() -> Vec<&'static str> {
    FIGURES.iter().map(|figure| figure.name).collect()
}

/// Measures the cells that are not finished and writes all files.
///
/// `only` chooses experiments by name; an empty list means all. `launcher` is the program `formation`, which starts the
/// real processes. `summary.md` covers all experiments whose cells are finished, including those of earlier runs.
///
/// # Errors
/// Fails if the choice or the directory is not valid, or if a cell cannot be measured. Finished cells stay on disk.
pub fn run(
    directory: &Path,
    settings: &ExperimentSettings,
    only: &[String],
    launcher: &Path,
    progress: &mut (dyn ProgressSink + Send),
) -> Result<(), ExperimentError> {
    if !(1..=RUNS_MAX).contains(&settings.runs) {
        let given = settings.runs;
        return Err(ExperimentError::BadInput(format!(
            "runs must be 1 to {RUNS_MAX}, got {given}"
        )));
    }
    let chosen = choose(only)?;
    let mut store = Store::open(directory, settings)?;
    measuring::measure_all(settings, &chosen, launcher, &mut store, progress)?;
    store.sort()?;
    for (name, text) in Publication::of(settings, &store).files {
        let path = directory.join(name);
        fs::write(&path, text).map_err(at(&path, "cannot be written"))?;
    }
    Ok(())
}

fn choose(only: &[String]) -> Result<Vec<&'static Figure>, ExperimentError> {
    if let Some(unknown) = only.iter().find(|name| !names().contains(&name.as_str())) {
        return Err(ExperimentError::BadInput(format!(
            "there is no experiment {unknown}; there are: {}",
            names().join(", ")
        )));
    }
    let is_chosen = |figure: &&Figure| only.is_empty() || only.iter().any(|one| one == figure.name);
    Ok(FIGURES.iter().filter(is_chosen).collect())
}
