//! Figures 4(b), 5(a) and 8: planning time and distance against the number of modules, mixed or single.

use super::{
    Column, DISTANCE as DISTANCE_UNITS, Data, FIGURE_ONLY, FILLED_SPOTS, Figure, Kind, PLANNING_MS,
    UTILITY, Value, averages, mixed, rows, singletons, texts,
};
use crate::contender::{Contender, WITH_SIZE_FIRST};
use crate::sample::Sample;
use crate::table::Table;

const SINGLE: [Contender; 5] = [
    Contender::PaperPolicy,
    Contender::PaperCharitable,
    Contender::Ours,
    Contender::Auction,
    Contender::Hungarian,
];

/// The common part of the figures on mixed instances.
const OF_MIXED: Figure = Figure {
    name: "",
    kinds: &[Kind::Plan],
    keys: "modules | spots | contender",
    rows: |settings| {
        let keys = |size, contender| texts(&[&size, &size, &contender]);
        rows(settings, mixed, settings.sizes(), &WITH_SIZE_FIRST, keys)
    },
    columns: &[],
    tables: averages,
    results: |_| Table::new(""),
};

/// The common part of the figures on singletons.
const OF_SINGLETONS: Figure = Figure {
    keys: "modules | contender",
    rows: |settings| {
        let keys = |size, contender| texts(&[&size, &contender]);
        rows(settings, singletons, settings.sizes(), &SINGLE, keys)
    },
    ..OF_MIXED
};

pub(super) const PLANNING_TIME: Figure = Figure {
    name: "planning_time",
    columns: &columns_of_mixed("planning_ms", PLANNING_MS),
    results: |data| of_mixed(data, PLANNING_MS),
    ..OF_MIXED
};

pub(super) const DISTANCE: Figure = Figure {
    name: "distance",
    columns: &columns_of_mixed("distance_units", DISTANCE_UNITS),
    results: |data| of_mixed(data, DISTANCE_UNITS),
    ..OF_MIXED
};

pub(super) const AUCTION_TIME: Figure = Figure {
    name: "auction_time",
    columns: &columns_of_singletons("planning_ms", PLANNING_MS),
    results: |data| of_singletons(data, PLANNING_MS),
    ..OF_SINGLETONS
};

pub(super) const AUCTION_DISTANCE: Figure = Figure {
    name: "auction_distance",
    columns: &columns_of_singletons("distance_units", DISTANCE_UNITS),
    results: |data| of_singletons(data, DISTANCE_UNITS),
    ..OF_SINGLETONS
};

const fn columns_of_mixed(name: &'static str, value: Value) -> [Column; 4] {
    [
        Column::Runs,
        Column::MeanAndDeviation(name, value),
        Column::Mean("filled_spots", FILLED_SPOTS),
        Column::Ratio("per_filled_spot", value, FILLED_SPOTS),
    ]
}

const fn columns_of_singletons(name: &'static str, value: Value) -> [Column; 4] {
    [
        Column::Runs,
        Column::MeanAndDeviation(name, value),
        Column::Mean("filled_spots", FILLED_SPOTS),
        Column::Mean("utility", UTILITY),
    ]
}

fn of_mixed(data: &Data<'_>, value: Value) -> Table {
    let heads = "modules | paper | paper policy | paper policy, charitable | ours | ours, size first | a filled spot: paper \
        policy / ours";
    Table::of(heads, data.settings.sizes(), |&size| {
        let [paper, charitable, ours, size_first] =
            data.samples(mixed, size, WITH_SIZE_FIRST, value);
        let [of_paper, _, of_ours, _] = data.samples(mixed, size, WITH_SIZE_FIRST, FILLED_SPOTS);
        vec![
            size.to_string(),
            FIGURE_ONLY.to_owned(),
            paper.with_deviation(),
            charitable.with_deviation(),
            ours.with_deviation(),
            size_first.with_deviation(),
            format!(
                "{:.3} / {:.3}",
                paper.mean / of_paper.mean,
                ours.mean / of_ours.mean
            ),
        ]
    })
}

fn of_singletons(data: &Data<'_>, value: Value) -> Table {
    let heads = "modules | paper | paper policy (spots filled) | paper policy, charitable | ours | auction | Hungarian";
    Table::of(heads, data.settings.sizes(), |&size| {
        let [filled, ..] = data.samples(singletons, size, SINGLE, FILLED_SPOTS);
        let mut row = texts(&[&size, &FIGURE_ONLY]);
        row.extend(
            data.samples(singletons, size, SINGLE, value)
                .map(Sample::with_deviation),
        );
        row[2].push_str(&format!(" ({})", filled.short()));
        row
    })
}
