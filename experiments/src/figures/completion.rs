//! Figures 6(a) and 7(a): how much of the planning is done after which part of its time.

use super::{Experiment, Report, cells_of, mixed, protocols, surplus};
use crate::cell::Cell;
use crate::contender::Contender;
use crate::instance::Instance;
use crate::measure::protocol::ProtocolMeasurement;
use crate::paper;
use crate::plot::{Axis, Look, Panel, Plot, Point, Series};
use crate::sample::{Sample, exact};
use crate::settings::Settings;
use crate::store::Store;
use crate::table::Table;

pub(super) const COMPLETION: Experiment = Experiment {
    name: "completion",
    title: "Planning completion against time, a spot for each module",
    source: "Figure 6(a)",
    cells: mixed_cells,
    report: completion,
};

pub(super) const FEW_SPOTS: Experiment = Experiment {
    name: "completion_50_spots",
    title: "Planning completion against time, 50 spots",
    source: "Figure 7(a)",
    cells: few_spots_cells,
    report: few_spots,
};

const CONTENDERS: [Contender; 2] = [Contender::PaperPolicy, Contender::Ours];

/// The parts of the time at which curves are averaged, in per cent.
const STEP_PERCENT: usize = 5;

fn mixed_cells(settings: &Settings) -> Vec<Cell> {
    let sizes = settings.sizes().into_iter();
    sizes
        .flat_map(|size| {
            cells_of(
                settings,
                &CONTENDERS,
                |seed| mixed(size, seed),
                Cell::Protocol,
            )
        })
        .collect()
}

fn few_spots_cells(settings: &Settings) -> Vec<Cell> {
    let sizes = settings.surplus_sizes().into_iter();
    sizes
        .flat_map(|size| {
            let instance = |seed| surplus(settings, size, seed);
            cells_of(settings, &CONTENDERS, instance, Cell::Protocol)
        })
        .collect()
}

fn completion(settings: &Settings, store: &Store) -> Report {
    report(
        settings,
        store,
        &settings.sizes(),
        &paper::COMPLETION,
        "Spots selected against time, a spot for each module",
        |size, seed| mixed(size, seed),
    )
}

fn few_spots(settings: &Settings, store: &Store) -> Report {
    let title = format!(
        "Spots selected against time, {} spots",
        settings.few_spots()
    );
    report(
        settings,
        store,
        &settings.surplus_sizes(),
        &paper::COMPLETION_50_SPOTS,
        &title,
        |size, seed| surplus(settings, size, seed),
    )
}

/// Per cent of the spots that are selected after `percent` of the planning time.
pub(super) fn selected_after(run: &ProtocolMeasurement, percent: f64) -> f64 {
    count_after(run, percent, |claim| claim.selected)
}

/// Per cent of the spots that are selected for good after `percent` of the planning time.
pub(super) fn settled_after(run: &ProtocolMeasurement, percent: f64) -> f64 {
    count_after(run, percent, |claim| claim.settled)
}

fn count_after(
    run: &ProtocolMeasurement,
    percent: f64,
    count: impl Fn(&crate::measure::protocol::ClaimRecord) -> usize,
) -> f64 {
    let time = percent / 100.0 * run.planning_us as f64;
    let made = run
        .claims
        .partition_point(|claim| claim.at_us as f64 <= time);
    let last = run.claims[..made].last();
    100.0 * last.map_or(0, count) as f64 / run.fillable_spots as f64
}

/// The moments at which curves are averaged.
pub(super) fn moments() -> impl Iterator<Item = f64> {
    (0..=100).step_by(STEP_PERCENT).map(f64::from)
}

fn report(
    settings: &Settings,
    store: &Store,
    sizes: &[usize],
    stated: &[(usize, f64, f64)],
    title: &str,
    instance: impl Fn(usize, u64) -> Instance,
) -> Report {
    let mut table = Table::new(&[
        "contender",
        "modules",
        "runs",
        "time_percent",
        "selected_percent_mean",
        "selected_percent_std",
        "settled_percent_mean",
    ]);
    let mut panels = Vec::new();
    for contender in CONTENDERS.into_iter().rev() {
        let mut series = Vec::new();
        for (position, &size) in sizes.iter().enumerate() {
            let runs = protocols(settings, store, contender, |seed| instance(size, seed));
            let mut points = Vec::new();
            for percent in moments() {
                let selected = Sample::of(runs.iter().map(|run| selected_after(run, percent)));
                let settled = Sample::of(runs.iter().map(|run| settled_after(run, percent)));
                table.row(vec![
                    contender.key().to_owned(),
                    size.to_string(),
                    runs.len().to_string(),
                    exact(percent),
                    exact(selected.mean),
                    exact(selected.deviation),
                    exact(settled.mean),
                ]);
                points.push(Point::new(percent, selected.mean));
            }
            series.push(Series {
                name: format!("{size} modules"),
                look: Look::of_step(position, sizes.len()).with_marker_every(4),
                points,
            });
        }
        let known = stated.iter().filter(|one| sizes.contains(&one.0));
        let points: Vec<Point> = known.map(|one| Point::new(one.1, one.2)).collect();
        if !points.is_empty() {
            series.push(Series {
                name: "paper, stated".to_owned(),
                look: Look::stated(),
                points,
            });
        }
        panels.push(Panel {
            title: contender.label().to_owned(),
            x: Axis::percent("planning time elapsed (%)"),
            y: Axis::percent("spots selected (%)"),
            series,
        });
    }
    let mut summary = Table::new(&[
        "modules",
        "of the time",
        "completed: paper",
        "completed: paper policy",
        "completed: ours",
    ]);
    for &(size, time, done) in stated.iter().filter(|one| sizes.contains(&one.0)) {
        let mut row = vec![size.to_string(), format!("{time} %"), format!("{done} %")];
        for contender in CONTENDERS {
            let runs = protocols(settings, store, contender, |seed| instance(size, seed));
            let selected = Sample::of(runs.iter().map(|run| selected_after(run, time)));
            row.push(format!("{} %", selected.with_deviation()));
        }
        summary.row(row);
    }
    Report {
        table,
        plot: Plot {
            title: title.to_owned(),
            panels,
        },
        text: format!(
            "Recorded claim by claim in the simulator, from the roster until the last module has applied the last claim. \
             Messages take 0.2 to 5 ms there and computing takes no time, so a turn takes as long whether a singleton or a \
             configuration decides; the paper's axis is the computing time of one PC, with configurations' searches \
             taking most of it. At the points that the paper states:\n\n{}",
            summary.to_markdown()
        ),
    }
}
