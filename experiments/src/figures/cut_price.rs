//! What a price of cuts saves in links and costs in utility.

use super::{
    BROKEN_LINKS, Column, DISTANCE, Data, Family, Figure, Group, Kind, Row, UTILITY, averages,
    lattice, mixed, texts,
};
use crate::contender::Contender;
use crate::settings::ExperimentSettings;
use crate::table::Table;

pub(super) const CUT_PRICE: Figure = Figure {
    name: "cut_price",
    title: "The effect of the cut price",
    kinds: &[Kind::Plan],
    keys: "instances | cut_price",
    rows,
    files: &[(
        "cut_price",
        &[
            Column::Runs,
            Column::MeanAndDeviation("broken_links", BROKEN_LINKS),
            Column::MeanAndDeviation("utility", UTILITY),
            Column::MeanAndDeviation("distance_units", DISTANCE),
        ],
    )],
    tables: averages,
    results: |data| vec![("cut_price", results(data))],
};

/// Prices in units with the contender that has each. The last is above every distance, so that the number of cuts decides.
const PRICES: [(&str, Contender); 6] = [
    ("0", Contender::OursAtPrice(0)),
    ("0.5", Contender::OursAtPrice(5)),
    ("1", Contender::Ours),
    ("2", Contender::OursAtPrice(20)),
    ("3", Contender::OursAtPrice(30)),
    ("100", Contender::OursAtPrice(1_000)),
];

/// Mixed instances of the full size, and configurations of one size on lattice trees.
fn instances(settings: &ExperimentSettings) -> Vec<(String, Family, usize)> {
    let size = settings.full_size();
    let mut instances = vec![(format!("mixed, {size}"), mixed as Family, size)];
    let sizes = settings.equal_sizes().iter();
    instances.extend(sizes.map(|&size| (format!("all of {size}"), lattice as Family, size)));
    instances
}

fn rows(settings: &ExperimentSettings) -> Vec<Row> {
    let mut rows = Vec::new();
    for (name, family, size) in instances(settings) {
        rows.extend(PRICES.map(|(price, contender)| Row {
            keys: texts(&[&name, &price]),
            group: Group::of(settings, family, size, contender),
        }));
    }
    rows
}

fn results(data: &Data<'_>) -> Table {
    let heads = PRICES.map(|(price, _)| format!("price {price}"));
    let heads = format!("broken links, utility | {}", heads.join(" | "));
    Table::of(&heads, instances(data.settings), |(name, family, size)| {
        let mut row = vec![name];
        row.extend(PRICES.map(|(_, contender)| {
            let group = Group::of(data.settings, family, size, contender);
            let [links, utility] = [BROKEN_LINKS, UTILITY].map(|value| data.sample(&group, value));
            format!("{}, {}", links.short(), utility.short())
        }));
        row
    })
}

#[cfg(test)]
mod tests {
    use super::PRICES;

    #[test]
    fn every_contender_has_the_price_of_its_name() {
        for (name, contender) in PRICES {
            let price = f64::from(contender.parameters().cut_price);
            assert_eq!(price.to_string(), name);
        }
    }
}
