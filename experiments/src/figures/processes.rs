//! Planning time of real processes over DDS.

use super::{Column, Data, Figure, Group, Kind, Row, Value, averages, mixed, texts};
use crate::contender::Contender;
use crate::sample::short;
use crate::settings::ExperimentSettings;
use crate::table::Table;

const PLANNING_MS: Value = Value::Processes(|run| run.planning_ms as f64);
const DISCOVERY_MS: Value = Value::Processes(|run| run.discovery_ms as f64);
const CORE_MS: Value = Value::Processes(|run| run.core_us as f64 / 1e3);

pub(super) const PROCESSES: Figure = Figure {
    name: "processes",
    title: "Planning time of real processes over DDS",
    kinds: &[Kind::Processes],
    keys: "modules | processes",
    rows,
    files: &[(
        "processes",
        &[
            Column::Runs,
            Column::MedianAndRange("planning_ms", PLANNING_MS),
            Column::Median("discovery_ms", DISCOVERY_MS),
            Column::Median("core_ms", CORE_MS),
        ],
    )],
    tables: |figure, data| {
        let mut tables = averages(figure, data);
        tables.push(("processes_runs", each_run(data)));
        tables
    },
    results: |data| vec![("processes", results(data))],
};

/// Ours by modules and processes. The paper policy is left out, because some of its plans have holes, and a run of such
/// a plan ends FAILED.
fn rows(settings: &ExperimentSettings) -> Vec<Row> {
    let sizes = settings.process_sizes().iter();
    let row = |&(modules, modules_per_process): &(usize, usize)| {
        let seeds = settings.process_seeds().into_iter();
        let instances = seeds.map(|seed| mixed(settings, modules, seed)).collect();
        Row {
            keys: texts(&[&modules, &modules.div_ceil(modules_per_process)]),
            group: Group {
                modules_per_process,
                ..Group::new(Contender::Ours, instances)
            },
        }
    };
    sizes.map(row).collect()
}

/// One line for each run.
fn each_run(data: &Data<'_>) -> Table {
    let mut table = Table::new("modules | processes | seed | planning_ms");
    for Row { keys, group } in rows(data.settings) {
        let seeds = data.settings.process_seeds().into_iter();
        for (seed, planning_ms) in seeds.zip(data.values(&group, PLANNING_MS)) {
            table.row([&keys[..], &texts(&[&seed, &planning_ms])].concat());
        }
    }
    table
}

fn results(data: &Data<'_>) -> Table {
    let heads =
        "modules | processes | runs | planning over DDS, ms | core alone, ms | discovery, ms";
    Table::of(heads, rows(data.settings), |Row { mut keys, group }| {
        keys.extend([
            data.runs(&group, Kind::Processes).to_string(),
            data.spread(&group, PLANNING_MS).with_range(),
            short(data.spread(&group, CORE_MS).median),
            data.spread(&group, DISCOVERY_MS).with_range(),
        ]);
        keys
    })
}
