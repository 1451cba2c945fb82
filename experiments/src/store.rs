//! The results on disk: one line a finished cell, so that an interrupted run goes on where it stopped.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::cell::{Cell, Measurement};
use crate::error::ExperimentError;
use crate::measure::auction::AuctionMeasurement;
use crate::measure::matching::MatchingMeasurement;
use crate::measure::plan::PlanMeasurement;
use crate::measure::processes::ProcessMeasurement;
use crate::measure::protocol::ProtocolMeasurement;
use crate::settings::Settings;

/// The settings that the results were made with.
pub(crate) const SETTINGS_FILE: &str = "settings.json";
/// The results, one JSON object a line.
pub(crate) const CELLS_FILE: &str = "cells.jsonl";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    cell: Cell,
    measurement: Measurement,
}

/// All finished cells of a directory.
pub(crate) struct Store {
    path: PathBuf,
    file: File,
    measurements: BTreeMap<Cell, Measurement>,
}

impl Store {
    /// Opens a directory of results, or makes it.
    pub(crate) fn open(directory: &Path, settings: &Settings) -> Result<Self, ExperimentError> {
        fs::create_dir_all(directory).map_err(at(directory, "cannot be created"))?;
        settle_settings(&directory.join(SETTINGS_FILE), settings)?;
        let path = directory.join(CELLS_FILE);
        let measurements = read(&path)?;
        let file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(&path)
            .map_err(at(&path, "cannot be opened"))?;
        Ok(Self {
            path,
            file,
            measurements,
        })
    }

    /// Whether a cell is finished.
    pub(crate) fn has(&self, cell: Cell) -> bool {
        self.measurements.contains_key(&cell)
    }

    /// Keeps a cell.
    pub(crate) fn keep(
        &mut self,
        cell: Cell,
        measurement: Measurement,
    ) -> Result<(), ExperimentError> {
        let line = Line { cell, measurement };
        let mut text = serde_json::to_string(&line)
            .map_err(io::Error::from)
            .map_err(at(&self.path, "cannot be written"))?;
        text.push('\n');
        self.file
            .write_all(text.as_bytes())
            .map_err(at(&self.path, "cannot be written"))?;
        self.measurements.insert(cell, line.measurement);
        Ok(())
    }

    pub(crate) fn matching(&self, cell: Cell) -> Option<&MatchingMeasurement> {
        match self.measurements.get(&cell)? {
            Measurement::Matching(measurement) => Some(measurement),
            _ => None,
        }
    }

    pub(crate) fn plan(&self, cell: Cell) -> Option<&PlanMeasurement> {
        match self.measurements.get(&cell)? {
            Measurement::Plan(measurement) => Some(measurement),
            _ => None,
        }
    }

    pub(crate) fn protocol(&self, cell: Cell) -> Option<&ProtocolMeasurement> {
        match self.measurements.get(&cell)? {
            Measurement::Protocol(measurement) => Some(measurement),
            _ => None,
        }
    }

    pub(crate) fn auction(&self, cell: Cell) -> Option<&AuctionMeasurement> {
        match self.measurements.get(&cell)? {
            Measurement::Auction(measurement) => Some(measurement),
            _ => None,
        }
    }

    pub(crate) fn processes(&self, cell: Cell) -> Option<&ProcessMeasurement> {
        match self.measurements.get(&cell)? {
            Measurement::Processes(measurement) => Some(measurement),
            _ => None,
        }
    }
}

/// Names the file of an error.
pub(crate) fn at(path: &Path, what: &'static str) -> impl FnOnce(io::Error) -> ExperimentError {
    let path = path.to_owned();
    move |source| ExperimentError::File { path, what, source }
}

fn settle_settings(path: &Path, settings: &Settings) -> Result<(), ExperimentError> {
    let wanted = serde_json::to_value(settings)
        .map_err(io::Error::from)
        .map_err(at(path, "cannot be written"))?;
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return fs::write(path, format!("{wanted:#}\n")).map_err(at(path, "cannot be written"));
        }
        Err(error) => return Err(at(path, "cannot be read")(error)),
    };
    let found: serde_json::Value =
        serde_json::from_str(&text).map_err(|error| ExperimentError::BrokenResults {
            path: path.to_owned(),
            line: error.line(),
            reason: error.to_string(),
        })?;
    if found == wanted {
        return Ok(());
    }
    let fields = wanted.as_object().into_iter().flatten();
    let differences: Vec<String> = fields
        .filter(|(name, value)| found.get(name.as_str()) != Some(value))
        .map(|(name, value)| {
            let found = found.get(name.as_str()).unwrap_or_default();
            format!("{name} was {found}, now {value}")
        })
        .collect();
    Err(ExperimentError::OtherSettings {
        path: path.to_owned(),
        differences: differences.join("; "),
    })
}

/// Reads the finished cells. A last line without an end is what an interruption left of a cell, and is removed.
fn read(path: &Path) -> Result<BTreeMap<Cell, Measurement>, ExperimentError> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        Err(error) => return Err(at(path, "cannot be read")(error)),
    };
    let whole = text.rfind('\n').map_or(0, |end| end + 1);
    if whole < text.len() {
        OpenOptions::new()
            .write(true)
            .open(path)
            .and_then(|file| file.set_len(whole as u64))
            .map_err(at(path, "cannot be shortened to its last whole line"))?;
    }
    let mut measurements = BTreeMap::new();
    for (number, line) in (1..).zip(text[..whole].lines()) {
        let line: Line =
            serde_json::from_str(line).map_err(|error| ExperimentError::BrokenResults {
                path: path.to_owned(),
                line: number,
                reason: error.to_string(),
            })?;
        measurements.insert(line.cell, line.measurement);
    }
    Ok(measurements)
}
