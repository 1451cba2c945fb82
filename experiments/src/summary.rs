//! `summary.md`: everything side by side.

use std::fmt::Write as _;

use crate::comparison::Comparison;
use crate::settings::{Scale, Settings};

/// One section of the summary.
pub(crate) struct Section {
    pub name: &'static str,
    pub title: &'static str,
    pub source: &'static str,
    pub text: String,
}

/// Puts the summary together.
pub(crate) fn write(
    settings: &Settings,
    sections: &[Section],
    comparison: Option<&Comparison>,
) -> String {
    let mut text = String::from("# The paper's evaluation, run again\n\n");
    let scale = match settings.scale {
        Scale::Paper => "all sizes of the paper",
        Scale::Quick => "a choice of the paper's sizes (`--quick`)",
        Scale::Tiny => "a handful of modules, for tests",
    };
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "Version {}; {scale}; {} runs of each cell, seeds from {}; each plan timed {} times, the least counts.\n\n\
         Settings of the paper's section \"Experimental Evaluation\": unit modules in 16 x 16 units, leaders and singletons \
         uniform in [0, 15] x [0, 15] with headings uniform in [0, pi], configurations of 2 to 10 modules and a random \
         number of singletons (\"mixed\"), trees of maximum degree 3, D_max = 3 and MAX = 20 for the paper policy. Not said \
         in the paper and chosen here: how trees are drawn (grown on the unit lattice), where the target lies (in the \
         middle), the weights (one unit of way 1, docking 0.1, undocking 0.05 per link end).\n\n\
         \"Paper\" is what the paper states in text or table. Numbers that it gives only as a figure are marked so; none \
         was read off a figure. \"Paper policy\" is its Algorithms 1 and 2 as literally as they can be run, on the same \
         instances as ours.\n",
        settings.version, settings.runs, settings.seed, settings.timings
    );
    if let Some(comparison) = comparison {
        let _ = writeln!(
            text,
            "## Ours against the paper policy\n\n{}",
            comparison.text
        );
    }
    for section in sections {
        let _ = writeln!(
            text,
            "## {}\n\nThe paper: {}. Data: [{name}.csv]({name}.csv)\n\n![{}]({name}.svg)\n\n{}",
            section.title,
            section.source,
            section.title,
            section.text.trim_end(),
            name = section.name,
        );
        text.push('\n');
    }
    text
}
