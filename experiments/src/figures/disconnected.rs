//! Table I: planning time and disconnected modules where all initial configurations have one size.

use super::{
    BROKEN_LINKS, Column, Data, Family, Figure, Kind, PLANNING_MS, Row, Value, averages, labelled,
    lattice, rows, texts,
};
use crate::contender::WITH_SIZE_FIRST;
use crate::paper;
use crate::sample::Sample;
use crate::settings::ExperimentSettings;
use crate::table::Table;

const UNMATCHED: Value = Value::Plan(|plan| plan.disconnected.unmatched_on_empty_target as f64);
const OUTSIDE: Value = Value::Plan(|plan| plan.disconnected.outside_largest_piece as f64);
const ALONE: Value = Value::Plan(|plan| plan.disconnected.alone as f64);

pub(super) const DISCONNECTED: Figure = Figure {
    name: "disconnected",
    title: "Planning time and disconnected modules, configurations of one size (Table I)",
    kinds: &[Kind::Plan],
    keys: "trees | size | contender",
    rows: all_rows,
    files: &[
        (
            "disconnected",
            &[
                Column::Runs,
                Column::MeanAndDeviation("unmatched_on_empty_target", UNMATCHED),
                Column::MeanAndDeviation("broken_links", BROKEN_LINKS),
                Column::MeanAndDeviation("outside_largest_piece", OUTSIDE),
                Column::MeanAndDeviation("alone", ALONE),
            ],
        ),
        (
            "disconnected_times",
            &[
                Column::Runs,
                Column::MeanAndDeviation("planning_ms", PLANNING_MS),
            ],
        ),
    ],
    tables: averages,
    results: |data| {
        vec![
            ("disconnected", counts(data)),
            ("disconnected_times", times(data)),
        ]
    },
};

/// The paper does not say how it draws trees; these two kinds bracket the possible ones.
const TREES: [(&str, Family); 2] = [
    ("lattice trees, degree 3", lattice),
    ("labelled trees, degree 4", labelled),
];

fn all_rows(settings: &ExperimentSettings) -> Vec<Row> {
    let of_trees = TREES.into_iter().map(|(trees, family)| {
        let keys = |size, contender| texts(&[&trees, &size, &contender]);
        rows(
            settings,
            family,
            settings.equal_sizes(),
            &WITH_SIZE_FIRST,
            keys,
        )
    });
    of_trees.flatten().collect()
}

fn counts(data: &Data<'_>) -> Table {
    let heads = "trees | size | unmatched on an empty target | broken links: literal/charitable/ours/size first | \
        outside the largest piece | left alone";
    let mut table = Table::new(heads);
    for (trees, family) in TREES {
        for &size in data.settings.equal_sizes() {
            let means = |value| {
                let samples = data.samples(family, size, WITH_SIZE_FIRST, value);
                samples.map(Sample::short)
            };
            let [unmatched, ..] = means(UNMATCHED);
            let mut row = texts(&[&short_name(trees), &size, &unmatched]);
            row.extend([BROKEN_LINKS, OUTSIDE, ALONE].map(|value| means(value).join("/")));
            table.row(row);
        }
    }
    table
}

/// The kind of trees without their degree.
fn short_name(trees: &str) -> &str {
    trees.split(' ').next().unwrap_or(trees)
}

fn times(data: &Data<'_>) -> Table {
    let heads = "trees | size | paper states, ms | literal, ms | charitable, ms | ours, ms | ours, size first, ms";
    let mut table = Table::new(heads);
    for (trees, family) in TREES {
        for &size in data.settings.equal_sizes() {
            let stated = paper::stated(DISCONNECTED.name, "planning_ms").into_iter();
            let mut stated = stated.filter(|stated| stated.at == size);
            let stated = stated
                .next()
                .map_or(String::new(), |stated| stated.value.to_string());
            let mut row = texts(&[&short_name(trees), &size, &stated]);
            let means = data.samples(family, size, WITH_SIZE_FIRST, PLANNING_MS);
            row.extend(means.map(Sample::short));
            table.row(row);
        }
    }
    table
}
