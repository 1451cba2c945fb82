//! The evaluation of the paper, run again: its stated numbers, its algorithms and ours, side by side.
//!
//! Every figure and table of the section "Experimental Evaluation" is an experiment with a name. An experiment is made of
//! cells, one for each instance and contender. [`run`] measures the cells, keeps each as soon as it is finished, and
//! writes one CSV file and one SVG plot an experiment, and `summary.md`. Run again with the same settings, it goes on where
//! it stopped; apart from the times, the same settings give the same numbers.
//!
//! Planning times are those of the core on one thread, and of real processes over DDS. Messages and completion are recorded
//! while the agents plan in the simulator.

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
mod plot;
mod sample;
mod settings;
mod store;
mod summary;
mod table;

use std::fs;
use std::path::Path;

pub use error::{CellError, ExperimentError};
use figures::{EXPERIMENTS, Experiment};
pub use instance::InstanceError;
pub use measure::processes::ProcessError;
pub use measure::protocol::ProtocolError;
pub use settings::{Scale, Settings};
use store::{Store, at};
use summary::Section;

/// The most runs; seeds of stand-ins lie above.
pub const RUNS_MAX: u64 = 100_000;

/// Is told how the work goes on, and may stop it.
pub trait Progress {
    /// The work begins: this many cells are to be measured, of which so many are finished already. Costs are in parts of
    /// about a tenth of a millisecond.
    fn begin(&mut self, work: Work);
    /// A cell is being measured; there may be others beside it.
    fn cell(&mut self, label: &str);
    /// A cell is finished; it had this cost.
    fn finished(&mut self, cost: u64);
    /// Whether to go on; asked whenever a cell begins or is finished.
    fn goes_on(&self) -> bool;
}

/// How much there is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work {
    /// All cells of the chosen experiments.
    pub cells: usize,
    /// Those that are finished already.
    pub finished_cells: usize,
    /// The cost of all cells.
    pub cost: u64,
    /// The cost of those that are finished.
    pub finished_cost: u64,
}

/// The names of all experiments, in the order of the paper.
#[must_use]
pub fn names() -> Vec<&'static str> {
    EXPERIMENTS
        .iter()
        .map(|experiment| experiment.name)
        .collect()
}

/// Measures what is not measured yet and writes all files.
///
/// `only` chooses experiments by name; none means all. `launcher` is the program `formation`, which is started for real
/// processes. `summary.md` covers all experiments whose cells are finished, also by earlier runs.
///
/// # Errors
/// Names what is wrong with the choice or the directory, or the cell that could not be measured; what was measured by then
/// is kept.
pub fn run(
    directory: &Path,
    settings: &Settings,
    only: &[String],
    launcher: &Path,
    progress: &mut dyn Progress,
) -> Result<(), ExperimentError> {
    if !(1..=RUNS_MAX).contains(&settings.runs) {
        return Err(ExperimentError::Runs {
            given: settings.runs,
            most: RUNS_MAX,
        });
    }
    let chosen = choose(only)?;
    let mut store = Store::open(directory, settings)?;
    measuring::measure_all(settings, &chosen, launcher, &mut store, progress)?;
    write_all(directory, settings, &store)
}

fn choose(only: &[String]) -> Result<Vec<&'static Experiment>, ExperimentError> {
    if let Some(unknown) = only.iter().find(|name| !names().contains(&name.as_str())) {
        return Err(ExperimentError::UnknownName {
            given: unknown.clone(),
            known: names(),
        });
    }
    let is_chosen = |name: &str| only.is_empty() || only.iter().any(|one| one == name);
    Ok(EXPERIMENTS
        .iter()
        .filter(|experiment| is_chosen(experiment.name))
        .collect())
}

fn write_all(directory: &Path, settings: &Settings, store: &Store) -> Result<(), ExperimentError> {
    let write = |name: &str, text: &str| {
        let path = directory.join(name);
        fs::write(&path, text).map_err(at(&path, "cannot be written"))
    };
    let mut sections = Vec::new();
    for experiment in &EXPERIMENTS {
        let cells = (experiment.cells)(settings);
        if !cells.into_iter().all(|cell| store.has(cell)) {
            continue;
        }
        let report = (experiment.report)(settings, store);
        let plot = plot::draw(&report.plot).map_err(|error| ExperimentError::Plot {
            name: experiment.name,
            reason: error.to_string(),
        })?;
        write(&format!("{}.csv", experiment.name), &report.table.to_csv())?;
        write(&format!("{}.svg", experiment.name), &plot)?;
        sections.push(Section {
            name: experiment.name,
            title: experiment.title,
            source: experiment.source,
            text: report.text,
        });
    }
    let comparison = comparison::compare(settings, store);
    if let Some(comparison) = &comparison {
        write("comparison.csv", &comparison.table.to_csv())?;
    }
    let text = summary::write(settings, &sections, comparison.as_ref());
    write("summary.md", &text)
}
