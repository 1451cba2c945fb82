//! Plans where modules outnumber spots.

use std::iter;

use super::{
    BROKEN_LINKS, Column, DISTANCE, Data, FILLED_SPOTS, Figure, Kind, UTILITY, averages, rows,
    surplus, texts,
};
use crate::contender::READINGS_AND_OURS;
use crate::sample::Sample;
use crate::table::Table;

pub(super) const FEWER_SPOTS: Figure = Figure {
    name: "distance_50_spots",
    title: "Distance travelled with 50 spots",
    kinds: &[Kind::Plan],
    keys: "modules | contender",
    rows: |settings| {
        let keys = |size, contender| texts(&[&size, &contender]);
        rows(
            settings,
            surplus,
            settings.surplus_sizes(),
            &READINGS_AND_OURS,
            keys,
        )
    },
    files: &[(
        "distance_50_spots",
        &[
            Column::Runs,
            Column::MeanAndDeviation("distance_units", DISTANCE),
            Column::MeanAndDeviation("utility", UTILITY),
            Column::MeanAndDeviation("broken_links", BROKEN_LINKS),
            Column::Mean("filled_spots", FILLED_SPOTS),
        ],
    )],
    tables: averages,
    results: |data| vec![("distance_50_spots", results(data))],
};

fn results(data: &Data<'_>) -> Table {
    let heads = "modules | literal: distance, broken links | charitable | ours";
    Table::of(heads, data.settings.surplus_sizes(), |&size| {
        let distances = data.samples(surplus, size, READINGS_AND_OURS, DISTANCE);
        let links = data.samples(surplus, size, READINGS_AND_OURS, BROKEN_LINKS);
        let pairs = distances.into_iter().zip(links);
        let texts = pairs.map(|(distance, links): (Sample, Sample)| {
            format!("{}, {}", distance.short(), links.short())
        });
        iter::once(size.to_string()).chain(texts).collect()
    })
}
