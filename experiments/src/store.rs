//! The results on disk: one line for each finished cell, so that an interrupted run continues from there.

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::cell::{Cell, Counts, Measurement, Times};
use crate::error::ExperimentError;
use crate::settings::ExperimentSettings;

/// The settings of the results.
pub(crate) const SETTINGS_FILE: &str = "settings.json";
/// The results that are the same on every machine, one JSON object in each line.
pub(crate) const CELLS_FILE: &str = "cells.jsonl";
/// The results that the clock decides, in the same form.
pub(crate) const TIMES_FILE: &str = "times.jsonl";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line<T> {
    cell: Cell,
    result: T,
}

/// A file of results: appended to while cells are measured, sorted by [`Store::sort`].
struct Results<T> {
    path: PathBuf,
    of: BTreeMap<Cell, T>,
}

/// All finished cells of a directory.
pub(crate) struct Store {
    counts: Results<Counts>,
    times: Results<Times>,
}

impl Store {
    /// Opens a directory of results, or creates it.
    pub(crate) fn open(
        directory: &Path,
        settings: &ExperimentSettings,
    ) -> Result<Self, ExperimentError> {
        fs::create_dir_all(directory).map_err(at(directory, "cannot be created"))?;
        write_or_compare(&directory.join(SETTINGS_FILE), settings)?;
        Self::read(directory)
    }

    /// Reads the results of a directory.
    pub(crate) fn read(directory: &Path) -> Result<Self, ExperimentError> {
        Ok(Self {
            counts: Results::read(directory.join(CELLS_FILE))?,
            times: Results::read(directory.join(TIMES_FILE))?,
        })
    }

    /// Whether a cell is finished.
    pub(crate) fn has(&self, cell: Cell) -> bool {
        (!cell.kind.is_counted() || self.counts.of.contains_key(&cell))
            && (!cell.kind.is_timed() || self.times.of.contains_key(&cell))
    }

    /// Writes a finished cell.
    pub(crate) fn keep(
        &mut self,
        cell: Cell,
        measurement: Measurement,
    ) -> Result<(), ExperimentError> {
        if let Some(counts) = measurement.counts {
            self.counts.append(cell, counts)?;
        }
        if let Some(times) = measurement.times {
            self.times.append(cell, times)?;
        }
        Ok(())
    }

    /// Writes both files in the order of cells: by kind, contender and instance, then by how processes run.
    pub(crate) fn sort(&self) -> Result<(), ExperimentError> {
        self.counts.sort()?;
        self.times.sort()
    }

    pub(crate) fn counts(&self, cell: Cell) -> Option<&Counts> {
        self.counts.of.get(&cell)
    }

    pub(crate) fn times(&self, cell: Cell) -> Option<&Times> {
        self.times.of.get(&cell)
    }
}

impl<T: Serialize + DeserializeOwned> Results<T> {
    /// Reads the finished cells. An interruption can leave a last line without an end, which is removed.
    fn read(path: PathBuf) -> Result<Self, ExperimentError> {
        let text = text_of(&path)?.unwrap_or_default();
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        if whole < text.len() {
            OpenOptions::new()
                .write(true)
                .open(&path)
                .and_then(|file| file.set_len(whole as u64))
                .map_err(at(&path, "cannot be shortened to its last whole line"))?;
        }
        let mut of = BTreeMap::new();
        for (number, line) in (1..).zip(text[..whole].lines()) {
            let line: Line<T> = serde_json::from_str(line)
                .map_err(|error| ExperimentError::broken(&path, number, &error))?;
            of.insert(line.cell, line.result);
        }
        Ok(Self { path, of })
    }

    fn append(&mut self, cell: Cell, result: T) -> Result<(), ExperimentError> {
        let text = self.line(cell, &result)?;
        OpenOptions::new()
            .create(true)
            .append(true)
            .open(&self.path)
            .and_then(|mut file| file.write_all(text.as_bytes()))
            .map_err(at(&self.path, "cannot be written"))?;
        self.of.insert(cell, result);
        Ok(())
    }

    fn sort(&self) -> Result<(), ExperimentError> {
        let lines = self
            .of
            .iter()
            .map(|(&cell, result)| self.line(cell, result));
        let text: String = lines.collect::<Result<_, _>>()?;
        // An interruption leaves either file whole.
        let beside = self.path.with_extension("sorted");
        fs::write(&beside, text)
            .and_then(|()| fs::rename(&beside, &self.path))
            .map_err(at(&self.path, "cannot be written"))
    }

    fn line(&self, cell: Cell, result: &T) -> Result<String, ExperimentError> {
        let text = serde_json::to_string(&Line { cell, result })
            .map_err(io::Error::from)
            .map_err(at(&self.path, "cannot be written"))?;
        Ok(text + "\n")
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
fn write_or_compare(path: &Path, settings: &ExperimentSettings) -> Result<(), ExperimentError> {
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
