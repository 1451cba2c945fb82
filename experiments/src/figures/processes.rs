//! Planning time of real processes over DDS.

use super::{Experiment, Report, mixed, point};
use crate::cell::Cell;
use crate::contender::Contender;
use crate::measure::processes::ProcessMeasurement;
use crate::plot::{Axis, Look, Marker, Panel, Plot, Point, Series, colour};
use crate::sample::{Sample, exact};
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

const CONTENDERS: [Contender; 2] = [Contender::PaperPolicy, Contender::Ours];

fn cell(modules: usize, modules_per_process: usize, seed: u64, contender: Contender) -> Cell {
    Cell::Processes {
        instance: mixed(modules, seed),
        contender,
        modules_per_process,
    }
}

fn cells(settings: &Settings) -> Vec<Cell> {
    let mut cells = Vec::new();
    for (modules, modules_per_process) in settings.process_sizes() {
        for seed in settings.process_seeds() {
            for contender in CONTENDERS {
                cells.push(cell(modules, modules_per_process, seed, contender));
            }
        }
    }
    cells
}

fn report(settings: &Settings, store: &Store) -> Report {
    let mut table = Table::new(&[
        "modules",
        "processes",
        "contender",
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
        "paper policy, ms",
        "ours, ms",
        "ours, core alone, ms",
        "discovery, ms",
    ]);
    let mut names = Vec::new();
    let mut curves: [Vec<Point>; 2] = Default::default();
    let mut core = Vec::new();
    for (place, (modules, per_process)) in settings.process_sizes().into_iter().enumerate() {
        let processes = modules.div_ceil(per_process);
        names.push(format!("{modules} on {processes}"));
        let mut row = vec![modules.to_string(), processes.to_string()];
        let mut shown = Vec::new();
        for (contender, curve) in CONTENDERS.into_iter().zip(&mut curves) {
            let cells: Vec<&ProcessMeasurement> = settings
                .process_seeds()
                .into_iter()
                .filter_map(|seed| store.processes(cell(modules, per_process, seed, contender)))
                .collect();
            let of = |value: fn(&ProcessMeasurement) -> f64| {
                Sample::of(cells.iter().map(|cell| value(cell)))
            };
            let planning = of(|cell| cell.planning_ms as f64);
            let discovery = of(|cell| cell.discovery_ms as f64);
            let alone = of(|cell| cell.core_us as f64 / 1e3);
            table.row(vec![
                modules.to_string(),
                processes.to_string(),
                contender.key().to_owned(),
                cells.len().to_string(),
                exact(planning.mean),
                exact(planning.deviation),
                exact(discovery.mean),
                exact(alone.mean),
            ]);
            if shown.is_empty() {
                row.push(cells.len().to_string());
            }
            shown.push(planning.with_deviation());
            curve.push(point(place as f64, planning));
            if contender == Contender::Ours {
                shown.push(alone.short());
                shown.push(discovery.short());
                core.push(point(place as f64, alone));
            }
        }
        row.extend(shown);
        summary.row(row);
    }
    let [paper_policy, ours] = curves;
    let plot = Plot {
        title: "Planning time of real processes over DDS, mixed instances".to_owned(),
        panels: vec![Panel {
            title: String::new(),
            x: Axis::names("modules on processes", names),
            y: Axis::logarithmic("planning time (ms)"),
            series: vec![
                Series {
                    name: "paper policy, DDS".to_owned(),
                    look: Contender::PaperPolicy.look(),
                    points: paper_policy,
                },
                Series {
                    name: "ours, DDS".to_owned(),
                    look: Contender::Ours.look(),
                    points: ours,
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
             machine. Each cell starts all processes anew, so there are at most three runs of each.\n\n{}",
            summary.to_markdown()
        ),
    }
}
