//! Figures 6(a) and 7(a): how much of the planning is done after which part of its time.

use super::{Experiment, Report, cells_of, mixed, plans, protocols, sample, surplus};
use crate::cell::Cell;
use crate::contender::Contender;
use crate::instance::Instance;
use crate::measure::plan::PlanMeasurement;
use crate::measure::protocol::{ClaimRecord, ProtocolMeasurement};
use crate::paper;
use crate::plot::{Axis, Look, Marker, Panel, Plot, Point, Series};
use crate::sample::exact;
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

fn cells(
    settings: &Settings,
    sizes: &[usize],
    instance: impl Fn(usize, u64) -> Instance,
) -> Vec<Cell> {
    let mut cells = Vec::new();
    for &size in sizes {
        let instance = |seed| instance(size, seed);
        cells.extend(cells_of(settings, &CONTENDERS, instance, Cell::Protocol));
        cells.extend(cells_of(settings, &CONTENDERS, instance, Cell::Plan));
    }
    cells
}

fn mixed_cells(settings: &Settings) -> Vec<Cell> {
    cells(settings, &settings.sizes(), mixed)
}

fn few_spots_cells(settings: &Settings) -> Vec<Cell> {
    cells(settings, &settings.surplus_sizes(), |size, seed| {
        surplus(settings, size, seed)
    })
}

fn completion(settings: &Settings, store: &Store) -> Report {
    report(
        settings,
        store,
        &settings.sizes(),
        &paper::COMPLETION,
        "Spots selected against time, a spot for each module",
        mixed,
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
    count: impl Fn(&ClaimRecord) -> usize,
) -> f64 {
    let time = percent / 100.0 * run.planning_us as f64;
    let made = run
        .claims
        .partition_point(|claim| claim.at_us as f64 <= time);
    let last = run.claims[..made].last();
    100.0 * last.map_or(0, count) as f64 / run.fillable_spots as f64
}

/// Per cent of the spots that are selected after `percent` of the computing time.
fn computed_after(plan: &PlanMeasurement, percent: f64) -> f64 {
    let end = plan.turns.last().map_or(0.0, |turn| turn.0);
    let taken = plan
        .turns
        .partition_point(|turn| turn.0 <= percent / 100.0 * end);
    let selected = plan.turns[..taken].last().map_or(0, |turn| turn.1);
    100.0 * selected as f64 / plan.fillable_spots as f64
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
        "selected_percent_by_computing_time_mean",
    ]);
    let mut panels = Vec::new();
    for contender in CONTENDERS.into_iter().rev() {
        let mut said = Vec::new();
        let mut computed = Vec::new();
        for (position, &size) in sizes.iter().enumerate() {
            let runs = protocols(settings, store, contender, |seed| instance(size, seed));
            let plans = plans(settings, store, contender, |seed| instance(size, seed));
            let (mut said_points, mut computed_points) = (Vec::new(), Vec::new());
            for percent in moments() {
                let selected = sample(&runs, |run| selected_after(run, percent));
                let by_computing = sample(&plans, |plan| computed_after(plan, percent));
                table.row(vec![
                    contender.key().to_owned(),
                    size.to_string(),
                    runs.len().to_string(),
                    exact(percent),
                    exact(selected.mean),
                    exact(selected.deviation),
                    exact(sample(&runs, |run| settled_after(run, percent)).mean),
                    exact(by_computing.mean),
                ]);
                said_points.push(Point::new(percent, selected.mean));
                computed_points.push(Point::new(percent, by_computing.mean));
            }
            let series = |points| Series {
                name: format!("{size} modules"),
                look: Look::of_step(position, sizes.len()).with_marker_every(4),
                points,
            };
            said.push(series(said_points));
            computed.push(series(computed_points));
        }
        for (what, axis, mut series) in [
            (
                "in the protocol",
                "simulated planning time elapsed (%)",
                said,
            ),
            ("in the core", "computing time elapsed (%)", computed),
        ] {
            let looks = [Marker::Diamond, Marker::Cross].map(|marker| Look {
                marker,
                ..Look::stated()
            });
            for (&(size, time, done), look) in stated.iter().zip(looks) {
                if sizes.contains(&size) {
                    series.push(Series {
                        name: format!("paper: {size} modules"),
                        look,
                        points: vec![Point::new(time, done)],
                    });
                }
            }
            panels.push(Panel {
                title: format!("{}, {what}", contender.label()),
                x: Axis::percent(axis),
                y: Axis::percent("spots selected (%)"),
                series,
            });
        }
    }
    let mut summary = Table::new(&[
        "modules",
        "of the time",
        "paper, completed",
        "paper policy, protocol",
        "ours, protocol",
        "paper policy, computing",
        "ours, computing",
    ]);
    for &(size, time, done) in stated.iter().filter(|one| sizes.contains(&one.0)) {
        let mut row = vec![size.to_string(), format!("{time} %"), format!("{done} %")];
        for contender in CONTENDERS {
            let runs = protocols(settings, store, contender, |seed| instance(size, seed));
            let selected = sample(&runs, |run| selected_after(run, time));
            row.push(format!("{} %", selected.with_deviation()));
        }
        for contender in CONTENDERS {
            let plans = plans(settings, store, contender, |seed| instance(size, seed));
            let selected = sample(&plans, |plan| computed_after(plan, time));
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
            "In the protocol: recorded claim by claim in the simulator, from the roster until the last module has applied \
             the last claim; messages take 0.2 to 5 ms there and computing takes no time, so a turn takes as long whether a \
             singleton or a configuration decides. In the core: recorded turn by turn in computing time, which is what the \
             paper's axis must be, as it ran on one PC. At the points that the paper states:\n\n{}",
            summary.to_markdown()
        ),
    }
}
