//! Figures 5(b), 6(b), 7(b) and 9(a): messages while planning.

use super::{
    Column, Data, Family, Figure, Group, Kind, Row, Value, averages, mixed, rows, singletons,
    surplus, texts,
};
use crate::cell::Counts;
use crate::contender::{Contender, PAPER_AND_OURS, WITH_AUCTION};
use crate::measure::talk::Count;
use crate::paper;
use crate::sample::{Sample, exact, short};
use crate::settings::ExperimentSettings;
use crate::table::Table;

const SAMPLES: Value = Value::Talk(|talk| talk.samples as f64);
const DELIVERIES: Value = Value::Talk(|talk| talk.deliveries() as f64);
const PAIRS: Value = Value::Talk(|talk| talk.pairs_delivered() as f64);
/// The pairs if every broadcast of the contender's own algorithm repeats the whole set of pairs, as in the paper.
const WHOLE_SETS: Value = Value::Plan(|plan| plan.whole_set_pairs() as f64);

const COUNTED: &[Column] = &[
    Column::Runs,
    Column::MeanAndDeviation("samples", SAMPLES),
    Column::MeanAndDeviation("deliveries", DELIVERIES),
    Column::MeanAndDeviation("pairs_delivered", PAIRS),
    Column::MeanAndDeviation("whole_sets_pairs", WHOLE_SETS),
];

pub(super) const MESSAGES: Figure = Figure {
    name: "messages",
    title: "Messages against the number of modules (Figure 5(b))",
    kinds: &[Kind::Talk, Kind::Plan],
    keys: "modules | spots | contender",
    rows: |settings| {
        let keys = |size, contender| texts(&[&size, &size, &contender]);
        rows(settings, mixed, settings.sizes(), &PAPER_AND_OURS, keys)
    },
    files: &[("messages", COUNTED)],
    tables: averages,
    results: |data| vec![("messages", results(data))],
};

pub(super) const OVER_TIME: Figure = Figure {
    name: "messages_over_time",
    title: "Messages against time, 100 modules (Figure 6(b))",
    kinds: &[Kind::Talk],
    keys: "",
    rows: |settings| {
        let row = |contender| Row {
            keys: Vec::new(),
            group: full_size(settings, contender),
        };
        PAPER_AND_OURS.map(row).into()
    },
    files: &[],
    tables: |figure, data| vec![(figure.name, each_run(data))],
    results: |data| vec![("messages_over_time", over_time_results(data))],
};

pub(super) const FEW_SPOTS: Figure = Figure {
    name: "messages_50_spots",
    title: "Messages with 50 spots, and with a spot for each module (Figure 7(b))",
    files: &[("messages_50_spots", COUNTED)],
    rows: |settings| {
        let families = few_and_as_many(settings).into_iter();
        let of_family = |(size, spots, family): (usize, usize, Family)| {
            let keys = |_, contender| texts(&[&size, &spots, &contender]);
            rows(settings, family, &[size], &PAPER_AND_OURS, keys)
        };
        families.flat_map(of_family).collect()
    },
    results: |data| vec![("messages_50_spots", few_spots_results(data))],
    ..MESSAGES
};

pub(super) const AUCTION: Figure = Figure {
    name: "auction_messages",
    title: "Messages of singletons, compared with the auction (Figure 9(a))",
    kinds: &[Kind::Talk],
    keys: "modules | contender",
    rows: |settings| {
        let keys = |size, contender| texts(&[&size, &contender]);
        rows(settings, singletons, settings.sizes(), &WITH_AUCTION, keys)
    },
    files: &[(
        "auction_messages",
        &[
            Column::Runs,
            Column::Mean("samples", SAMPLES),
            Column::MeanAndDeviation("deliveries", DELIVERIES),
            Column::Mean("pairs_delivered", PAIRS),
        ],
    )],
    tables: averages,
    results: |data| vec![("auction_messages", auction_results(data))],
};

/// Numbers of modules and spots: few spots, and a spot for each module unless the two are the same.
fn few_and_as_many(settings: &ExperimentSettings) -> Vec<(usize, usize, Family)> {
    let few = settings.few_spots();
    let mut sizes = Vec::new();
    for &size in settings.surplus_sizes() {
        sizes.push((size, few, surplus as Family));
        if size != few {
            sizes.push((size, size, mixed));
        }
    }
    sizes
}

/// The counts in the two summaries of mixed instances.
const COUNTS: &str = "paper states | literal, pairs in whole sets | literal, pairs | ours, pairs | \
    literal, deliveries | ours, deliveries";

/// [`COUNTS`] for one number of modules.
fn counts(data: &Data<'_>, family: Family, modules: usize, spots: usize) -> Vec<String> {
    let figure = if spots < modules {
        FEW_SPOTS.name
    } else {
        MESSAGES.name
    };
    let mut stated = paper::stated(figure, "pairs_delivered").into_iter();
    let stated = stated.find(|stated| stated.at == modules);
    let stated = stated.map_or(String::new(), |stated| stated.value.to_string());
    let [of_sets, _] = data.samples(family, modules, PAPER_AND_OURS, WHOLE_SETS);
    let mut counts = vec![stated, of_sets.short()];
    for value in [PAIRS, DELIVERIES] {
        let samples = data.samples(family, modules, PAPER_AND_OURS, value);
        counts.extend(samples.map(Sample::short));
    }
    counts
}

fn results(data: &Data<'_>) -> Table {
    let heads = format!("modules | {COUNTS}");
    Table::of(&heads, data.settings.sizes(), |&size| {
        [texts(&[&size]), counts(data, mixed, size, size)].concat()
    })
}

fn few_spots_results(data: &Data<'_>) -> Table {
    let heads = format!("modules | spots | {COUNTS}");
    let sizes = few_and_as_many(data.settings).into_iter();
    let sizes = sizes.filter(|&(size, spots, _)| spots < size);
    Table::of(&heads, sizes, |(size, spots, family)| {
        [texts(&[&size, &spots]), counts(data, family, size, spots)].concat()
    })
}

fn auction_results(data: &Data<'_>) -> Table {
    let heads = "modules | literal, deliveries | ours, deliveries | auction, deliveries | auction: bids | \
        auction / ours";
    Table::of(heads, data.settings.sizes(), |&size| {
        let deliveries = data.samples(singletons, size, WITH_AUCTION, DELIVERIES);
        let [_, ours, auction] = deliveries;
        let bids = Value::Talk(|talk| talk.steps as f64);
        let [bids] = data.samples(singletons, size, [Contender::Auction], bids);
        let mut row = texts(&[&size]);
        row.extend(deliveries.map(Sample::short));
        row.extend([bids.short(), short(auction.mean / ours.mean)]);
        row
    })
}

/// The instances of the full size.
fn full_size(settings: &ExperimentSettings, contender: Contender) -> Group {
    Group::of(settings, mixed, settings.full_size(), contender)
}

/// The state of each run after each twentieth of its time.
fn each_run(data: &Data<'_>) -> Table {
    let mut table = Table::new("contender | seed | time_ms | completion_percent | pairs_delivered");
    for contender in PAPER_AND_OURS {
        let group = full_size(data.settings, contender);
        let seeds = data.settings.seeds().into_iter();
        for (seed, cell) in seeds.zip(group.cells(Kind::Talk)) {
            let Some(Counts::Talk(talk)) = data.store.counts(cell) else {
                continue;
            };
            for percent in (0..=100).step_by(5).map(f64::from) {
                table.row(texts(&[
                    &contender.key(),
                    &seed,
                    &exact(percent / 100.0 * talk.duration as f64 / 1e3),
                    &exact(talk.counted_after(percent, Count::Selected)),
                    &talk.pairs_delivered_after(percent),
                ]));
            }
        }
    }
    table
}

fn over_time_results(data: &Data<'_>) -> Table {
    let heads = "contender | simulated planning time, ms | claims | pairs delivered | correlation of pairs and completion";
    Table::of(heads, PAPER_AND_OURS, |contender| {
        let group = full_size(data.settings, contender);
        let mut row = texts(&[&contender.label()]);
        row.extend(
            [
                Value::Talk(|talk| talk.duration as f64 / 1e3),
                Value::Talk(|talk| talk.steps as f64),
                PAIRS,
                Value::Talk(|talk| talk.correlation),
            ]
            .map(|value| data.sample(&group, value).short()),
        );
        row
    })
}
