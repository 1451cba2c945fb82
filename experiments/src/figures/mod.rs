//! The experiments: each makes one CSV file, one plot and one section of the summary.

mod auction;
mod case_studies;
mod completion;
mod disconnected;
mod matching;
mod messages;
mod processes;
mod scaling;

use crate::cell::Cell;
use crate::contender::Contender;
use crate::instance::{Docked, Instance};
use crate::measure::plan::PlanMeasurement;
use crate::measure::protocol::ProtocolMeasurement;
use crate::plot::{Plot, Point};
use crate::sample::Sample;
use crate::settings::Settings;
use crate::store::Store;
use crate::table::Table;

/// One figure or table.
pub(crate) struct Experiment {
    /// Its name on the command line and of its files.
    pub name: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// Where the paper shows it.
    pub source: &'static str,
    /// What must be measured.
    pub cells: fn(&Settings) -> Vec<Cell>,
    /// What came out, once all is measured.
    pub report: fn(&Settings, &Store) -> Report,
}

/// What came out of an experiment.
pub(crate) struct Report {
    pub table: Table,
    pub plot: Plot,
    /// Markdown for the summary.
    pub text: String,
}

/// All experiments in the order of the paper; those with real processes last.
pub(crate) const EXPERIMENTS: [Experiment; 15] = [
    matching::TIME,
    scaling::PLANNING_TIME,
    scaling::DISTANCE,
    messages::MESSAGES,
    completion::COMPLETION,
    messages::OVER_TIME,
    completion::FEW_SPOTS,
    messages::FEW_SPOTS,
    disconnected::DISCONNECTED,
    auction::TIME,
    auction::DISTANCE,
    auction::MESSAGES,
    auction::COMPLETION,
    case_studies::CASE_STUDIES,
    processes::PROCESSES,
];

/// Mixed instances with a spot for each module.
pub(crate) fn mixed(modules: usize, seed: u64) -> Instance {
    Instance::Generated {
        modules,
        spots: modules,
        docked: Docked::Mixed,
        seed,
    }
}

/// Mixed instances with fewer spots than modules.
pub(crate) fn surplus(settings: &Settings, modules: usize, seed: u64) -> Instance {
    Instance::Generated {
        modules,
        spots: settings.few_spots(),
        docked: Docked::Mixed,
        seed,
    }
}

/// Singletons with a spot for each.
pub(crate) fn singletons(modules: usize, seed: u64) -> Instance {
    Instance::Generated {
        modules,
        spots: modules,
        docked: Docked::Singletons,
        seed,
    }
}

/// As many modules as spots, all in configurations of one size.
pub(crate) fn equal(settings: &Settings, docked: Docked, seed: u64) -> Instance {
    let modules = settings.full_size();
    Instance::Generated {
        modules,
        spots: modules,
        docked,
        seed,
    }
}

/// The plans of one contender for instances that differ in their seeds alone.
pub(crate) fn plans<'a>(
    settings: &Settings,
    store: &'a Store,
    contender: Contender,
    instance: impl Fn(u64) -> Instance,
) -> Vec<&'a PlanMeasurement> {
    let seeds = settings.seeds().into_iter();
    seeds
        .filter_map(|seed| store.plan(Cell::Plan(instance(seed), contender)))
        .collect()
}

/// The protocol's runs of one contender for instances that differ in their seeds alone.
pub(crate) fn protocols<'a>(
    settings: &Settings,
    store: &'a Store,
    contender: Contender,
    instance: impl Fn(u64) -> Instance,
) -> Vec<&'a ProtocolMeasurement> {
    let seeds = settings.seeds().into_iter();
    seeds
        .filter_map(|seed| store.protocol(Cell::Protocol(instance(seed), contender)))
        .collect()
}

/// One number of several measurements.
pub(crate) fn sample<T>(measurements: &[&T], value: impl Fn(&T) -> f64) -> Sample {
    Sample::of(measurements.iter().map(|measurement| value(measurement)))
}

/// A point at a mean, with its deviation.
fn point(x: f64, sample: Sample) -> Point {
    Point {
        x,
        y: sample.mean,
        deviation: sample.deviation,
    }
}

/// The cells of every seed for each of some contenders.
fn cells_of(
    settings: &Settings,
    contenders: &[Contender],
    instance: impl Fn(u64) -> Instance,
    cell: fn(Instance, Contender) -> Cell,
) -> Vec<Cell> {
    let mut cells = Vec::new();
    for seed in settings.seeds() {
        for &contender in contenders {
            cells.push(cell(instance(seed), contender));
        }
    }
    cells
}
