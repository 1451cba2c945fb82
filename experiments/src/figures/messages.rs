//! Figures 5(b), 6(b) and 7(b): messages while planning.

use super::{Experiment, Report, cells_of, mixed, plans, point, protocols, sample, surplus};
use crate::cell::Cell;
use crate::contender::Contender;
use crate::instance::Instance;
use crate::measure::protocol::ProtocolMeasurement;
use crate::paper;
use crate::plot::{Axis, Line, Look, Marker, Panel, Plot, Point, Series, colour};
use crate::sample::{Sample, exact};
use crate::settings::Settings;
use crate::store::Store;
use crate::table::Table;

pub(super) const MESSAGES: Experiment = Experiment {
    name: "messages",
    title: "Messages against the number of modules",
    source: "Figure 5(b)",
    cells: mixed_cells,
    report: messages,
};

pub(super) const OVER_TIME: Experiment = Experiment {
    name: "messages_over_time",
    title: "Messages against time, 100 modules",
    source: "Figure 6(b)",
    cells: full_cells,
    report: over_time,
};

pub(super) const FEW_SPOTS: Experiment = Experiment {
    name: "messages_50_spots",
    title: "Messages with 50 spots, and with a spot for each module",
    source: "Figure 7(b)",
    cells: few_spots_cells,
    report: few_spots,
};

const CONTENDERS: [Contender; 2] = [Contender::PaperPolicy, Contender::Ours];

/// Both kinds of cell: the protocol counts what is said, the plan what the paper's algorithms ask for.
fn both_cells(settings: &Settings, instance: impl Fn(u64) -> Instance) -> Vec<Cell> {
    let mut cells = cells_of(settings, &CONTENDERS, &instance, Cell::Plan);
    cells.extend(cells_of(settings, &CONTENDERS, &instance, Cell::Protocol));
    cells
}

fn mixed_cells(settings: &Settings) -> Vec<Cell> {
    let sizes = settings.sizes().into_iter();
    sizes
        .flat_map(|size| both_cells(settings, |seed| mixed(size, seed)))
        .collect()
}

fn full_cells(settings: &Settings) -> Vec<Cell> {
    let size = settings.full_size();
    cells_of(
        settings,
        &CONTENDERS,
        |seed| mixed(size, seed),
        Cell::Protocol,
    )
}

fn few_spots_cells(settings: &Settings) -> Vec<Cell> {
    let mut cells = Vec::new();
    for size in settings.surplus_sizes() {
        cells.extend(both_cells(settings, |seed| surplus(settings, size, seed)));
        cells.extend(both_cells(settings, |seed| mixed(size, seed)));
    }
    cells
}

/// What one contender says, counted in three ways.
struct Counts {
    contender: Contender,
    runs: usize,
    samples: Sample,
    deliveries: Sample,
    pairs: Sample,
    /// If every broadcast of the contender's own algorithm repeats the whole set of pairs, as the paper's do.
    whole_sets: Sample,
}

impl Counts {
    fn of(
        settings: &Settings,
        store: &Store,
        contender: Contender,
        instance: impl Fn(u64) -> Instance,
    ) -> Self {
        let protocols = protocols(settings, store, contender, &instance);
        let plans = plans(settings, store, contender, &instance);
        Self {
            contender,
            runs: protocols.len(),
            samples: sample(&protocols, |run| run.samples() as f64),
            deliveries: sample(&protocols, |run| run.deliveries() as f64),
            pairs: sample(&protocols, |run| run.pairs() as f64),
            whole_sets: sample(&plans, |plan| plan.whole_set_pairs() as f64),
        }
    }

    fn row(&self, modules: usize, spots: usize) -> Vec<String> {
        let mut row = vec![
            modules.to_string(),
            spots.to_string(),
            self.contender.key().to_owned(),
            self.runs.to_string(),
        ];
        for sample in [self.samples, self.deliveries, self.pairs, self.whole_sets] {
            row.push(exact(sample.mean));
            row.push(exact(sample.deviation));
        }
        row
    }
}

const HEADS: [&str; 12] = [
    "modules",
    "spots",
    "contender",
    "runs",
    "samples_mean",
    "samples_std",
    "deliveries_mean",
    "deliveries_std",
    "pairs_delivered_mean",
    "pairs_delivered_std",
    "whole_sets_pairs_mean",
    "whole_sets_pairs_std",
];

/// What both summaries count.
const COUNTS: [&str; 6] = [
    "paper, states",
    "paper policy, pairs in whole sets",
    "paper policy, pairs",
    "ours, pairs",
    "paper policy, deliveries",
    "ours, deliveries",
];

fn messages(settings: &Settings, store: &Store) -> Report {
    let mut table = Table::new(&HEADS);
    let mut summary = Table::new(&[&["modules"], &COUNTS[..]].concat());
    let mut curves: [Vec<Point>; 4] = Default::default();
    for size in settings.sizes() {
        let [paper_policy, ours] = CONTENDERS
            .map(|contender| Counts::of(settings, store, contender, |seed| mixed(size, seed)));
        for counts in [&paper_policy, &ours] {
            table.row(counts.row(size, size));
        }
        let shown = [
            paper_policy.whole_sets,
            paper_policy.pairs,
            ours.pairs,
            ours.deliveries,
        ];
        for (curve, sample) in curves.iter_mut().zip(shown) {
            curve.push(point(size as f64, sample));
        }
        let stated = if size == 100 {
            "10 x 10^5".to_owned()
        } else {
            "figure only".to_owned()
        };
        summary.row(vec![
            size.to_string(),
            stated,
            paper_policy.whole_sets.short(),
            paper_policy.pairs.short(),
            ours.pairs.short(),
            paper_policy.deliveries.short(),
            ours.deliveries.short(),
        ]);
    }
    let [whole_sets, paper_pairs, pairs, deliveries] = curves;
    let mut series = vec![
        Series {
            name: "paper policy, whole sets: pairs".to_owned(),
            look: Contender::PaperPolicy.look().with_line(Line::Dashed),
            points: whole_sets,
        },
        Series {
            name: "paper policy, our claims: pairs".to_owned(),
            look: Contender::PaperPolicy.look(),
            points: paper_pairs,
        },
        Series {
            name: "ours, claims: pairs".to_owned(),
            look: Contender::Ours.look(),
            points: pairs,
        },
        Series {
            name: "ours, claims and notices: deliveries".to_owned(),
            look: Look::new(colour::SKY, Marker::Triangle),
            points: deliveries,
        },
    ];
    if settings.full_size() == 100 {
        series.insert(
            0,
            Series {
                name: "paper, stated in its text".to_owned(),
                look: Look::stated(),
                points: vec![Point::new(100.0, paper::MESSAGES_100_SPOTS)],
            },
        );
    }
    Report {
        table,
        plot: Plot {
            title: "Messages while planning, mixed instances".to_owned(),
            panels: vec![Panel {
                title: String::new(),
                x: Axis::from_zero("modules (as many spots)"),
                y: Axis::logarithmic("pairs, or samples, times receivers"),
                series,
            }],
        },
        text: format!(
            "Recorded in the simulator: claims and eviction notices (deliveries: times receivers), and the (spot, selector) \
             pairs in the claims times receivers. The paper does not say what it counts; its algorithms broadcast the \
             whole set of pairs after each selection, which is \"whole sets\": with 100 singletons 100 broadcasts of 100 \
             pairs to 99 receivers, 9.9 x 10^5 for the paper's 10 x 10^5. Its policy is carried here by our protocol, \
             which says only what changes.\n\n{}",
            summary.to_markdown()
        ),
    }
}

fn over_time(settings: &Settings, store: &Store) -> Report {
    let size = settings.full_size();
    let mut table = Table::new(&[
        "contender",
        "seed",
        "claim",
        "time_ms",
        "completion_percent",
        "samples",
        "pairs_delivered",
    ]);
    let mut by_time = Vec::new();
    let mut by_completion = Vec::new();
    let mut summary = Table::new(&[
        "contender",
        "planning, ms of simulated time",
        "claims",
        "pairs delivered",
        "correlation of pairs and completion",
    ]);
    for contender in CONTENDERS {
        let mut correlations = Vec::new();
        let runs = protocols(settings, store, contender, |seed| mixed(size, seed));
        for (number, (seed, run)) in settings.seeds().into_iter().zip(&runs).enumerate() {
            let curve = curve_of(run);
            for (claim, moment) in (1..).zip(&curve) {
                table.row(vec![
                    contender.key().to_owned(),
                    seed.to_string(),
                    claim.to_string(),
                    exact(moment.time_ms),
                    exact(moment.completion),
                    moment.samples.to_string(),
                    exact(moment.pairs),
                ]);
            }
            correlations.push(correlation(&curve));
            let look = Look {
                opacity: 0.5,
                // At its end alone.
                marker_every: usize::MAX,
                line: Line::Thin,
                ..contender.look()
            };
            let series = |points| Series {
                name: if number == 0 {
                    format!("{}: a line a run, marked at its end", contender.label())
                } else {
                    String::new()
                },
                look,
                points,
            };
            let points = |x: &dyn Fn(&Moment) -> f64| {
                let all = curve.iter().map(|one| Point::new(x(one), one.pairs));
                all.collect()
            };
            by_time.push(series(points(&|moment| moment.time_ms)));
            by_completion.push(series(points(&|moment| moment.completion)));
        }
        summary.row(vec![
            contender.label().to_owned(),
            sample(&runs, |run| run.planning_us as f64 / 1e3).with_deviation(),
            sample(&runs, |run| run.claims.len() as f64).with_deviation(),
            sample(&runs, |run| run.pairs() as f64).with_deviation(),
            Sample::of(correlations).with_deviation(),
        ]);
    }
    let panel = |x, series| Panel {
        title: String::new(),
        x,
        y: Axis::from_zero("pairs delivered so far"),
        series,
    };
    Report {
        table,
        plot: Plot {
            title: format!("Messages while {size} modules plan, mixed instances"),
            panels: vec![
                panel(
                    Axis::from_zero("simulated time since the roster (ms)"),
                    by_time,
                ),
                panel(Axis::percent("spots selected (%)"), by_completion),
            ],
        },
        text: format!(
            "The paper observes that \"the message count is increasing almost-linearly with completion rate\".\n\n{}",
            summary.to_markdown()
        ),
    }
}

/// What stands after one claim.
struct Moment {
    time_ms: f64,
    completion: f64,
    samples: usize,
    pairs: f64,
}

fn curve_of(run: &ProtocolMeasurement) -> Vec<Moment> {
    let (mut samples, mut pairs) = (0, 0);
    run.claims
        .iter()
        .map(|claim| {
            samples += 1 + claim.evictions;
            pairs += claim.pairs;
            Moment {
                time_ms: claim.at_us as f64 / 1e3,
                completion: 100.0 * claim.selected as f64 / run.fillable_spots as f64,
                samples,
                pairs: (pairs * run.receivers()) as f64,
            }
        })
        .collect()
}

/// Pearson's coefficient between pairs and completion.
fn correlation(curve: &[Moment]) -> f64 {
    let xs = Sample::of(curve.iter().map(|moment| moment.completion));
    let ys = Sample::of(curve.iter().map(|moment| moment.pairs));
    let products = curve
        .iter()
        .map(|moment| (moment.completion - xs.mean) * (moment.pairs - ys.mean));
    let covariance = products.sum::<f64>() / (curve.len().saturating_sub(1)).max(1) as f64;
    covariance / (xs.deviation * ys.deviation).max(f64::MIN_POSITIVE)
}

fn few_spots(settings: &Settings, store: &Store) -> Report {
    let few = settings.few_spots();
    let mut table = Table::new(&HEADS);
    let mut summary = Table::new(&[&["modules", "spots"], &COUNTS[..]].concat());
    let mut curves: [Vec<Point>; 4] = Default::default();
    for size in settings.surplus_sizes() {
        for spots in [few, size] {
            let [paper_policy, ours] = CONTENDERS.map(|contender| {
                Counts::of(settings, store, contender, |seed| {
                    if spots == few {
                        surplus(settings, size, seed)
                    } else {
                        mixed(size, seed)
                    }
                })
            });
            for counts in [&paper_policy, &ours] {
                table.row(counts.row(size, spots));
            }
            let offset = if spots == few { 0 } else { 2 };
            curves[offset].push(point(size as f64, paper_policy.whole_sets));
            curves[offset + 1].push(point(size as f64, ours.pairs));
            if size == few {
                // The two settings are one here.
                curves[2].push(point(size as f64, paper_policy.whole_sets));
                curves[3].push(point(size as f64, ours.pairs));
            }
            let stated = match (size, spots) {
                (100, 50) => "8 x 10^5",
                (100, 100) => "10 x 10^5",
                _ => "figure only",
            };
            summary.row(vec![
                size.to_string(),
                spots.to_string(),
                stated.to_owned(),
                paper_policy.whole_sets.short(),
                paper_policy.pairs.short(),
                ours.pairs.short(),
                paper_policy.deliveries.short(),
                ours.deliveries.short(),
            ]);
            if size == few {
                break;
            }
        }
    }
    let looks = [
        ("paper policy, whole sets", Contender::PaperPolicy.look()),
        ("ours", Contender::Ours.look()),
    ];
    let mut series = Vec::new();
    for (number, points) in curves.into_iter().enumerate() {
        let (name, look) = looks[number % 2];
        let (spots, look) = if number < 2 {
            (format!("{few} spots"), look)
        } else {
            let hollow = Marker::Ring;
            let look = Look {
                marker: hollow,
                ..look.with_line(Line::Dashed)
            };
            ("a spot for each".to_owned(), look)
        };
        series.push(Series {
            name: format!("{name}, {spots}"),
            look,
            points,
        });
    }
    if settings.full_size() == 100 {
        series.push(Series {
            name: "paper, stated in its text: 50 and 100 spots".to_owned(),
            look: Look::stated(),
            points: vec![
                Point::new(100.0, paper::MESSAGES_50_SPOTS),
                Point::new(100.0, paper::MESSAGES_100_SPOTS),
            ],
        });
    }
    Report {
        table,
        plot: Plot {
            title: format!("Messages with {few} spots and with a spot for each module"),
            panels: vec![Panel {
                title: String::new(),
                x: Axis::around("modules"),
                y: Axis::logarithmic("pairs delivered"),
                series,
            }],
        },
        text: format!(
            "Counted as above. The paper's ratio of the two settings at 100 modules is 0.8.\n\n{}",
            summary.to_markdown()
        ),
    }
}
