//! Table I: planning time and disconnected modules where all initial configurations have one size.

use super::{
    BROKEN_LINKS, Column, Data, Family, Figure, Group, Kind, PLANNING_MS, Row, Value, averages,
    labelled, lattice, rows, texts,
};
use crate::contender::WITH_SIZE_FIRST;
use crate::paper;
use crate::settings::Settings;
use crate::table::Table;

const UNMATCHED: Value = Value::Plan(|plan| plan.unmatched_on_empty_target as f64);
const OUTSIDE: Value = Value::Plan(|plan| plan.outside_largest_piece as f64);
const ALONE: Value = Value::Plan(|plan| plan.alone as f64);

pub(super) const DISCONNECTED: Figure = Figure {
    name: "disconnected",
    kinds: &[Kind::Plan],
    keys: "trees | size | contender",
    rows: all_rows,
    columns: &[
        Column::Runs,
        Column::MeanAndDeviation("planning_ms", PLANNING_MS),
        Column::MeanAndDeviation("unmatched_on_empty_target", UNMATCHED),
        Column::MeanAndDeviation("broken_links", BROKEN_LINKS),
        Column::MeanAndDeviation("outside_largest_piece", OUTSIDE),
        Column::MeanAndDeviation("alone", ALONE),
    ],
    tables: averages,
    results,
};

/// The paper does not say how it draws trees; these two kinds bracket the possible ones.
const TREES: [(&str, Family); 2] = [
    ("lattice trees, degree 3", lattice),
    ("labelled trees, degree 4", labelled),
];

fn all_rows(settings: &Settings) -> Vec<Row> {
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

fn results(data: &Data<'_>) -> Table {
    let mut summary = Table::new(
        "trees | size | contender | planning, ms | unmatched on an empty target | broken \
        links | outside the largest piece | left alone",
    );
    let stated = |quantity| paper::stated("disconnected", quantity).into_iter();
    for (time, count) in stated("planning_ms").zip(stated("disconnected")) {
        let time = format!("{} ± {}", time.value, time.deviation);
        let shown = format!(
            "{} ± {} (one count; which is not said)",
            count.value, count.deviation
        );
        let trees = "(not said)";
        summary.row(texts(&[
            &trees,
            &count.at,
            &"**paper, states**",
            &time,
            &shown,
            &"",
            &"",
            &"",
        ]));
    }
    for (trees, family) in TREES {
        for &size in data.settings.equal_sizes() {
            for contender in WITH_SIZE_FIRST {
                let group = Group::of(data.settings, family, size, contender);
                let numbers = [PLANNING_MS, UNMATCHED, BROKEN_LINKS, OUTSIDE, ALONE]
                    .map(|value| data.sample(&group, value).with_deviation());
                let mut row = texts(&[&trees, &size, &contender.label()]);
                row.extend(numbers);
                summary.row(row);
            }
        }
    }
    summary
}
