//! Formations of real processes in the physical world, at several values of slip and noise.

use super::{Column, Data, Figure, Group, Kind, Row, Value, apart, averages, texts};
use crate::contender::Contender;
use crate::instance::Instance;
use crate::measure::world::World;
use crate::sample::short;
use crate::settings::ExperimentSettings;
use crate::table::Table;

/// The number of modules in each process.
const MODULES_PER_PROCESS: usize = 5;

const COMPLETE: Value = Value::World(|run| f64::from(u8::from(run.complete)));
const FILLED: Value = Value::World(|run| f64::from(u8::from(run.open_spots == 0)));
/// Of complete runs.
const ACTING_S: Value = Value::World(|run| match run.acting_ms {
    Some(acting_ms) if run.complete => acting_ms as f64 / 1e3,
    _ => f64::NAN,
});
const CONTACTS: Value = Value::World(|run| run.contacts as f64);
const ABOVE_TOUCH: Value = Value::World(|run| run.contacts_above_touch as f64);

pub(super) const PHYSICAL_WORLD: Figure = Figure {
    name: "physical_world",
    title: "Formations in a physical world",
    kinds: &[Kind::World],
    keys: "scenario | slip | noise",
    rows,
    files: &[(
        "physical_world",
        &[
            Column::Runs,
            Column::Mean("complete", COMPLETE),
            Column::Mean("filled", FILLED),
            Column::MedianAndRange("acting_s", ACTING_S),
            Column::Mean("contacts", CONTACTS),
            Column::Mean("contacts_above_touch", ABOVE_TOUCH),
        ],
    )],
    tables: averages,
    results: |data| vec![("physical_world", results(data))],
};

fn rows(settings: &ExperimentSettings) -> Vec<Row> {
    let singles = settings.world_singletons();
    let mut rows = Vec::new();
    for scenario in ["Figure 1".to_owned(), format!("{singles} singletons")] {
        for &(slip_percent, noise_thousandths, runs) in settings.worlds() {
            let world = World {
                slip_percent,
                noise_thousandths,
                seed: settings.seed,
            };
            let seeds = settings.seed..settings.seed.saturating_add(runs);
            let instance = |seed| match scenario.as_str() {
                "Figure 1" => Instance::Ladder,
                _ => apart(settings, singles, seed),
            };
            rows.push(Row {
                keys: texts(&[&scenario, &world.slip(), &world.noise()]),
                group: Group {
                    modules_per_process: MODULES_PER_PROCESS,
                    world: Some(world),
                    ..Group::new(Contender::Ours, seeds.map(instance).collect())
                },
            });
        }
    }
    rows
}

fn results(data: &Data<'_>) -> Table {
    let heads = "scenario | slip | noise | runs | COMPLETE | all spots filled | acting, s (median) | contacts | \
        above a touch";
    Table::of(heads, rows(data.settings), |Row { mut keys, group }| {
        let sum = |value| data.values(&group, value).iter().sum::<f64>();
        let acting = match data.values(&group, ACTING_S)[..] {
            [] => String::new(),
            _ => short(data.spread(&group, ACTING_S).median),
        };
        keys.extend(texts(&[
            &data.runs(&group, Kind::World),
            &sum(COMPLETE),
            &sum(FILLED),
            &acting,
            &sum(CONTACTS),
            &sum(ABOVE_TOUCH),
        ]));
        keys
    })
}
