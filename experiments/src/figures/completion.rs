//! Figures 6(a), 7(a) and 9(b): the part of the spots that is selected after each part of the planning time.

use super::{
    Column, Data, Family, Figure, Group, Kind, Row, Value, averages, mixed, rows, singletons,
    surplus, texts,
};
use crate::contender::{Contender, PAPER_AND_OURS, WITH_AUCTION};
use crate::measure::plan::PlanMeasurement;
use crate::paper;
use crate::settings::Settings;
use crate::table::Table;

const SELECTED: Value =
    Value::TalkCurve(|talk, percent| talk.counted_after(percent, |moment| moment.selected));
const SETTLED: Value =
    Value::TalkCurve(|talk, percent| talk.counted_after(percent, |moment| moment.settled));
const COMPUTED: Value = Value::PlanCurve(PlanMeasurement::selected_after);

pub(super) const COMPLETION: Figure = Figure {
    name: "completion",
    kinds: &[Kind::Talk, Kind::Plan],
    keys: "contender | modules",
    rows: |settings| curves(settings, mixed, settings.sizes()),
    columns: &[
        Column::Runs,
        Column::Percent,
        Column::MeanAndDeviation("selected_percent", SELECTED),
        Column::Mean("settled_percent", SETTLED),
        Column::Mean("selected_percent_by_computing_time", COMPUTED),
    ],
    tables: averages,
    results: |data| results(data, mixed, data.settings.sizes(), COMPLETION.name),
};

pub(super) const FEW_SPOTS: Figure = Figure {
    name: "completion_50_spots",
    rows: |settings| curves(settings, surplus, settings.surplus_sizes()),
    results: |data| {
        let sizes = data.settings.surplus_sizes();
        results(data, surplus, sizes, FEW_SPOTS.name)
    },
    ..COMPLETION
};

pub(super) const AUCTION: Figure = Figure {
    name: "auction_completion",
    kinds: &[Kind::Talk],
    keys: "contender | seed",
    rows: auction_rows,
    columns: &[
        Column::Percent,
        Column::Single("holding_percent", SELECTED),
        Column::Single("settled_percent", SETTLED),
    ],
    tables: averages,
    results: auction_results,
};

/// A row for each part of the time at which curves are read.
fn curve(row: &Row) -> impl Iterator<Item = Row> {
    (0..=100).step_by(5).map(|percent| Row {
        keys: row.keys.clone(),
        group: row.group.at(f64::from(percent)),
    })
}

fn curves(settings: &Settings, family: Family, sizes: &[usize]) -> Vec<Row> {
    let of_contender = |contender| {
        let keys = |size, contender| texts(&[&contender, &size]);
        rows(settings, family, sizes, &[contender], keys)
    };
    let rows: Vec<Row> = [Contender::Ours, Contender::PaperPolicy]
        .into_iter()
        .flat_map(of_contender)
        .collect();
    rows.iter().flat_map(curve).collect()
}

fn results(data: &Data<'_>, family: Family, sizes: &[usize], name: &str) -> Table {
    let heads = "modules | of the time | paper, completed | paper policy, protocol | ours, protocol | \
        paper policy, computing | ours, computing";
    let stated = paper::stated(name, "selected_percent").into_iter();
    let stated = stated.filter(|stated| sizes.contains(&stated.at));
    Table::of(heads, stated, |stated| {
        let (size, time, done) = (stated.at, stated.time_percent, stated.value);
        let mut row = vec![size.to_string(), format!("{time} %"), format!("{done} %")];
        for value in [SELECTED, COMPUTED] {
            row.extend(PAPER_AND_OURS.map(|contender| {
                let group = Group::of(data.settings, family, size, contender).at(time);
                format!("{} %", data.sample(&group, value).with_deviation())
            }));
        }
        row
    })
}

fn auction_rows(settings: &Settings) -> Vec<Row> {
    let mut rows = Vec::new();
    for contender in WITH_AUCTION {
        for seed in settings.seeds() {
            let instance = singletons(settings, settings.full_size(), seed);
            let row = Row {
                keys: texts(&[&contender.key(), &seed]),
                group: Group::new(contender, vec![instance]),
            };
            rows.extend(curve(&row));
        }
    }
    rows
}

fn auction_results(data: &Data<'_>) -> Table {
    let heads = "of the time | contender | modules with a spot | modules with their final spot";
    let moments = [25.0, 50.0, 75.0].into_iter();
    let rows = moments.flat_map(|percent| WITH_AUCTION.map(|contender| (percent, contender)));
    Table::of(heads, rows, |(percent, contender)| {
        let size = data.settings.full_size();
        let group = Group::of(data.settings, singletons, size, contender).at(percent);
        let shown = |value| format!("{} %", data.sample(&group, value).with_deviation());
        vec![
            format!("{percent} %"),
            contender.label().to_owned(),
            shown(SELECTED),
            shown(SETTLED),
        ]
    })
}
