//! Figure 10: eight case studies.

use super::{
    BROKEN_LINKS, Column, DISTANCE, Data, FILLED_SPOTS, Figure, Group, Kind, PLANNING_MS, Row,
    UTILITY, Value, averages, texts,
};
use crate::case_studies::{CASES, Case};
use crate::contender::{Contender, READINGS_AND_OURS};
use crate::instance::Instance;
use crate::paper;
use crate::sample::short;
use crate::settings::ExperimentSettings;
use crate::table::Table;

const PORT_CHANGES: Value = Value::Plan(|plan| plan.links.port_changes as f64);
const OPEN_SPOTS: Value = Value::Plan(|plan| (plan.fillable_spots() - plan.filled_spots) as f64);

pub(super) const CASE_STUDIES: Figure = Figure {
    name: "case_studies",
    title: "Eight case studies (Figure 10)",
    kinds: &[Kind::Plan],
    keys: "case | name | contender",
    rows,
    files: &[
        (
            "case_studies",
            &[
                Column::Single("modules", Value::Plan(|plan| plan.modules as f64)),
                Column::Single("filled_spots", FILLED_SPOTS),
                Column::Single("broken_links", BROKEN_LINKS),
                Column::Single(
                    "initial_links",
                    Value::Plan(|plan| plan.links.initial as f64),
                ),
                Column::Single("port_changes", PORT_CHANGES),
                Column::Single("distance_units", DISTANCE),
                Column::Single("utility", UTILITY),
            ],
        ),
        (
            "case_studies_times",
            &[Column::Single("planning_ms", PLANNING_MS)],
        ),
    ],
    tables: averages,
    results: |data| {
        vec![
            ("case_studies", counts(data)),
            ("case_studies_times", times(data)),
        ]
    },
};

fn group(number: usize, contender: Contender) -> Group {
    Group::new(contender, vec![Instance::CaseStudy(number)])
}

fn rows(_: &ExperimentSettings) -> Vec<Row> {
    let mut rows = Vec::new();
    for (number, case) in (1..).zip(&CASES) {
        rows.extend(READINGS_AND_OURS.map(|contender| Row {
            keys: texts(&[&number, &case.name, &contender.key()]),
            group: group(number, contender),
        }));
    }
    rows
}

/// The cases with their numbers and what the paper states of its own case of that number.
fn cases(quantity: &str) -> impl Iterator<Item = (usize, &'static Case, f64)> {
    let stated = paper::stated(CASE_STUDIES.name, quantity);
    let cases = (1..).zip(&CASES).zip(stated);
    cases.map(|((number, case), stated)| (number, case, stated.value))
}

fn counts(data: &Data<'_>) -> Table {
    let heads = "case | formed | paper's own case: disconnections | literal: broken links, port changes, distance | \
        charitable | ours";
    Table::of(heads, cases("disconnections"), |(number, case, stated)| {
        let mut row = texts(&[&number, &case.name, &stated]);
        row.extend(READINGS_AND_OURS.map(|contender| {
            let mean = |value| data.sample(&group(number, contender), value).mean;
            let open = match mean(OPEN_SPOTS) {
                none if none < 0.5 => String::new(),
                open => format!(" ({open} spots open)"),
            };
            let (broken, ports) = (mean(BROKEN_LINKS), mean(PORT_CHANGES));
            format!("{broken}, {ports}, {}{open}", short(mean(DISTANCE)))
        }));
        row
    })
}

fn times(data: &Data<'_>) -> Table {
    let heads = "case | paper's own case, ms | literal, ms | charitable, ms | ours, ms";
    Table::of(heads, cases("planning_ms"), |(number, _, stated)| {
        let mut row = texts(&[&number, &stated]);
        row.extend(
            READINGS_AND_OURS
                .map(|contender| data.sample(&group(number, contender), PLANNING_MS).short()),
        );
        row
    })
}
