//! `summary.md`: all tables of the finished figures below their plots.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::figures::Figure;

/// The tables of the page that a comparison of all figures makes, in their order.
pub(crate) const COMPARED: [&str; 6] = [
    "headline",
    "standing",
    "standing_times",
    "losses",
    "losses_times",
    "at_full_size",
];

/// The summary of the finished figures.
pub(crate) fn write(
    tables: &BTreeMap<String, String>,
    figures: &[(&Figure, Vec<&'static str>)],
) -> String {
    let mut summary = "# The paper's evaluation, repeated\n".to_owned();
    let mut section = |title: &str, plot: Option<&str>, names: &[&str]| {
        let blocks: Vec<&String> = names.iter().filter_map(|&name| tables.get(name)).collect();
        if blocks.is_empty() {
            return;
        }
        // Writing to a string cannot fail.
        let _ = write!(summary, "\n## {title}\n");
        if let Some(name) = plot {
            let _ = write!(summary, "\n![{title}]({name}.svg)\n");
        }
        for block in blocks {
            let _ = write!(summary, "\n{block}");
        }
    };
    section("Ours against both readings of the paper", None, &COMPARED);
    for (figure, names) in figures {
        section(figure.title, Some(figure.name), names);
    }
    summary
}
