//! Planning time of real processes over DDS.

use super::{Experiment, Report, mixed, point, sample};
use crate::cell::Cell;
use crate::contender::Contender;
use crate::measure::processes::ProcessMeasurement;
use crate::plot::{Axis, Look, Marker, Panel, Plot, Series, colour};
use crate::sample::exact;
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
        "planning_ms_mean",
        "planning_ms_std",
        "discovery_ms_mean",
        "core_ms_mean",
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
    let (mut over_dds, mut core) = (Vec::new(), Vec::new());
    for (place, (modules, per_process)) in settings.process_sizes().into_iter().enumerate() {
        let processes = modules.div_ceil(per_process);
        names.push(format!("{modules} on {processes}"));
        let cells: Vec<&ProcessMeasurement> = settings
            .process_seeds()
            .into_iter()
            .filter_map(|seed| store.processes(cell(modules, per_process, seed)))
            .collect();
        let planning = sample(&cells, |cell| cell.planning_ms as f64);
        let discovery = sample(&cells, |cell| cell.discovery_ms as f64);
        let alone = sample(&cells, |cell| cell.core_us as f64 / 1e3);
        table.row(vec![
            modules.to_string(),
            processes.to_string(),
            cells.len().to_string(),
            exact(planning.mean),
            exact(planning.deviation),
            exact(discovery.mean),
            exact(alone.mean),
        ]);
        summary.row(vec![
            modules.to_string(),
            processes.to_string(),
            cells.len().to_string(),
            planning.with_deviation(),
            alone.short(),
            discovery.short(),
        ]);
        over_dds.push(point(place as f64, planning));
        core.push(point(place as f64, alone));
    }
    let plot = Plot {
        title: "Planning time of real processes over DDS, mixed instances".to_owned(),
        panels: vec![Panel {
            title: String::new(),
            x: Axis::names("modules on processes", names),
            y: Axis::logarithmic("planning time (ms)"),
            series: vec![
                Series {
                    name: "ours, DDS".to_owned(),
                    look: Contender::Ours.look(),
                    points: over_dds,
                },
                Series {
                    name: "ours, core alone".to_owned(),
                    look: Look::new(colour::SKY, Marker::Triangle),
                    points: core,
                },
            ],
        }],
    };
    Report {
        table,
        plot,
        text: format!(
            "`formation run --plan-only --json`: from the roster until the last claim was applied, on loopback of one \
             machine. Each cell starts all processes anew, so there are at most three runs of each. The paper \
             policy is not run: the launcher starts no processes for a plan with a hole, and the paper policy leaves some.\n\n{}",
            summary.to_markdown()
        ),
    }
}
