//! Figures 5(b), 6(b), 7(b) and 9(a): messages while planning.

use super::{
    Column, Data, FIGURE_ONLY, Family, Figure, Group, Kind, Row, Value, averages, mixed, rows,
    singletons, surplus, texts,
};
use crate::cell::Measurement;
use crate::contender::{Contender, PAPER_AND_OURS, WITH_AUCTION};
use crate::measure::talk::Talk;
use crate::paper;
use crate::sample::{Sample, exact, short};
use crate::settings::Settings;
use crate::table::Table;

const SAMPLES: Value = Value::Talk(|talk| talk.samples as f64);
const DELIVERIES: Value = Value::Talk(|talk| talk.deliveries() as f64);
const PAIRS: Value = Value::Talk(|talk| talk.pairs_delivered() as f64);
/// The pairs if every broadcast of the contender's own algorithm repeats the whole set of pairs, as in the paper.
const WHOLE_SETS: Value = Value::Plan(|plan| plan.whole_set_pairs() as f64);

pub(super) const MESSAGES: Figure = Figure {
    name: "messages",
    kinds: &[Kind::Talk, Kind::Plan],
    keys: "modules | spots | contender",
    rows: |settings| {
        let keys = |size, contender| texts(&[&size, &size, &contender]);
        rows(settings, mixed, settings.sizes(), &PAPER_AND_OURS, keys)
    },
    columns: &[
        Column::Runs,
        Column::MeanAndDeviation("samples", SAMPLES),
        Column::MeanAndDeviation("deliveries", DELIVERIES),
        Column::MeanAndDeviation("pairs_delivered", PAIRS),
        Column::MeanAndDeviation("whole_sets_pairs", WHOLE_SETS),
    ],
    tables: averages,
    results,
};

pub(super) const OVER_TIME: Figure = Figure {
    name: "messages_over_time",
    kinds: &[Kind::Talk],
    keys: "",
    rows: |settings| {
        let row = |contender| Row {
            keys: Vec::new(),
            group: full_size(settings, contender),
        };
        PAPER_AND_OURS.map(row).into()
    },
    columns: &[],
    tables: |figure, data| vec![(figure.name, each_claim(data))],
    results: over_time_results,
};

pub(super) const FEW_SPOTS: Figure = Figure {
    name: "messages_50_spots",
    rows: |settings| {
        let families = few_and_as_many(settings).into_iter();
        let of_family = |(size, spots, family): (usize, usize, Family)| {
            let keys = |_, contender| texts(&[&size, &spots, &contender]);
            rows(settings, family, &[size], &PAPER_AND_OURS, keys)
        };
        families.flat_map(of_family).collect()
    },
    results: few_spots_results,
    ..MESSAGES
};

pub(super) const AUCTION: Figure = Figure {
    name: "auction_messages",
    kinds: &[Kind::Talk],
    keys: "modules | contender",
    rows: |settings| {
        let keys = |size, contender| texts(&[&size, &contender]);
        rows(settings, singletons, settings.sizes(), &WITH_AUCTION, keys)
    },
    columns: &[
        Column::Runs,
        Column::Mean("samples", SAMPLES),
        Column::MeanAndDeviation("deliveries", DELIVERIES),
        Column::Mean("pairs_delivered", PAIRS),
    ],
    tables: averages,
    results: auction_results,
};

/// Numbers of modules and spots: few spots, and a spot for each module unless the two are the same.
fn few_and_as_many(settings: &Settings) -> Vec<(usize, usize, Family)> {
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
const COUNTS: &str = "paper, states | paper policy, pairs in whole sets | paper policy, pairs | ours, \
    pairs | paper policy, deliveries | ours, deliveries";

/// [`COUNTS`] for one number of modules.
fn counts(data: &Data<'_>, family: Family, modules: usize, spots: usize) -> Vec<String> {
    let figure = if spots < modules {
        FEW_SPOTS.name
    } else {
        MESSAGES.name
    };
    let mut stated = paper::stated(figure, "pairs_delivered").into_iter();
    let stated = stated.find(|stated| stated.at == modules);
    let stated = stated.map_or(FIGURE_ONLY.to_owned(), |stated| {
        format!("{} x 10^5", stated.value / 1e5)
    });
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
    let sizes = few_and_as_many(data.settings);
    Table::of(&heads, sizes, |(size, spots, family)| {
        [texts(&[&size, &spots]), counts(data, family, size, spots)].concat()
    })
}

fn auction_results(data: &Data<'_>) -> Table {
    let heads = "modules | paper | paper policy, deliveries | ours, deliveries | auction, deliveries \
        | auction: bids | auction / ours";
    Table::of(heads, data.settings.sizes(), |&size| {
        let deliveries = data.samples(singletons, size, WITH_AUCTION, DELIVERIES);
        let [_, ours, auction] = deliveries;
        let bids = Value::Talk(|talk| talk.bids as f64);
        let [bids] = data.samples(singletons, size, [Contender::Auction], bids);
        let mut row = texts(&[&size, &FIGURE_ONLY]);
        row.extend(deliveries.map(Sample::with_deviation));
        row.extend([bids.short(), short(auction.mean / ours.mean)]);
        row
    })
}

/// The instances of the full size.
fn full_size(settings: &Settings, contender: Contender) -> Group {
    Group::of(settings, mixed, settings.full_size(), contender)
}

fn each_claim(data: &Data<'_>) -> Table {
    let mut table = Table::new(
        "contender | seed | claim | time_ms | completion_percent | samples | pairs_delivered",
    );
    for contender in PAPER_AND_OURS {
        let group = full_size(data.settings, contender);
        for (seed, cell) in data
            .settings
            .seeds()
            .into_iter()
            .zip(group.cells(Kind::Talk))
        {
            let Some(Measurement::Talk(talk)) = data.store.get(cell) else {
                continue;
            };
            for (claim, moment) in (1..).zip(&talk.course) {
                let completion = 100.0 * moment.selected as f64 / talk.fillable_spots as f64;
                table.row(texts(&[
                    &contender.key(),
                    &seed,
                    &claim,
                    &exact(moment.at as f64 / 1e3),
                    &exact(completion),
                    &moment.samples,
                    &(moment.pairs * talk.receivers()),
                ]));
            }
        }
    }
    table
}

fn over_time_results(data: &Data<'_>) -> Table {
    let heads = "contender | planning, ms of simulated time | claims | pairs delivered | correlation \
        of pairs and completion";
    Table::of(heads, PAPER_AND_OURS, |contender| {
        let group = full_size(data.settings, contender);
        let mut row = texts(&[&contender.label()]);
        row.extend(
            [
                Value::Talk(|talk| talk.duration as f64 / 1e3),
                Value::Talk(|talk| talk.course.len() as f64),
                PAIRS,
                Value::Talk(correlation),
            ]
            .map(|value| data.sample(&group, value).with_deviation()),
        );
        row
    })
}

/// Pearson's coefficient between pairs and selected spots.
fn correlation(talk: &Talk) -> f64 {
    let points = talk.course.iter();
    let points = points.map(|moment| (moment.selected as f64, moment.pairs as f64));
    let xs = Sample::of(points.clone().map(|point| point.0));
    let ys = Sample::of(points.clone().map(|point| point.1));
    let products = points.map(|(x, y)| (x - xs.mean) * (y - ys.mean));
    let covariance = products.sum::<f64>() / (talk.course.len().saturating_sub(1)).max(1) as f64;
    covariance / (xs.deviation * ys.deviation).max(f64::MIN_POSITIVE)
}
