//! All tables that follow from the results in a directory.

use std::collections::BTreeMap;
use std::path::Path;

use crate::comparison;
use crate::error::ExperimentError;
use crate::figures::{Data, FIGURES, Figure};
use crate::paper;
use crate::settings::ExperimentSettings;
use crate::store::{SETTINGS_FILE, Store, at};
use crate::summary;

/// The begin of a line of a page above a table; the name and [`MARK_END`] follow.
const MARK_BEGIN: &str = "<!-- table: ";
const MARK_END: &str = " -->";
/// The line below a table.
const END: &str = "<!-- end of table -->";

/// All tables that follow from results.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Publication {
    /// Whole files by name.
    pub files: BTreeMap<String, String>,
    /// Parts of a page in Markdown by name.
    pub blocks: BTreeMap<String, String>,
}

impl Publication {
    /// Reads `settings.json`, `cells.jsonl` and `times.jsonl` of a directory, and makes all tables of finished experiments.
    ///
    /// # Errors
    /// Fails if a file cannot be read.
    pub fn read(directory: &Path) -> Result<Self, ExperimentError> {
        let settings = read_settings(directory)?;
        Ok(Self::of(&settings, &Store::read(directory)?))
    }

    pub(crate) fn of(settings: &ExperimentSettings, store: &Store) -> Self {
        let mut publication = Self::default();
        let data = Data { settings, store };
        let is_finished = |figure: &&Figure| {
            let mut cells = figure.cells(settings).into_iter();
            cells.all(|cell| store.has(cell))
        };
        let mut sections = Vec::new();
        for figure in FIGURES.iter().filter(is_finished) {
            for (name, table) in (figure.tables)(figure, &data) {
                publication.add_file(name, table.to_csv());
            }
            let mut names = Vec::new();
            for (name, table) in (figure.results)(&data) {
                publication
                    .blocks
                    .insert(name.to_owned(), table.to_markdown());
                names.push(name);
            }
            sections.push((figure, names));
        }
        if let Some(comparison) = comparison::compare(&data) {
            for (name, table) in comparison.tables {
                publication.add_file(name, table.to_csv());
            }
            let blocks = comparison.blocks.into_iter();
            let blocks = blocks.map(|(name, text)| (name.to_owned(), text));
            publication.blocks.extend(blocks);
        }
        publication.add_file("paper", paper::CSV.to_owned());
        let summary = summary::write(&publication.blocks, &sections);
        publication.files.insert("summary.md".to_owned(), summary);
        publication
    }

    fn add_file(&mut self, name: &str, text: String) {
        self.files.insert(format!("{name}.csv"), text);
    }

    /// A page with the tables of these results between its marks.
    ///
    /// # Errors
    /// Fails if the page marks a table that there is not, twice, or without an end.
    pub fn fill(&self, page: &str) -> Result<String, ExperimentError> {
        let mut filled = String::new();
        let mut lines = page.lines();
        while let Some(line) = lines.next() {
            filled.push_str(line);
            filled.push('\n');
            let name = line.strip_prefix(MARK_BEGIN);
            let Some(name) = name.and_then(|name| name.strip_suffix(MARK_END)) else {
                continue;
            };
            let block = self.blocks.get(name).ok_or_else(|| {
                ExperimentError::BadInput(format!("no finished experiment has a table {name}"))
            })?;
            if !lines.by_ref().any(|line| line == END) {
                return Err(ExperimentError::BadInput(format!(
                    "the table {name} has no line `{END}`"
                )));
            }
            filled.push_str(&format!("\n{block}\n{END}\n"));
        }
        Ok(filled)
    }
}

/// The settings of a directory of results.
pub(crate) fn read_settings(directory: &Path) -> Result<ExperimentSettings, ExperimentError> {
    let path = directory.join(SETTINGS_FILE);
    let text = std::fs::read_to_string(&path).map_err(at(&path, "cannot be read"))?;
    serde_json::from_str(&text)
        .map_err(|error| ExperimentError::broken(&path, error.line(), &error))
}
