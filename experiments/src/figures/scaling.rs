//! Figures 4(b) and 5(a): planning time and distance against the number of modules.

use super::{Experiment, Report, cells_of, mixed, plans, point, sample};
use crate::cell::Cell;
use crate::contender::Contender;
use crate::measure::plan::PlanMeasurement;
use crate::plot::{Axis, Panel, Plot, Series};
use crate::sample::exact;
use crate::settings::Settings;
use crate::store::Store;
use crate::table::Table;

pub(super) const PLANNING_TIME: Experiment = Experiment {
    name: "planning_time",
    title: "Planning time against the number of modules",
    source: "Figure 4(b)",
    cells,
    report: planning_time,
};

pub(super) const DISTANCE: Experiment = Experiment {
    name: "distance",
    title: "Distance travelled against the number of modules",
    source: "Figure 5(a)",
    cells,
    report: distance,
};

const CONTENDERS: [Contender; 3] = [
    Contender::PaperPolicy,
    Contender::Ours,
    Contender::OursSizeFirst,
];

fn cells(settings: &Settings) -> Vec<Cell> {
    let sizes = settings.sizes().into_iter();
    sizes
        .flat_map(|size| cells_of(settings, &CONTENDERS, |seed| mixed(size, seed), Cell::Plan))
        .collect()
}

fn planning_time(settings: &Settings, store: &Store) -> Report {
    let (table, summary, series) = collect(
        settings,
        store,
        ["planning_ms_mean", "planning_ms_std"],
        |plan| plan.planning_us / 1e3,
    );
    Report {
        table,
        plot: Plot {
            title: "Planning time of the core, mixed instances".to_owned(),
            panels: vec![Panel {
                title: String::new(),
                x: Axis::from_zero("modules (as many spots)"),
                y: Axis::logarithmic("planning time (ms)"),
                series,
            }],
        },
        text: format!(
            "Milliseconds, mean ± standard deviation; every turn computed by one core, one after another. The paper gives \
             this figure's numbers as a figure only; its abstract says \"order of msec for 100 modules\", its table 167 to \
             218 ms.\n\n{}",
            summary.to_markdown()
        ),
    }
}

fn distance(settings: &Settings, store: &Store) -> Report {
    let (table, summary, series) = collect(
        settings,
        store,
        ["distance_units_mean", "distance_units_std"],
        |plan| plan.distance,
    );
    Report {
        table,
        plot: Plot {
            title: "Distance travelled, mixed instances".to_owned(),
            panels: vec![Panel {
                title: String::new(),
                x: Axis::from_zero("modules (as many spots)"),
                y: Axis::from_zero("sum of all ways (units)"),
                series,
            }],
        },
        text: format!(
            "Units, mean ± standard deviation: the sum of the straight ways from the initial poses to the spots. Modules that \
             the paper policy leaves without a spot travel nothing, which its sum does not show; the last column sets \
             the sums against the spots that were filled.\n\n{}",
            summary.to_markdown()
        ),
    }
}

/// A table for programs, one for people, and the curves of one number.
fn collect(
    settings: &Settings,
    store: &Store,
    [mean_name, deviation_name]: [&str; 2],
    value: impl Fn(&PlanMeasurement) -> f64,
) -> (Table, Table, Vec<Series>) {
    let mut table = Table::new(&[
        "modules",
        "spots",
        "contender",
        "runs",
        mean_name,
        deviation_name,
        "filled_spots_mean",
        "per_filled_spot_mean",
    ]);
    let mut summary = Table::new(&[
        "modules",
        "paper",
        "paper policy",
        "ours",
        "ours, size first",
        "a filled spot: paper policy / ours",
    ]);
    let mut series: Vec<Series> = CONTENDERS
        .iter()
        .map(|contender| contender.series(Vec::new()))
        .collect();
    for size in settings.sizes() {
        let mut row = vec![size.to_string(), "figure only".to_owned()];
        let mut shares = Vec::new();
        for (contender, series) in CONTENDERS.iter().zip(&mut series) {
            let plans = plans(settings, store, *contender, |seed| mixed(size, seed));
            let whole = sample(&plans, &value);
            let filled = sample(&plans, |plan| plan.filled_spots as f64);
            let share = whole.mean / filled.mean;
            table.row(vec![
                size.to_string(),
                size.to_string(),
                contender.key().to_owned(),
                plans.len().to_string(),
                exact(whole.mean),
                exact(whole.deviation),
                exact(filled.mean),
                exact(share),
            ]);
            row.push(whole.with_deviation());
            shares.push(format!("{share:.3}"));
            series.points.push(point(size as f64, whole));
        }
        shares.truncate(2);
        row.push(shares.join(" / "));
        summary.row(row);
    }
    (table, summary, series)
}
