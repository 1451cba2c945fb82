//! `summary.md`: the template of this name, filled with the results.

use std::fmt::Write as _;

use crate::comparison::Comparison;
use crate::figures::{Data, Figure};
use crate::readings::Readings;
use crate::settings::Scale;

/// An introduction, then the sections, each under a heading of name, title and source in the paper.
const TEMPLATE: &str = include_str!("summary.md");

/// The summary of the finished figures, with the comparisons of ours and the paper policy.
pub(crate) fn write(
    data: &Data<'_>,
    figures: &[&Figure],
    comparison: Option<&Comparison>,
    readings: Option<&Readings>,
) -> String {
    let settings = data.settings;
    let scale = match settings.scale {
        Scale::Paper => "all sizes of the paper",
        Scale::Quick => "a choice of the paper's sizes (`--quick`)",
        Scale::Tiny => "a handful of modules, for tests",
    };
    let (introduction, sections) = TEMPLATE.split_once("\n## ").unwrap_or((TEMPLATE, ""));
    let mut summary = introduction
        .replace("{version}", &settings.version)
        .replace("{scale}", scale)
        .replace("{runs}", &settings.runs.to_string())
        .replace("{seed}", &settings.seed.to_string())
        .replace("{timings}", &settings.timings.to_string());
    for section in sections.split("\n## ") {
        let (heading, body) = section.split_once("\n\n").unwrap_or((section, ""));
        let mut heading = heading.split(" | ");
        let [name, title, source] = [(); 3].map(|()| heading.next().unwrap_or_default());
        let body = if name == "comparison" {
            let Some(comparison) = comparison else {
                continue;
            };
            body.replace("{ahead}", &comparison.ahead.to_string())
                .replace("{all}", &comparison.all.to_string())
                .replace("{results}", comparison.results.trim_end())
        } else if name == "readings" {
            let Some(readings) = readings else {
                continue;
            };
            body.replace("{results}", readings.results.trim_end())
        } else {
            let Some(figure) = figures.iter().find(|figure| figure.name == name) else {
                continue;
            };
            let results = (figure.results)(data).to_markdown();
            format!(
                "The paper: {source}. Data: [{name}.csv]({name}.csv)\n\n![{title}]({name}.svg)\n\n{}",
                body.replace("{results}", results.trim_end()),
            )
        };
        // Writing to a string cannot fail.
        let _ = write!(summary, "\n## {title}\n\n{body}");
    }
    summary
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::FIGURES;

    #[test]
    fn every_figure_has_its_section() {
        let names = TEMPLATE.split("\n## ").skip(1);
        let names: Vec<&str> = names
            .filter_map(|section| section.split(' ').next())
            .collect();
        assert_eq!(names[..2], ["readings", "comparison"]);
        assert_eq!(names[2..], FIGURES.each_ref().map(|figure| figure.name));
    }
}
