//! Figures 4(b), 5(a) and 8: planning time and distance against the number of modules, mixed or single.

use std::iter;

use super::{
    Column, DISTANCE as DISTANCE_UNITS, Data, FILLED_SPOTS, Figure, Kind, PLANNING_MS, UTILITY,
    Value, averages, mixed, rows, singletons, texts,
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
    title: "",
    kinds: &[Kind::Plan],
    keys: "modules | spots | contender",
    rows: |settings| {
        let keys = |size, contender| texts(&[&size, &size, &contender]);
        rows(settings, mixed, settings.sizes(), &WITH_SIZE_FIRST, keys)
    },
    files: &[],
    tables: averages,
    results: |_| Vec::new(),
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

const TIMES: &[Column] = &[
    Column::Runs,
    Column::MeanAndDeviation("planning_ms", PLANNING_MS),
];

pub(super) const PLANNING_TIME: Figure = Figure {
    name: "planning_time",
    title: "Planning time against the number of modules (Figure 4(b))",
    files: &[("planning_time", TIMES)],
    results: |data| vec![("planning_time", of_mixed(data, PLANNING_MS))],
    ..OF_MIXED
};

pub(super) const DISTANCE: Figure = Figure {
    name: "distance",
    title: "Distance travelled against the number of modules (Figure 5(a))",
    files: &[(
        "distance",
        &[
            Column::Runs,
            Column::MeanAndDeviation("distance_units", DISTANCE_UNITS),
            Column::Mean("filled_spots", FILLED_SPOTS),
            Column::Ratio("per_filled_spot", DISTANCE_UNITS, FILLED_SPOTS),
        ],
    )],
    results: |data| vec![("distance", of_mixed(data, DISTANCE_UNITS))],
    ..OF_MIXED
};

pub(super) const AUCTION_TIME: Figure = Figure {
    name: "auction_time",
    title: "Planning time of singletons, compared with the auction (Figure 8(a))",
    files: &[("auction_time", TIMES)],
    results: |data| vec![("auction_time", of_singletons(data, PLANNING_MS))],
    ..OF_SINGLETONS
};

pub(super) const AUCTION_DISTANCE: Figure = Figure {
    name: "auction_distance",
    title: "Distance travelled by singletons, compared with the auction (Figure 8(b))",
    files: &[(
        "auction_distance",
        &[
            Column::Runs,
            Column::MeanAndDeviation("distance_units", DISTANCE_UNITS),
            Column::Mean("filled_spots", FILLED_SPOTS),
            Column::Mean("utility", UTILITY),
        ],
    )],
    results: |data| vec![("auction_distance", of_singletons(data, DISTANCE_UNITS))],
    ..OF_SINGLETONS
};

fn of_mixed(data: &Data<'_>, value: Value) -> Table {
    let heads = "modules | literal | charitable | ours | ours, size first";
    Table::of(heads, data.settings.sizes(), |&size| {
        let means = data.samples(mixed, size, WITH_SIZE_FIRST, value);
        iter::once(size.to_string())
            .chain(means.map(Sample::short))
            .collect()
    })
}

fn of_singletons(data: &Data<'_>, value: Value) -> Table {
    let heads = "modules | literal | charitable | ours | auction | Hungarian";
    Table::of(heads, data.settings.sizes(), |&size| {
        let means = data.samples(singletons, size, SINGLE, value);
        iter::once(size.to_string())
            .chain(means.map(Sample::short))
            .collect()
    })
}
