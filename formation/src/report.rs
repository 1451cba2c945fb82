//! The directory of `--report`: pictures before and after, a page that plays what happened, and the numbers as JSON.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use formation_event_log::Entry;
use formation_report::{Subject, Summary, after, before, page};
use ros_runtime::exit::Failure;
use serde::Serialize;

const BEFORE: &str = "before.svg";
const AFTER: &str = "after.svg";
const PAGE: &str = "report.html";
/// The object that `--json` prints.
const OBJECT: &str = "report.json";

/// The directory into which a report is written.
pub struct ReportDirectory {
    path: PathBuf,
}

impl ReportDirectory {
    /// Creates the directory where it does not exist, and deletes what an earlier report left in it: a run that ends early does
    /// not write all of its own.
    ///
    /// # Errors
    /// The directory cannot be created, or a file in it not be deleted.
    pub fn create(path: &Path) -> Result<Self, Failure> {
        fs::create_dir_all(path)
            .with_context(|| format!("{}: cannot be created", path.display()))
            .map_err(Failure::BadInput)?;
        for name in [BEFORE, AFTER, PAGE, OBJECT] {
            let earlier = path.join(name);
            match fs::remove_file(&earlier) {
                Err(error) if error.kind() != ErrorKind::NotFound => {
                    let what = format!("{}: cannot be replaced", earlier.display());
                    return Err(Failure::BadInput(anyhow!(error).context(what)));
                }
                _ => {}
            }
        }
        Ok(Self {
            path: path.to_owned(),
        })
    }

    /// Writes the object that `--json` prints.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn write_json(&self, report: &impl Serialize) -> Result<(), Failure> {
        let json = serde_json::to_string(report)
            .map_err(|error| Failure::Failed(anyhow!(error).context("cannot write the report")))?;
        self.write(OBJECT, &format!("{json}\n"))
    }

    /// Writes the pictures and the page.
    ///
    /// # Errors
    /// Names the file that cannot be written.
    pub fn write_pictures(
        &self,
        subject: &Subject,
        course: &[Entry],
        summary: &Summary,
    ) -> Result<(), Failure> {
        self.write(BEFORE, &before(subject))?;
        self.write(AFTER, &after(subject))?;
        self.write(PAGE, &page(subject, course, summary))
    }

    fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        let path = self.path.join(name);
        fs::write(&path, text)
            .with_context(|| format!("{}: cannot be written", path.display()))
            .map_err(Failure::Failed)
    }
}
