//! Figure 10: eight case studies.

use super::{
    BROKEN_LINKS, Column, DISTANCE, Data, FILLED_SPOTS, Figure, Group, Kind, PLANNING_MS, Row,
    UTILITY, Value, averages, texts,
};
use crate::case_studies::CASES;
use crate::contender::{Contender, READINGS_AND_OURS};
use crate::instance::Instance;
use crate::paper;
use crate::sample::short;
use crate::settings::Settings;
use crate::table::Table;

const MODULES: Value = Value::Plan(|plan| (plan.receivers + 1) as f64);
const PORT_CHANGES: Value = Value::Plan(|plan| plan.port_changes as f64);
const HOLES: Value = Value::Plan(|plan| (plan.fillable_spots - plan.filled_spots) as f64);

pub(super) const CASE_STUDIES: Figure = Figure {
    name: "case_studies",
    kinds: &[Kind::Plan],
    keys: "case | name | contender",
    rows,
    columns: &[
        Column::Single("modules", MODULES),
        Column::Single("filled_spots", FILLED_SPOTS),
        Column::Single("planning_ms", PLANNING_MS),
        Column::Single("broken_links", BROKEN_LINKS),
        Column::Single(
            "initial_links",
            Value::Plan(|plan| plan.initial_links as f64),
        ),
        Column::Single("port_changes", PORT_CHANGES),
        Column::Single("distance_units", DISTANCE),
        Column::Single("utility", UTILITY),
    ],
    tables: averages,
    results,
};

fn group(number: usize, contender: Contender) -> Group {
    Group::new(contender, vec![Instance::CaseStudy(number)])
}

fn rows(_: &Settings) -> Vec<Row> {
    let mut rows = Vec::new();
    for (number, case) in (1..).zip(&CASES) {
        rows.extend(READINGS_AND_OURS.map(|contender| Row {
            keys: texts(&[&number, &case.name, &contender.key()]),
            group: group(number, contender),
        }));
    }
    rows
}

fn results(data: &Data<'_>) -> Table {
    let heads = "case | formed | modules | paper's own case: ms, disconnections | paper policy: ms, \
        broken links, port changes | charitable: ms, broken links, port changes | ours: ms, broken links, port changes";
    let stated = |quantity| paper::stated("case_studies", quantity).into_iter();
    let stated = stated("planning_ms").zip(stated("disconnections"));
    let cases = (1..).zip(&CASES).zip(stated);
    Table::of(heads, cases, |((number, case), (time, count))| {
        let modules = data.sample(&group(number, Contender::Ours), MODULES).mean;
        let mut row = texts(&[
            &number,
            &case.name,
            &modules,
            &format!("{}, {}", time.value, count.value),
        ]);
        row.extend(READINGS_AND_OURS.map(|contender| {
            let mean = |value| data.sample(&group(number, contender), value).mean;
            let holes = match mean(HOLES) {
                none if none < 0.5 => String::new(),
                holes => format!(" ({holes} spots empty)"),
            };
            let time = short(mean(PLANNING_MS));
            format!(
                "{time}, {}, {}{holes}",
                mean(BROKEN_LINKS),
                mean(PORT_CHANGES)
            )
        }));
        row
    })
}
