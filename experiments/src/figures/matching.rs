//! Figure 4(a): the time to find the maximum common subtree, or the isomorphic subtree, of one configuration.

use super::{Column, Data, Figure, Group, Kind, Value, averages, generated, rows, texts};
use crate::contender::Contender;
use crate::instance::{Docked, Instance};
use crate::sample::short;
use crate::settings::ExperimentSettings;
use crate::table::Table;

const OURS_MS: Value = Value::MatchingTime(|found| found.ours_us / 1e3);
const PAPER_MS: Value = Value::MatchingTime(|found| found.paper_us / 1e3);
const OURS_UTILITY: Value = Value::Matching(|found| found.ours_utility);
const PAPER_UTILITY: Value = Value::Matching(|found| found.paper_utility);

pub(super) const TIME: Figure = Figure {
    name: "matching_time",
    title: "Time to find where one configuration fits into a target of 100 spots (Figure 4(a))",
    kinds: &[Kind::Matching],
    keys: "configuration_size | spots",
    rows: |settings| {
        let sizes = settings.configuration_sizes();
        let keys = |size, _| texts(&[&size, &settings.full_size()]);
        rows(settings, alone, sizes, &[Contender::Ours], keys)
    },
    files: &[
        (
            "matching_time",
            &[
                Column::Runs,
                Column::MeanAndDeviation("ours_ms", OURS_MS),
                Column::MeanAndDeviation("paper_policy_ms", PAPER_MS),
            ],
        ),
        (
            "matching",
            &[
                Column::Runs,
                Column::Mean("ours_size", Value::Matching(|found| found.ours_size as f64)),
                Column::Mean(
                    "paper_policy_size",
                    Value::Matching(|found| found.paper_size as f64),
                ),
                Column::Mean(
                    "candidates",
                    Value::Matching(|found| found.candidates as f64),
                ),
                Column::Mean("ours_utility", OURS_UTILITY),
                Column::Mean("paper_policy_utility", PAPER_UTILITY),
            ],
        ),
    ],
    tables: averages,
    results: |data| vec![("matching_time", times(data))],
};

/// One configuration and a target of the full size.
fn alone(settings: &ExperimentSettings, size: usize, seed: u64) -> Instance {
    generated(size, settings.full_size(), Docked::Lattice(size), seed)
}

fn times(data: &Data<'_>) -> Table {
    let heads = "modules | literal, ms | ours, ms | times as fast";
    Table::of(heads, data.settings.configuration_sizes(), |&size| {
        let group = Group::of(data.settings, alone, size, Contender::Ours);
        let [paper, ours] = [PAPER_MS, OURS_MS].map(|value| data.sample(&group, value).mean);
        vec![
            size.to_string(),
            short(paper),
            short(ours),
            short(paper / ours),
        ]
    })
}
