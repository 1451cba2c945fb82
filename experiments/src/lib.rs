//! The evaluation of the paper, repeated: the paper's stated numbers, its algorithms and ours on the same instances.
//!
//! Every figure and table of the section "Experimental Evaluation" is an experiment with a name. An experiment consists
//! of cells, one for each instance and contender. [`run`] measures the cells, writes each to disk as soon as it is
//! finished, and then writes a CSV file for each experiment and `summary.md`. `plot.py` draws the plots from the CSV
//! files. With the same settings, [`run`] continues where an earlier run stopped. The settings determine all numbers
//! except measured times.
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
mod readings;
mod sample;
mod settings;
mod store;
mod summary;
mod table;

use std::fs;
use std::path::Path;

pub use error::{CellError, ExperimentError};
use figures::{Data, FIGURES, Figure};
pub use settings::{Scale, Settings};
use store::{Store, at};

/// The maximum number of runs; seeds above it replace those for which the generator finds no instance.
pub const RUNS_MAX: u64 = 100_000;

/// Receives the progress of the work, and can stop it.
pub trait Progress {
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
    settings: &Settings,
    only: &[String],
    launcher: &Path,
    progress: &mut (dyn Progress + Send),
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
    write_all(directory, settings, &store)
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

fn write_all(directory: &Path, settings: &Settings, store: &Store) -> Result<(), ExperimentError> {
    let write = |name: &str, text: &str| {
        let path = directory.join(name);
        fs::write(&path, text).map_err(at(&path, "cannot be written"))
    };
    let data = Data { settings, store };
    let is_finished = |figure: &&Figure| {
        let mut cells = figure.cells(settings).into_iter();
        cells.all(|cell| store.has(cell))
    };
    let figures: Vec<&Figure> = FIGURES.iter().filter(is_finished).collect();
    for figure in &figures {
        for (name, table) in (figure.tables)(figure, &data) {
            write(&format!("{name}.csv"), &table.to_csv())?;
        }
    }
    let comparison = comparison::compare(&data);
    if let Some(comparison) = &comparison {
        write("comparison.csv", &comparison.table.to_csv())?;
    }
    let readings = readings::compare(&data);
    if let Some(readings) = &readings {
        write("readings.csv", &readings.table.to_csv())?;
    }
    write("paper.csv", paper::CSV)?;
    let summary = summary::write(&data, &figures, comparison.as_ref(), readings.as_ref());
    write("summary.md", &summary)
}
