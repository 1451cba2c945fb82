//! Planning time of real processes over DDS.

use super::{Experiment, Report, mixed};
use crate::cell::Cell;
use crate::contender::Contender;
use crate::measure::processes::ProcessMeasurement;
use crate::plot::{Axis, Line, Look, Marker, Panel, Plot, Point, Series, colour};
use crate::sample::{Spread, exact, short};
use crate::settings::Settings;
use crate::store::Store;
use crate::table::Table;

pub(super) const PROCESSES: Experiment = Experiment {
    name: "processes",
    title: "Planning time of real processes over DDS",
    source: "no figure of the paper; it ran on one PC without a network",
    cells,
    report,
};

/// How far the single runs are drawn from their median.
const BESIDE: f64 = 0.12;

/// The paper policy leaves holes in some plans, and the launcher starts no processes for a plan with a hole.
fn cell(modules: usize, modules_per_process: usize, seed: u64) -> Cell {
    Cell::Processes {
        instance: mixed(modules, seed),
        contender: Contender::Ours,
        modules_per_process,
    }
}

fn cells(settings: &Settings) -> Vec<Cell> {
    let mut cells = Vec::new();
    for (modules, modules_per_process) in settings.process_sizes() {
        for seed in settings.process_seeds() {
            cells.push(cell(modules, modules_per_process, seed));
        }
    }
    cells
}

fn report(settings: &Settings, store: &Store) -> Report {
    let mut table = Table::new(&[
        "modules",
        "processes",
        "runs",
        "planning_ms_median",
        "planning_ms_least",
        "planning_ms_greatest",
        "discovery_ms_median",
        "core_ms_median",
    ]);
    let mut summary = Table::new(&[
        "modules",
        "processes",
        "runs",
        "planning over DDS, ms",
        "core alone, ms",
        "discovery, ms",
    ]);
    let mut names = Vec::new();
    let (mut over_dds, mut each, mut core) = (Vec::new(), Vec::new(), Vec::new());
    for (place, (modules, per_process)) in settings.process_sizes().into_iter().enumerate() {
        let processes = modules.div_ceil(per_process);
        names.push(format!("{modules} on {processes}"));
        let cells: Vec<&ProcessMeasurement> = settings
            .process_seeds()
            .into_iter()
            .filter_map(|seed| store.processes(cell(modules, per_process, seed)))
            .collect();
        let spread = |value: fn(&ProcessMeasurement) -> f64| {
            Spread::of(cells.iter().map(|cell| value(cell)))
        };
        let planning = spread(|cell| cell.planning_ms as f64);
        let discovery = spread(|cell| cell.discovery_ms as f64);
        let alone = spread(|cell| cell.core_us as f64 / 1e3);
        table.row(vec![
            modules.to_string(),
            processes.to_string(),
            cells.len().to_string(),
            exact(planning.median),
            exact(planning.least),
            exact(planning.greatest),
            exact(discovery.median),
            exact(alone.median),
        ]);
        summary.row(vec![
            modules.to_string(),
            processes.to_string(),
            cells.len().to_string(),
            planning.with_range(),
            short(alone.median),
            discovery.with_range(),
        ]);
        let place = place as f64;
        for cell in cells {
            each.push(Point::new(place + BESIDE, cell.planning_ms as f64));
        }
        over_dds.push(Point::new(place, planning.median));
        core.push(Point::new(place, alone.median));
    }
    // Without lines: what stands beside each other differs in more than one thing.
    let apart = |name: &str, look: Look, points| Series {
        name: name.to_owned(),
        look: look.with_line(Line::None),
        points,
    };
    let every_run = Look {
        opacity: 0.6,
        ..Look::new(colour::BLUE, Marker::Cross)
    };
    let plot = Plot {
        title: "Planning time of real processes over DDS, mixed instances".to_owned(),
        panels: vec![Panel {
            title: String::new(),
            x: Axis::names("modules on processes", names),
            y: Axis::logarithmic("planning time (ms)"),
            series: vec![
                apart("ours over DDS, median", Contender::Ours.look(), over_dds),
                apart("ours over DDS, each run", every_run, each),
                apart(
                    "ours, core alone, median",
                    Look::new(colour::SKY, Marker::Triangle),
                    core,
                ),
            ],
        }],
    };
    Report {
        table,
        plot,
        text: format!(
            "`formation run --plan-only --json`: from the roster until the last claim was applied, on loopback of one \
             machine; medians, least and greatest. Each run starts all processes anew. The paper policy is not run: the \
             launcher starts no processes for a plan with a hole, and the paper policy leaves some.\n\n{}",
            summary.to_markdown()
        ),
    }
}
