//! Measuring cells again to compare them with the results of an earlier run.

use std::collections::BTreeSet;
use std::path::Path;

use crate::cell::{Cell, Counts};
use crate::error::ExperimentError;
use crate::figures::FIGURES;
use crate::publication::read_settings;
use crate::settings::ExperimentSettings;
use crate::store::Store;

/// A cell that was measured again. Both results are the JSON of `cells.jsonl`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recomputed {
    /// The experiment.
    pub experiment: &'static str,
    /// The name of the cell.
    pub label: String,
    /// What the directory has; none if it does not have the cell.
    pub kept: Option<String>,
    /// What it is now.
    pub now: String,
}

/// Measures the cheapest cell of each kind and contender of every experiment that is the same on every machine.
///
/// # Errors
/// Fails if the results cannot be read, or a cell cannot be measured.
pub fn recompute(directory: &Path) -> Result<Vec<Recomputed>, ExperimentError> {
    let settings = read_settings(directory)?;
    let store = Store::read(directory)?;
    let once = ExperimentSettings {
        timings: 1,
        ..settings.clone()
    };
    let mut recomputed = Vec::new();
    for figure in &FIGURES {
        let mut cells = figure.cells(&settings);
        cells.retain(|cell| cell.kind.is_counted());
        cells.sort_by_key(|cell| cell.cost());
        let mut seen = BTreeSet::new();
        cells.retain(|cell| seen.insert((cell.kind, cell.contender)));
        for cell in cells {
            recomputed.push(Recomputed {
                experiment: figure.name,
                label: cell.label(),
                kept: store.counts(cell).map(json),
                now: measure(cell, &once)?,
            });
        }
    }
    Ok(recomputed)
}

fn measure(cell: Cell, settings: &ExperimentSettings) -> Result<String, ExperimentError> {
    // No cell that is counted starts processes.
    let measured = cell.measure(settings, Path::new("formation"));
    let measured = measured.map_err(|source| ExperimentError::Cell {
        label: cell.label(),
        source,
    })?;
    Ok(measured.counts.as_ref().map(json).unwrap_or_default())
}

fn json(counts: &Counts) -> String {
    serde_json::to_string(counts).unwrap_or_default()
}
