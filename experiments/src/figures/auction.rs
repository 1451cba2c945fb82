//! Figures 8 and 9: the comparison with the auction, on singletons.

use super::completion::{moments, selected_after, settled_after};
use super::{Experiment, Report, cells_of, plans, point, protocols, sample, singletons};
use crate::cell::Cell;
use crate::contender::Contender;
use crate::measure::auction::AuctionMeasurement;
use crate::measure::plan::PlanMeasurement;
use crate::plot::{Axis, Line, Look, Marker, Panel, Plot, Point, Series};
use crate::sample::{Sample, exact};
use crate::settings::Settings;
use crate::store::Store;
use crate::table::Table;

pub(super) const TIME: Experiment = Experiment {
    name: "auction_time",
    title: "Planning time of singletons, compared with the auction",
    source: "Figure 8(a)",
    cells: plan_cells,
    report: time,
};

pub(super) const DISTANCE: Experiment = Experiment {
    name: "auction_distance",
    title: "Distance travelled by singletons, compared with the auction",
    source: "Figure 8(b)",
    cells: plan_cells,
    report: distance,
};

pub(super) const MESSAGES: Experiment = Experiment {
    name: "auction_messages",
    title: "Messages of singletons, compared with the auction",
    source: "Figure 9(a)",
    cells: message_cells,
    report: messages,
};

pub(super) const COMPLETION: Experiment = Experiment {
    name: "auction_completion",
    title: "Planning completion of 100 singletons, compared with the auction",
    source: "Figure 9(b)",
    cells: completion_cells,
    report: completion,
};

const CONTENDERS: [Contender; 4] = [
    Contender::PaperPolicy,
    Contender::Ours,
    Contender::Auction,
    Contender::Hungarian,
];

/// Those that take turns in the simulator.
const TURN_TAKERS: [Contender; 2] = [Contender::PaperPolicy, Contender::Ours];

fn plan_cells(settings: &Settings) -> Vec<Cell> {
    let sizes = settings.sizes().into_iter();
    sizes
        .flat_map(|size| {
            cells_of(
                settings,
                &CONTENDERS,
                |seed| singletons(size, seed),
                Cell::Plan,
            )
        })
        .collect()
}

fn cells_for(settings: &Settings, size: usize) -> Vec<Cell> {
    let mut cells = cells_of(
        settings,
        &TURN_TAKERS,
        |seed| singletons(size, seed),
        Cell::Protocol,
    );
    let seeds = settings.seeds().into_iter();
    cells.extend(seeds.map(|seed| Cell::Auction(singletons(size, seed))));
    cells
}

fn message_cells(settings: &Settings) -> Vec<Cell> {
    let sizes = settings.sizes().into_iter();
    sizes.flat_map(|size| cells_for(settings, size)).collect()
}

fn completion_cells(settings: &Settings) -> Vec<Cell> {
    cells_for(settings, settings.full_size())
}

fn auctions<'a>(settings: &Settings, store: &'a Store, size: usize) -> Vec<&'a AuctionMeasurement> {
    let seeds = settings.seeds().into_iter();
    seeds
        .filter_map(|seed| store.auction(Cell::Auction(singletons(size, seed))))
        .collect()
}

fn time(settings: &Settings, store: &Store) -> Report {
    let (table, summary, series) = compare(settings, store, "planning_ms", |plan| {
        plan.planning_us / 1e3
    });
    Report {
        table,
        plot: Plot {
            title: "Planning time of singletons".to_owned(),
            panels: vec![Panel {
                title: String::new(),
                x: Axis::from_zero("singletons (as many spots)"),
                y: Axis::logarithmic("planning time (ms)"),
                series,
            }],
        },
        text: format!(
            "Milliseconds of the core, mean ± standard deviation. The auction is Bertsekas' with epsilon scaling; the \
             Hungarian method is that of the crate `pathfinding`. The paper gives its numbers as a figure only, and says \
             that its algorithm's lead over the auction grows with the number of modules.\n\n{}",
            summary.to_markdown()
        ),
    }
}

fn distance(settings: &Settings, store: &Store) -> Report {
    let (table, summary, series) = compare(settings, store, "distance_units", |plan| plan.distance);
    Report {
        table,
        plot: Plot {
            title: "Distance travelled by singletons".to_owned(),
            panels: vec![Panel {
                title: String::new(),
                x: Axis::from_zero("singletons (as many spots)"),
                y: Axis::from_zero("sum of all ways (units)"),
                series,
            }],
        },
        text: format!(
            "Units, mean ± standard deviation. Ours, the auction and the Hungarian method are optimal in utility, of which \
             distance is the greatest part.\n\n{}",
            summary.to_markdown()
        ),
    }
}

fn compare(
    settings: &Settings,
    store: &Store,
    name: &str,
    value: impl Fn(&PlanMeasurement) -> f64,
) -> (Table, Table, Vec<Series>) {
    let (mean, deviation) = (format!("{name}_mean"), format!("{name}_std"));
    let mut table = Table::new(&[
        "modules",
        "contender",
        "runs",
        &mean,
        &deviation,
        "filled_spots_mean",
        "utility_mean",
    ]);
    let mut summary = Table::new(&[
        "modules",
        "paper",
        "paper policy (spots filled)",
        "ours",
        "auction",
        "Hungarian",
    ]);
    let mut series: Vec<Series> = CONTENDERS
        .iter()
        .map(|contender| contender.series(Vec::new()))
        .collect();
    for size in settings.sizes() {
        let mut row = vec![size.to_string(), "figure only".to_owned()];
        for (contender, series) in CONTENDERS.iter().zip(&mut series) {
            let plans = plans(settings, store, *contender, |seed| singletons(size, seed));
            let whole = sample(&plans, &value);
            let filled = sample(&plans, |plan| plan.filled_spots as f64);
            table.row(vec![
                size.to_string(),
                contender.key().to_owned(),
                plans.len().to_string(),
                exact(whole.mean),
                exact(whole.deviation),
                exact(filled.mean),
                exact(sample(&plans, |plan| plan.utility).mean),
            ]);
            row.push(match contender {
                Contender::PaperPolicy => {
                    format!("{} ({})", whole.with_deviation(), filled.short())
                }
                _ => whole.with_deviation(),
            });
            series.points.push(point(size as f64, whole));
        }
        summary.row(row);
    }
    (table, summary, series)
}

fn messages(settings: &Settings, store: &Store) -> Report {
    let mut table = Table::new(&[
        "modules",
        "contender",
        "runs",
        "samples_mean",
        "deliveries_mean",
        "deliveries_std",
        "pairs_delivered_mean",
    ]);
    let mut summary = Table::new(&[
        "modules",
        "paper",
        "paper policy, deliveries",
        "ours, deliveries",
        "auction, deliveries",
        "auction: bids",
        "auction / ours",
    ]);
    let mut series: Vec<Series> = [Contender::PaperPolicy, Contender::Ours, Contender::Auction]
        .iter()
        .map(|contender| contender.series(Vec::new()))
        .collect();
    for size in settings.sizes() {
        let mut row = vec![size.to_string(), "figure only".to_owned()];
        let mut means = Vec::new();
        for (contender, series) in TURN_TAKERS.iter().zip(&mut series) {
            let runs = protocols(settings, store, *contender, |seed| singletons(size, seed));
            let deliveries = sample(&runs, |run| run.deliveries() as f64);
            table.row(vec![
                size.to_string(),
                contender.key().to_owned(),
                runs.len().to_string(),
                exact(sample(&runs, |run| run.samples() as f64).mean),
                exact(deliveries.mean),
                exact(deliveries.deviation),
                exact(sample(&runs, |run| run.pairs() as f64).mean),
            ]);
            row.push(deliveries.with_deviation());
            means.push(deliveries.mean);
            series.points.push(point(size as f64, deliveries));
        }
        let auctions = auctions(settings, store, size);
        let deliveries = sample(&auctions, |auction| auction.deliveries() as f64);
        table.row(vec![
            size.to_string(),
            Contender::Auction.key().to_owned(),
            auctions.len().to_string(),
            exact(sample(&auctions, |auction| auction.samples() as f64).mean),
            exact(deliveries.mean),
            exact(deliveries.deviation),
            exact(deliveries.mean),
        ]);
        row.push(deliveries.with_deviation());
        row.push(sample(&auctions, |auction| auction.bids as f64).short());
        row.push(crate::sample::short(
            deliveries.mean / means.last().copied().unwrap_or(1.0),
        ));
        if let Some(series) = series.last_mut() {
            series.points.push(point(size as f64, deliveries));
        }
        summary.row(row);
    }
    Report {
        table,
        plot: Plot {
            title: "Messages of singletons while planning".to_owned(),
            panels: vec![Panel {
                title: String::new(),
                x: Axis::from_zero("singletons (as many spots)"),
                y: Axis::logarithmic("messages times receivers"),
                series,
            }],
        },
        text: format!(
            "Ours and the paper policy: claims and eviction notices, recorded in the simulator. The auction: each bid and \
             each new price is a message to all others. The auction's claims of the spots that it has assigned are not \
             counted.\n\n{}",
            summary.to_markdown()
        ),
    }
}

fn completion(settings: &Settings, store: &Store) -> Report {
    let size = settings.full_size();
    let mut table = Table::new(&[
        "contender",
        "seed",
        "time_percent",
        "holding_percent",
        "settled_percent",
    ]);
    let mut holding = Vec::new();
    let mut settled = Vec::new();
    let mut rows = Vec::new();
    let mut add = |contender: Contender, curves: Vec<Vec<(f64, f64, f64)>>| {
        let mut means: Vec<(Sample, Sample)> = Vec::new();
        for (position, percent) in moments().enumerate() {
            let at = |value: &dyn Fn(&(f64, f64, f64)) -> f64| {
                Sample::of(curves.iter().map(|curve| value(&curve[position])))
            };
            means.push((at(&|one| one.1), at(&|one| one.2)));
            if [25.0, 50.0, 75.0].contains(&percent) {
                rows.push((percent, contender, at(&|one| one.1), at(&|one| one.2)));
            }
        }
        for (panel, value) in [
            (&mut holding, (|one| one.1) as fn(&(f64, f64, f64)) -> f64),
            (&mut settled, |one| one.2),
        ] {
            for curve in &curves {
                panel.push(Series {
                    name: String::new(),
                    look: Look {
                        opacity: 0.15,
                        marker: Marker::None,
                        line: Line::Thin,
                        ..contender.look()
                    },
                    points: curve
                        .iter()
                        .map(|one| Point::new(one.0, value(one)))
                        .collect(),
                });
            }
        }
        let mean_series = |value: &dyn Fn(&(Sample, Sample)) -> f64| Series {
            name: format!("{}, mean", contender.label()),
            look: contender.look().with_marker_every(2),
            points: moments()
                .zip(&means)
                .map(|(percent, mean)| Point::new(percent, value(mean)))
                .collect(),
        };
        holding.push(mean_series(&|mean| mean.0.mean));
        settled.push(mean_series(&|mean| mean.1.mean));
        for (seed, curve) in settings.seeds().into_iter().zip(&curves) {
            for &(percent, holding, settled) in curve {
                table.row(vec![
                    contender.key().to_owned(),
                    seed.to_string(),
                    exact(percent),
                    exact(holding),
                    exact(settled),
                ]);
            }
        }
    };
    for contender in TURN_TAKERS {
        let runs = protocols(settings, store, contender, |seed| singletons(size, seed));
        let curves = runs.iter().map(|run| {
            moments()
                .map(|percent| {
                    let selected = selected_after(run, percent);
                    (percent, selected, settled_after(run, percent))
                })
                .collect()
        });
        add(contender, curves.collect());
    }
    let curves = auctions(settings, store, size).into_iter().map(|auction| {
        moments()
            .map(|percent| {
                let share = |counts: &[usize]| {
                    let position = (percent / 100.0 * counts.len() as f64).round() as usize;
                    let count = position.checked_sub(1).map_or(0, |last| counts[last]);
                    100.0 * count as f64 / auction.modules as f64
                };
                (percent, share(&auction.holding), share(&auction.settled))
            })
            .collect()
    });
    add(Contender::Auction, curves.collect());
    let mut summary = Table::new(&[
        "of the time",
        "contender",
        "modules with a spot",
        "modules with their final spot",
    ]);
    rows.sort_by(|one, other| one.0.total_cmp(&other.0));
    for (percent, contender, holding, settled) in rows {
        summary.row(vec![
            format!("{percent} %"),
            contender.label().to_owned(),
            format!("{} %", holding.with_deviation()),
            format!("{} %", settled.with_deviation()),
        ]);
    }
    let panel = |title: &str, series| Panel {
        title: title.to_owned(),
        x: Axis::percent("planning time elapsed (%)"),
        y: Axis::percent("modules (%)"),
        series,
    };
    Report {
        table,
        plot: Plot {
            title: format!("Planning completion of {size} singletons"),
            panels: vec![
                panel("modules that hold a spot", holding),
                panel("modules that hold their final spot", settled),
            ],
        },
        text: format!(
            "Time is the simulator's for ours and the paper policy, and counted in bids for the auction. An auction with \
             epsilon scaling has several rounds; with each, everybody lets go and bids anew. The paper gives a figure \
             only, and says that the auction's completion rate is higher although it takes longer.\n\n{}",
            summary.to_markdown()
        ),
    }
}
