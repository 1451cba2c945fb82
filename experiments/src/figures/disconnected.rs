//! Table I: planning time and disconnected modules where all initial configurations have one size.

use super::{Experiment, Report, cells_of, equal, plans, point, sample};
use crate::cell::Cell;
use crate::contender::Contender;
use crate::instance::Docked;
use crate::measure::plan::PlanMeasurement;
use crate::paper;
use crate::plot::{Axis, Line, Look, Marker, Panel, Plot, Point, Series, colour};
use crate::sample::{Sample, exact};
use crate::settings::Settings;
use crate::store::Store;
use crate::table::Table;

pub(super) const DISCONNECTED: Experiment = Experiment {
    name: "disconnected",
    title: "Planning time and disconnected modules, configurations of one size",
    source: "Table I",
    cells,
    report,
};

const CONTENDERS: [Contender; 3] = [
    Contender::PaperPolicy,
    Contender::Ours,
    Contender::OursSizeFirst,
];

type Kind = fn(usize) -> Docked;

/// The paper does not say how it draws trees; two ways bracket what it may have done.
const TREES: [(&str, Kind); 2] = [
    ("lattice trees, degree 3", Docked::Lattice),
    ("labelled trees, degree 4", Docked::Labelled),
];

/// The four ways of counting, with their names in the CSV file, in legends and in the summary.
type Count = fn(&PlanMeasurement) -> f64;
const COUNTS: [(&str, &str, Count); 4] = [
    ("unmatched_on_empty_target", "unmatched", |plan| {
        plan.unmatched_on_empty_target as f64
    }),
    ("broken_links", "broken links", |plan| {
        plan.broken_links as f64
    }),
    ("outside_largest_piece", "outside largest", |plan| {
        plan.outside_largest_piece as f64
    }),
    ("alone", "left alone", |plan| plan.alone as f64),
];

fn cells(settings: &Settings) -> Vec<Cell> {
    let mut cells = Vec::new();
    for (_, docked) in TREES {
        for size in settings.equal_sizes() {
            let instance = |seed| equal(settings, docked(size), seed);
            cells.extend(cells_of(settings, &CONTENDERS, instance, Cell::Plan));
        }
    }
    cells
}

fn report(settings: &Settings, store: &Store) -> Report {
    let mut heads = vec![
        "trees".to_owned(),
        "size".to_owned(),
        "contender".to_owned(),
        "runs".to_owned(),
        "planning_ms_mean".to_owned(),
        "planning_ms_std".to_owned(),
    ];
    for (name, ..) in COUNTS {
        heads.push(format!("{name}_mean"));
        heads.push(format!("{name}_std"));
    }
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let mut table = Table::new(&heads);
    let mut summary = Table::new(&[
        "trees",
        "size",
        "contender",
        "planning, ms",
        "unmatched on an empty target",
        "broken links",
        "outside the largest piece",
        "left alone",
    ]);
    for row in paper::DISCONNECTED {
        summary.row(vec![
            "(not said)".to_owned(),
            row.size.to_string(),
            "**paper, states**".to_owned(),
            format!("{} ± {}", row.planning_ms.0, row.planning_ms.1),
            format!(
                "{} ± {} (one count; which is not said)",
                row.disconnected.0, row.disconnected.1
            ),
            String::new(),
            String::new(),
            String::new(),
        ]);
    }
    for (trees, docked) in TREES {
        for size in settings.equal_sizes() {
            for contender in CONTENDERS {
                let plans = plans(settings, store, contender, |seed| {
                    equal(settings, docked(size), seed)
                });
                let time = sample(&plans, |plan| plan.planning_us / 1e3);
                let mut row = vec![
                    trees.to_owned(),
                    size.to_string(),
                    contender.key().to_owned(),
                    plans.len().to_string(),
                    exact(time.mean),
                    exact(time.deviation),
                ];
                let mut shown = vec![
                    trees.to_owned(),
                    size.to_string(),
                    contender.label().to_owned(),
                    time.with_deviation(),
                ];
                for (.., count) in COUNTS {
                    let count = sample(&plans, count);
                    row.push(exact(count.mean));
                    row.push(exact(count.deviation));
                    shown.push(count.with_deviation());
                }
                table.row(row);
                summary.row(shown);
            }
        }
    }
    Report {
        table,
        plot: plot(settings, store),
        text: format!(
            "Mean ± standard deviation. The first count lays each configuration into a target of its own; it depends on \
             the instance alone and is the same for all contenders. On labelled trees of maximum degree 4 it comes nearest \
             to the paper's column, which lies below every count of a plan in which all configurations share the target.\n\n{}",
            summary.to_markdown()
        ),
    }
}

fn plot(settings: &Settings, store: &Store) -> Plot {
    let sizes = settings.equal_sizes();
    let curve = |docked: Kind, contender, count: &dyn Fn(&PlanMeasurement) -> f64| {
        let each = sizes.iter().map(|&size| {
            let plans = plans(settings, store, contender, |seed| {
                equal(settings, docked(size), seed)
            });
            point(size as f64, sample(&plans, count))
        });
        each.collect::<Vec<Point>>()
    };
    let stated = |value: fn(&paper::DisconnectedRow) -> (f64, f64)| Series {
        name: "paper, Table I".to_owned(),
        look: Look::stated(),
        points: paper::DISCONNECTED
            .iter()
            .filter(|row| sizes.contains(&row.size))
            .map(|row| {
                let (mean, deviation) = value(row);
                let sample = Sample {
                    mean,
                    deviation,
                    count: settings.runs.try_into().unwrap_or(usize::MAX),
                };
                point(row.size as f64, sample)
            })
            .collect(),
    };
    let size_axis = || Axis::from_zero("size of all configurations (modules)");
    let mut panels = Vec::new();
    let looks = [
        Look::new(colour::PURPLE, Marker::Cross),
        Look::new(colour::BLUE, Marker::Circle),
        Look::new(colour::GREEN, Marker::Triangle),
        Look::new(colour::ORANGE, Marker::Ring),
    ];
    for (trees, docked) in TREES {
        let mut times = vec![stated(|row| row.planning_ms)];
        for contender in CONTENDERS {
            times.push(contender.series(curve(docked, contender, &|plan| plan.planning_us / 1e3)));
        }
        panels.push(Panel {
            title: format!("planning time, {trees}"),
            x: size_axis(),
            y: Axis::logarithmic("planning time (ms)"),
            series: times,
        });
        let mut series = vec![stated(|row| row.disconnected)];
        for ((_, legend, count), look) in COUNTS.into_iter().zip(looks) {
            series.push(Series {
                name: legend.to_owned(),
                look,
                points: curve(docked, Contender::Ours, &count),
            });
        }
        series.push(Series {
            name: "paper policy, broken".to_owned(),
            look: Contender::PaperPolicy.look().with_line(Line::Dashed),
            points: curve(docked, Contender::PaperPolicy, &COUNTS[1].2),
        });
        panels.push(Panel {
            title: format!("disconnected, {trees}"),
            x: size_axis(),
            y: Axis::from_zero("modules, or links"),
            series,
        });
    }
    Plot {
        title: format!(
            "{} modules in configurations of one size",
            settings.full_size()
        ),
        panels,
    }
}
