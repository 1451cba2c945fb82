//! Figure 4(a): the time to find the maximum common subtree, or the isomorphic subtree, of one configuration.

use super::{
    Column, Data, FIGURE_ONLY, Figure, Group, Kind, Value, averages, generated, rows, texts,
};
use crate::contender::Contender;
use crate::instance::{Docked, Instance};
use crate::sample::short;
use crate::settings::Settings;
use crate::table::Table;

const OURS_MS: Value = Value::Matching(|found| found.ours_us / 1e3);
const PAPER_MS: Value = Value::Matching(|found| found.paper_us / 1e3);
const OURS_UTILITY: Value = Value::Matching(|found| found.ours_utility);
const PAPER_UTILITY: Value = Value::Matching(|found| found.paper_utility);

pub(super) const TIME: Figure = Figure {
    name: "matching_time",
    kinds: &[Kind::Matching],
    keys: "configuration_size | spots",
    rows: |settings| {
        let sizes = settings.configuration_sizes();
        let keys = |size, _| texts(&[&size, &settings.full_size()]);
        rows(settings, alone, sizes, &[Contender::Ours], keys)
    },
    columns: &[
        Column::Runs,
        Column::MeanAndDeviation("ours_ms", OURS_MS),
        Column::MeanAndDeviation("paper_policy_ms", PAPER_MS),
        Column::Mean(
            "matched_modules",
            Value::Matching(|found| found.ours_size as f64),
        ),
        Column::Mean(
            "candidates",
            Value::Matching(|found| found.candidates as f64),
        ),
        Column::Mean("ours_utility", OURS_UTILITY),
        Column::Mean("paper_policy_utility", PAPER_UTILITY),
    ],
    tables: averages,
    results,
};

/// One configuration and a target of the full size.
fn alone(settings: &Settings, size: usize, seed: u64) -> Instance {
    generated(size, settings.full_size(), Docked::Lattice(size), seed)
}

fn results(data: &Data<'_>) -> Table {
    let heads = "modules | paper | paper policy, ms | ours, ms | times faster | utility, best of the \
        paper policy's 20 | utility, ours";
    let (mut equal, mut searches) = (0.0, 0);
    let table = Table::of(heads, data.settings.configuration_sizes(), |&size| {
        let group = Group::of(data.settings, alone, size, Contender::Ours);
        let is_equal = Value::Matching(|found| f64::from(found.ours_size == found.paper_size));
        let is_equal = data.values(&group, is_equal);
        searches += is_equal.len();
        equal += is_equal.iter().sum::<f64>();
        let [paper, ours, paper_utility, ours_utility] =
            [PAPER_MS, OURS_MS, PAPER_UTILITY, OURS_UTILITY]
                .map(|value| data.sample(&group, value));
        vec![
            size.to_string(),
            FIGURE_ONLY.to_owned(),
            paper.short(),
            ours.short(),
            short(paper.mean / ours.mean),
            paper_utility.short(),
            ours_utility.short(),
        ]
    });
    table.with_note(format!(
        "Utilities are those of the matched modules alone. Both searches found parts of the same size in {equal} of \
         {searches} instances."
    ))
}
