//! The results on disk: one line for each finished cell, so that an interrupted run continues from there.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::cell::{Cell, Measurement};
use crate::error::ExperimentError;
use crate::settings::Settings;

/// The settings of the results.
pub(crate) const SETTINGS_FILE: &str = "settings.json";
/// The results, one JSON object in each line.
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
    /// Opens a directory of results, or creates it.
    pub(crate) fn open(directory: &Path, settings: &Settings) -> Result<Self, ExperimentError> {
        fs::create_dir_all(directory).map_err(at(directory, "cannot be created"))?;
        write_or_compare(&directory.join(SETTINGS_FILE), settings)?;
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

    /// Writes a finished cell.
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

    /// The measurement of a finished cell.
    pub(crate) fn get(&self, cell: Cell) -> Option<&Measurement> {
        self.measurements.get(&cell)
    }
}

/// Adds the path to an error.
pub(crate) fn at(path: &Path, what: &'static str) -> impl FnOnce(io::Error) -> ExperimentError {
    let path = path.to_owned();
    move |source| ExperimentError::File { path, what, source }
}

/// The text of a file; `None` if there is no such file.
fn text_of(path: &Path) -> Result<Option<String>, ExperimentError> {
    match fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(at(path, "cannot be read")(error)),
    }
}

/// Writes the settings, or compares them with those that the directory has.
fn write_or_compare(path: &Path, settings: &Settings) -> Result<(), ExperimentError> {
    let wanted = serde_json::to_value(settings)
        .map_err(io::Error::from)
        .map_err(at(path, "cannot be written"))?;
    let Some(text) = text_of(path)? else {
        return fs::write(path, format!("{wanted:#}\n")).map_err(at(path, "cannot be written"));
    };
    let found: serde_json::Value = serde_json::from_str(&text)
        .map_err(|error| ExperimentError::broken(path, error.line(), &error))?;
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
    Err(ExperimentError::BadInput(format!(
        "{}: these results were made with other settings ({}); choose another directory, give the same settings, or \
         remove this one",
        path.display(),
        differences.join("; ")
    )))
}

/// Reads the finished cells. An interruption can leave a last line without an end, which is removed.
fn read(path: &Path) -> Result<BTreeMap<Cell, Measurement>, ExperimentError> {
    let Some(text) = text_of(path)? else {
        return Ok(BTreeMap::new());
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
        let line: Line = serde_json::from_str(line)
            .map_err(|error| ExperimentError::broken(path, number, &error))?;
        measurements.insert(line.cell, line.measurement);
    }
    Ok(measurements)
}
