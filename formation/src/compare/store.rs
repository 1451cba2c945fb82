//! The results on disk: a line for each row and one for its time, in the order of rows, so that an interrupted comparison goes on
//! from there.

use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use ros_runtime::exit::Failure;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::contender::{ComparedPolicy, Decides};
use super::instance::ComparedInstance;
use super::row::{Measures, Row, Time};
use super::summary;
use crate::arguments::CompareArguments;

/// What determines the rows.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompareSettings {
    version: String,
    policies: Vec<String>,
    programs: Vec<String>,
    program_timeout_s: f64,
    instances: Vec<String>,
    /// The digests of scenario files, in their order.
    digests: Vec<Option<u64>>,
    motion: bool,
}

impl CompareSettings {
    pub fn of(
        arguments: &CompareArguments,
        contenders: &[ComparedPolicy],
        instances: &[ComparedInstance],
    ) -> Self {
        let programs = contenders.iter().filter_map(|one| match &one.decides {
            Decides::Policy(_) => None,
            Decides::Program(command, _) => Some(command.clone()),
        });
        let files = instances.iter().filter(|one| one.seed().is_none());
        Self {
            version: formation_version::VERSION.to_owned(),
            policies: contenders.iter().map(|one| one.label.clone()).collect(),
            programs: programs.collect(),
            program_timeout_s: arguments.program_timeout.as_secs_f64(),
            instances: instances.iter().map(ComparedInstance::label).collect(),
            digests: files.map(|file| Some(file.digest()?.0)).collect(),
            motion: arguments.motion,
        }
    }
}

/// The rows of a directory.
pub struct Store {
    directory: PathBuf,
    rows: Vec<Row>,
    times: Vec<Time>,
    /// Locked while this process writes here.
    _lock: File,
}

const ROWS: &str = "rows.jsonl";
const TIMES: &str = "times.jsonl";

impl Store {
    /// Opens a directory, or creates it.
    ///
    /// # Errors
    /// It cannot be read or written, or holds a comparison with other settings.
    pub fn open(directory: &Path, settings: &CompareSettings) -> Result<Self, Failure> {
        fs::create_dir_all(directory)
            .with_context(|| format!("{}: cannot be created", directory.display()))
            .map_err(Failure::BadInput)?;
        let path = directory.join("settings.json");
        write_or_compare(&path, settings)?;
        let lock = File::open(&path).map_err(|error| unwritten(&path, error))?;
        if lock.try_lock().is_err() {
            let path = directory.display();
            return Err(Failure::bad_input(format_args!(
                "{path}: another comparison writes there; wait for its end, or choose another directory"
            )));
        }
        let mut rows: Vec<Row> = read_lines(&directory.join(ROWS))?;
        let mut times: Vec<Time> = read_lines(&directory.join(TIMES))?;
        // An interruption between the two leaves one line more in one of them.
        let whole = rows.len().min(times.len());
        rows.truncate(whole);
        times.truncate(whole);
        let store = Self {
            directory: directory.to_owned(),
            rows,
            times,
            _lock: lock,
        };
        store.write(ROWS, &lines_of(&store.rows)?)?;
        store.write(TIMES, &lines_of(&store.times)?)?;
        Ok(store)
    }

    /// All rows so far.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Checks that rows from this position are those of an instance.
    ///
    /// # Errors
    /// Names the line that is of another.
    pub fn check_order(
        &self,
        first: usize,
        instance: &ComparedInstance,
        contenders: &[ComparedPolicy],
    ) -> Result<(), Failure> {
        let label = instance.label();
        for (number, (row, contender)) in (first..).zip(self.rows[first..].iter().zip(contenders)) {
            if row.instance != label || row.policy != contender.label {
                let path = self.directory.join(ROWS);
                return Err(Failure::bad_input(format_args!(
                    "{}: line {} is not the row of {label} and {}; choose another directory",
                    path.display(),
                    number + 1,
                    contender.label
                )));
            }
        }
        Ok(())
    }

    /// Keeps a row.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn append(&mut self, (row, time): (Row, Time)) -> Result<(), Failure> {
        self.add(ROWS, &lines_of(std::slice::from_ref(&row))?)?;
        self.add(TIMES, &lines_of(std::slice::from_ref(&time))?)?;
        self.rows.push(row);
        self.times.push(time);
        Ok(())
    }

    /// Writes the tables and summaries of all rows.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn publish(&self, contenders: &[ComparedPolicy]) -> Result<(), Failure> {
        let labels: Vec<&str> = contenders.iter().map(|one| one.label.as_str()).collect();
        self.write("rows.csv", &rows_csv(&self.rows))?;
        self.write("times.csv", &times_csv(&self.times))?;
        self.write("summary.md", &summary::of_rows(&self.rows, &labels))?;
        let times = summary::of_times(&self.rows, &self.times, &labels);
        self.write("times.md", &times)
    }

    fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        let path = self.directory.join(name);
        fs::write(&path, text).map_err(|error| unwritten(&path, error))
    }

    fn add(&self, name: &str, text: &str) -> Result<(), Failure> {
        let path = self.directory.join(name);
        OpenOptions::new()
            .append(true)
            .create(true)
            .open(&path)
            .and_then(|mut file| file.write_all(text.as_bytes()))
            .map_err(|error| unwritten(&path, error))
    }
}

fn unwritten(path: &Path, error: impl Into<anyhow::Error>) -> Failure {
    let what = format!("{}: cannot be written", path.display());
    Failure::Failed(error.into().context(what))
}

fn lines_of<T: Serialize>(entries: &[T]) -> Result<String, Failure> {
    let mut text = String::new();
    for entry in entries {
        let line = serde_json::to_string(entry)
            .map_err(|error| Failure::Failed(anyhow!(error).context("a row cannot be written")))?;
        text.push_str(&line);
        text.push('\n');
    }
    Ok(text)
}

/// The lines of a file; none if there is no such file. An interruption can leave a last line without an end, which does not count.
fn read_lines<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, Failure> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
        Err(error) => {
            let what = format!("{}: cannot be read", path.display());
            return Err(Failure::BadInput(anyhow!(error).context(what)));
        }
    };
    let whole = text.rfind('\n').map_or(0, |end| end + 1);
    let lines = (1..).zip(text[..whole].lines());
    lines
        .map(|(number, line)| {
            serde_json::from_str(line).map_err(|error| {
                let path = path.display();
                Failure::bad_input(format_args!("{path}: line {number}: {error}"))
            })
        })
        .collect()
}

/// Writes the settings, or compares them with those that the directory has.
fn write_or_compare(path: &Path, settings: &CompareSettings) -> Result<(), Failure> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => {
            let text =
                serde_json::to_string_pretty(settings).map_err(|error| unwritten(path, error))?;
            return fs::write(path, text + "\n").map_err(|error| unwritten(path, error));
        }
        Err(error) => {
            let what = format!("{}: cannot be read", path.display());
            return Err(Failure::BadInput(anyhow!(error).context(what)));
        }
    };
    match serde_json::from_str::<CompareSettings>(&text) {
        Ok(known) if known == *settings => Ok(()),
        _ => Err(Failure::bad_input(format_args!(
            "{}: the results there are of another comparison, with other policies, instances, options or another version; \
             choose another directory",
            path.display()
        ))),
    }
}

/// A field of a CSV file; in quotes where it needs them.
fn csv(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    }
}

fn or_empty<T: ToString>(value: Option<T>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

fn rows_csv(rows: &[Row]) -> String {
    let mut text = "instance,kind,modules,spots,seed,policy,outcome,reason".to_owned();
    for (name, _) in summary::MEASURES {
        text.push_str(&format!(",{name}"));
    }
    text.push('\n');
    for row in rows {
        let fields = [
            csv(&row.instance),
            csv(&row.kind),
            or_empty(row.modules),
            or_empty(row.spots),
            or_empty(row.seed),
            csv(&row.policy),
            row.outcome.name().to_owned(),
            csv(row.reason.as_deref().unwrap_or_default()),
        ];
        text.push_str(&fields.join(","));
        for (_, measure) in summary::MEASURES {
            let value = row
                .measures
                .as_ref()
                .and_then(|measures: &Measures| measure(measures));
            text.push_str(&format!(",{}", or_empty(value)));
        }
        text.push('\n');
    }
    text
}

fn times_csv(times: &[Time]) -> String {
    let mut text = "instance,policy,planning_us\n".to_owned();
    for time in times {
        let (instance, policy) = (csv(&time.instance), csv(&time.policy));
        let planning_us = or_empty(time.planning_us);
        text.push_str(&format!("{instance},{policy},{planning_us}\n"));
    }
    text
}
