//! Figures 6(a), 7(a) and 9(b): the part of the spots that is selected after each part of the planning time.

use super::{
    Column, Data, Family, Figure, Group, Kind, Row, Value, averages, mixed, rows, singletons,
    surplus, texts,
};
use crate::contender::{Contender, PAPER_AND_OURS, WITH_AUCTION};
use crate::measure::plan::PlanTimes;
use crate::measure::talk::Count;
use crate::paper;
use crate::settings::ExperimentSettings;
use crate::table::Table;

const SELECTED: Value =
    Value::TalkCurve(|talk, percent| talk.counted_after(percent, Count::Selected));
const SETTLED: Value =
    Value::TalkCurve(|talk, percent| talk.counted_after(percent, Count::Settled));
const COMPUTED: Value = Value::PlanCurve(PlanTimes::selected_after);

const IN_THE_PROTOCOL: &[Column] = &[
    Column::Runs,
    Column::Percent,
    Column::MeanAndDeviation("selected_percent", SELECTED),
    Column::Mean("settled_percent", SETTLED),
];
const IN_THE_CORE: &[Column] = &[
    Column::Runs,
    Column::Percent,
    Column::MeanAndDeviation("selected_percent_by_computing_time", COMPUTED),
];

pub(super) const COMPLETION: Figure = Figure {
    name: "completion",
    title: "Planning completion against time, a spot for each module (Figure 6(a))",
    kinds: &[Kind::Talk, Kind::Plan],
    keys: "contender | modules",
    rows: |settings| curves(settings, mixed, settings.sizes()),
    files: &[
        ("completion", IN_THE_PROTOCOL),
        ("completion_times", IN_THE_CORE),
    ],
    tables: averages,
    results: |data| {
        let sizes = data.settings.sizes();
        vec![
            (
                "completion",
                results(data, mixed, sizes, COMPLETION.name, SELECTED),
            ),
            (
                "completion_times",
                results(data, mixed, sizes, COMPLETION.name, COMPUTED),
            ),
        ]
    },
};

pub(super) const FEW_SPOTS: Figure = Figure {
    name: "completion_50_spots",
    title: "Planning completion against time, 50 spots (Figure 7(a))",
    rows: |settings| curves(settings, surplus, settings.surplus_sizes()),
    files: &[
        ("completion_50_spots", IN_THE_PROTOCOL),
        ("completion_50_spots_times", IN_THE_CORE),
    ],
    results: |data| {
        let (sizes, name) = (data.settings.surplus_sizes(), FEW_SPOTS.name);
        vec![
            (
                "completion_50_spots",
                results(data, surplus, sizes, name, SELECTED),
            ),
            (
                "completion_50_spots_times",
                results(data, surplus, sizes, name, COMPUTED),
            ),
        ]
    },
    ..COMPLETION
};

pub(super) const AUCTION: Figure = Figure {
    name: "auction_completion",
    title: "Planning completion of 100 singletons, compared with the auction (Figure 9(b))",
    kinds: &[Kind::Talk],
    keys: "contender",
    rows: auction_rows,
    files: &[(
        "auction_completion",
        &[
            Column::Runs,
            Column::Percent,
            Column::MeanAndDeviation("holding_percent", SELECTED),
            Column::MeanAndDeviation("settled_percent", SETTLED),
        ],
    )],
    tables: averages,
    results: |data| vec![("auction_completion", auction_results(data))],
};

/// A row for each part of the time at which curves are read.
fn curve(row: &Row) -> impl Iterator<Item = Row> {
    (0..=100).step_by(5).map(|percent| Row {
        keys: row.keys.clone(),
        group: row.group.at(f64::from(percent)),
    })
}

fn curves(settings: &ExperimentSettings, family: Family, sizes: &[usize]) -> Vec<Row> {
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

fn results(data: &Data<'_>, family: Family, sizes: &[usize], name: &str, value: Value) -> Table {
    let heads = "modules | of the time, % | paper states, % | literal, % | ours, %";
    let stated = paper::stated(name, "selected_percent").into_iter();
    let stated = stated.filter(|stated| sizes.contains(&stated.at));
    Table::of(heads, stated, |stated| {
        let (size, time, done) = (stated.at, stated.time_percent, stated.value);
        let mut row = texts(&[&size, &time, &done]);
        row.extend(PAPER_AND_OURS.map(|contender| {
            let group = Group::of(data.settings, family, size, contender).at(time);
            data.sample(&group, value).short()
        }));
        row
    })
}

fn auction_rows(settings: &ExperimentSettings) -> Vec<Row> {
    let row = |contender: Contender| Row {
        keys: texts(&[&contender.key()]),
        group: Group::of(settings, singletons, settings.full_size(), contender),
    };
    let rows = WITH_AUCTION.map(row);
    rows.iter().flat_map(curve).collect()
}

fn auction_results(data: &Data<'_>) -> Table {
    let heads = "of the time, % | literal: with a spot, % | final spot, % | ours: with a spot, % | final spot, % | \
        auction: with a spot, % | final spot, %";
    Table::of(heads, [25.0, 50.0, 75.0], |percent| {
        let mut row = texts(&[&percent]);
        for contender in WITH_AUCTION {
            let size = data.settings.full_size();
            let group = Group::of(data.settings, singletons, size, contender).at(percent);
            row.extend([SELECTED, SETTLED].map(|value| data.sample(&group, value).short()));
        }
        row
    })
}
