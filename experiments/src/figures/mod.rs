//! The figures: each is a list of rows, the columns of its CSV file, and a section of the summary.

mod case_studies;
mod completion;
mod cut_price;
mod disconnected;
mod fewer_spots;
mod matching;
mod messages;
mod processes;
mod scaling;
mod world;

use std::iter;

use crate::cell::{Cell, Counts, Kind, Times};
use crate::contender::Contender;
use crate::instance::{Docked, Draw, Instance};
use crate::measure::matching::{MatchingCounts, MatchingTimes};
use crate::measure::plan::{PlanCounts, PlanTimes};
use crate::measure::processes::ProcessMeasurement;
use crate::measure::talk::Talk;
use crate::measure::world::World;
use crate::measure::world::WorldMeasurement;
use crate::sample::{Sample, Spread, exact};
use crate::settings::ExperimentSettings;
use crate::store::Store;
use crate::table::Table;

/// The maximum number of runs in the simulator for each row: a run of 100 agents takes a second, a plan a millisecond.
const TALK_RUNS_MAX: usize = 20;

/// Tables by name: of a CSV file, or of a part of the page.
pub(crate) type Tables = Vec<(&'static str, Table)>;

/// One figure or table of the evaluation.
pub(crate) struct Figure {
    /// Its name on the command line and of its plot.
    pub name: &'static str,
    /// What it shows, and where the paper does.
    pub title: &'static str,
    /// The kinds of cell that every row averages over; the first one counts the runs.
    kinds: &'static [Kind],
    /// The heads of the columns that name a row.
    keys: &'static str,
    /// The rows of the CSV files.
    rows: fn(&ExperimentSettings) -> Vec<Row>,
    /// The columns of each CSV file after the keys. No file has both times and other numbers.
    files: &'static [(&'static str, &'static [Column])],
    /// The CSV files; [`averages`] for all figures that need no other.
    pub tables: fn(&Figure, &Data<'_>) -> Tables,
    /// The tables that the page shows. None has both times and other numbers.
    pub results: fn(&Data<'_>) -> Tables,
}

/// All figures in the order of the paper; those with real processes last.
pub(crate) const FIGURES: [Figure; 18] = [
    matching::TIME,
    scaling::PLANNING_TIME,
    scaling::DISTANCE,
    fewer_spots::FEWER_SPOTS,
    messages::MESSAGES,
    completion::COMPLETION,
    messages::OVER_TIME,
    completion::FEW_SPOTS,
    messages::FEW_SPOTS,
    disconnected::DISCONNECTED,
    scaling::AUCTION_TIME,
    scaling::AUCTION_DISTANCE,
    messages::AUCTION,
    completion::AUCTION,
    case_studies::CASE_STUDIES,
    cut_price::CUT_PRICE,
    processes::PROCESSES,
    world::PHYSICAL_WORLD,
];

impl Figure {
    /// The cells that must be measured.
    pub(crate) fn cells(&self, settings: &ExperimentSettings) -> Vec<Cell> {
        let mut cells = Vec::new();
        for row in (self.rows)(settings) {
            for &kind in self.kinds {
                cells.extend(row.group.cells(kind));
            }
        }
        cells
    }
}

/// The CSV files with a line for each row.
fn averages(figure: &Figure, data: &Data<'_>) -> Tables {
    let of_file = |&(name, columns): &(&'static str, &'static [Column])| {
        let heads =
            iter::once(figure.keys.to_owned()).chain(columns.iter().flat_map(Column::heads));
        let heads: Vec<String> = heads.collect();
        let table = Table::of(&heads.join(" | "), (figure.rows)(data.settings), |row| {
            let numbers = columns.iter();
            let numbers =
                numbers.flat_map(|column| column.numbers(data, &row.group, figure.kinds[0]));
            row.keys.into_iter().chain(numbers.map(exact)).collect()
        });
        (name, table)
    };
    figure.files.iter().map(of_file).collect()
}

/// One row of a CSV file.
struct Row {
    keys: Vec<String>,
    group: Group,
}

/// Instances that differ only in their seeds, and the contender that plans them. Numbers are averages over a group.
#[derive(Clone)]
pub(crate) struct Group {
    contender: Contender,
    instances: Vec<Instance>,
    /// The part of the planning time at which curves are read, in per cent.
    percent: f64,
    modules_per_process: usize,
    /// The world of the first instance; those of the others have the following seeds.
    world: Option<World>,
}

impl Group {
    pub(crate) fn new(contender: Contender, instances: Vec<Instance>) -> Self {
        Self {
            contender,
            instances,
            percent: 100.0,
            modules_per_process: 1,
            world: None,
        }
    }

    /// One instance of a family for each seed of the settings.
    pub(crate) fn of(
        settings: &ExperimentSettings,
        family: Family,
        size: usize,
        contender: Contender,
    ) -> Self {
        let seeds = settings.seeds().into_iter();
        let instances = seeds.map(|seed| family(settings, size, seed));
        Self::new(contender, instances.collect())
    }

    fn at(&self, percent: f64) -> Self {
        Self {
            percent,
            ..self.clone()
        }
    }

    fn cells(&self, kind: Kind) -> impl Iterator<Item = Cell> {
        let runs = match kind {
            Kind::Talk => TALK_RUNS_MAX,
            _ => usize::MAX,
        };
        let numbered = (0..).zip(self.instances.iter().take(runs));
        numbered.map(move |(number, &instance)| Cell {
            kind,
            instance,
            contender: self.contender,
            modules_per_process: self.modules_per_process,
            world: self.world.map(|world| World {
                seed: world.seed + number,
                ..world
            }),
        })
    }
}

/// An instance by a size and a seed.
pub(crate) type Family = fn(&ExperimentSettings, usize, u64) -> Instance;

fn generated(modules: usize, spots: usize, docked: Docked, seed: u64) -> Instance {
    Instance::Generated(Draw {
        modules,
        spots,
        docked,
        seed,
    })
}

/// Mixed instances with a spot for each module.
pub(crate) fn mixed(_: &ExperimentSettings, modules: usize, seed: u64) -> Instance {
    generated(modules, modules, Docked::Mixed, seed)
}

/// Mixed instances with fewer spots than modules.
pub(crate) fn surplus(settings: &ExperimentSettings, modules: usize, seed: u64) -> Instance {
    generated(modules, settings.few_spots(), Docked::Mixed, seed)
}

/// Singletons with a spot for each.
pub(crate) fn singletons(_: &ExperimentSettings, modules: usize, seed: u64) -> Instance {
    generated(modules, modules, Docked::Singletons, seed)
}

/// Singletons with a spot for each, as robots have them.
fn apart(_: &ExperimentSettings, modules: usize, seed: u64) -> Instance {
    generated(modules, modules, Docked::Apart, seed)
}

/// As many modules as spots, all in configurations of one size on lattice trees.
pub(crate) fn lattice(settings: &ExperimentSettings, size: usize, seed: u64) -> Instance {
    let modules = settings.full_size();
    generated(modules, modules, Docked::Lattice(size), seed)
}

/// As many modules as spots, all in configurations of one size on uniform labelled trees.
pub(crate) fn labelled(settings: &ExperimentSettings, size: usize, seed: u64) -> Instance {
    let modules = settings.full_size();
    generated(modules, modules, Docked::Labelled(size), seed)
}

/// A number of one result; the second argument of the curves is the group's part of the planning time in per cent.
#[derive(Clone, Copy)]
pub(crate) enum Value {
    Matching(fn(&MatchingCounts) -> f64),
    MatchingTime(fn(&MatchingTimes) -> f64),
    Plan(fn(&PlanCounts) -> f64),
    PlanTime(fn(&PlanTimes) -> f64),
    PlanCurve(fn(&PlanTimes, f64) -> f64),
    Talk(fn(&Talk) -> f64),
    TalkCurve(fn(&Talk, f64) -> f64),
    Processes(fn(&ProcessMeasurement) -> f64),
    World(fn(&WorldMeasurement) -> f64),
}

const PLANNING_MS: Value = Value::PlanTime(|plan| plan.planning_us / 1e3);
const DISTANCE: Value = Value::Plan(|plan| plan.distance);
const UTILITY: Value = Value::Plan(|plan| plan.utility);
const FILLED_SPOTS: Value = Value::Plan(|plan| plan.filled_spots as f64);
const BROKEN_LINKS: Value = Value::Plan(|plan| plan.links.broken as f64);

impl Value {
    fn kind(self) -> Kind {
        match self {
            Self::Matching(_) | Self::MatchingTime(_) => Kind::Matching,
            Self::Plan(_) | Self::PlanTime(_) | Self::PlanCurve(_) => Kind::Plan,
            Self::Talk(_) | Self::TalkCurve(_) => Kind::Talk,
            Self::Processes(_) => Kind::Processes,
            Self::World(_) => Kind::World,
        }
    }

    /// Whether the clock decides it.
    pub(crate) fn is_timed(self) -> bool {
        match self {
            Self::Matching(_) | Self::Plan(_) | Self::Talk(_) | Self::TalkCurve(_) => false,
            Self::MatchingTime(_)
            | Self::PlanTime(_)
            | Self::PlanCurve(_)
            | Self::Processes(_)
            | Self::World(_) => true,
        }
    }

    fn of(self, store: &Store, cell: Cell, percent: f64) -> Option<f64> {
        if self.is_timed() {
            self.of_times(store.times(cell)?, percent)
        } else {
            self.of_counts(store.counts(cell)?, percent)
        }
    }

    fn of_counts(self, counts: &Counts, percent: f64) -> Option<f64> {
        Some(match (self, counts) {
            (Self::Matching(value), Counts::Matching(matching)) => value(matching),
            (Self::Plan(value), Counts::Plan(plan)) => value(plan),
            (Self::Talk(value), Counts::Talk(talk)) => value(talk),
            (Self::TalkCurve(value), Counts::Talk(talk)) => value(talk, percent),
            _ => return None,
        })
    }

    fn of_times(self, times: &Times, percent: f64) -> Option<f64> {
        Some(match (self, times) {
            (Self::MatchingTime(value), Times::Matching(matching)) => value(matching),
            (Self::PlanTime(value), Times::Plan(plan)) => value(plan),
            (Self::PlanCurve(value), Times::Plan(plan)) => value(plan, percent),
            (Self::Processes(value), Times::Processes(processes)) => value(processes),
            (Self::World(value), Times::World(world)) => value(world),
            _ => return None,
        })
    }
}

/// One or more columns of a CSV file, each a number of the row's group. Heads are made of the name and the statistic.
enum Column {
    /// The number of runs.
    Runs,
    /// The group's part of the planning time.
    Percent,
    /// The number of a group that has one run.
    Single(&'static str, Value),
    Mean(&'static str, Value),
    /// The mean and the standard deviation.
    MeanAndDeviation(&'static str, Value),
    /// The first mean divided by the second.
    Ratio(&'static str, Value, Value),
    Median(&'static str, Value),
    /// The median, the least and the greatest.
    MedianAndRange(&'static str, Value),
}

impl Column {
    fn heads(&self) -> Vec<String> {
        let (name, statistics): (_, &[&str]) = match self {
            Self::Runs => ("runs", &[""]),
            Self::Percent => ("time_percent", &[""]),
            Self::Single(name, _) => (*name, &[""]),
            Self::Mean(name, _) | Self::Ratio(name, ..) => (*name, &["_mean"]),
            Self::MeanAndDeviation(name, _) => (*name, &["_mean", "_std"]),
            Self::Median(name, _) => (*name, &["_median"]),
            Self::MedianAndRange(name, _) => (*name, &["_median", "_least", "_greatest"]),
        };
        let statistics = statistics.iter();
        statistics.map(|one| format!("{name}{one}")).collect()
    }

    fn numbers(&self, data: &Data<'_>, group: &Group, kind: Kind) -> Vec<f64> {
        match *self {
            Self::Runs => vec![data.runs(group, kind) as f64],
            Self::Percent => vec![group.percent],
            Self::Single(_, value) | Self::Mean(_, value) => vec![data.sample(group, value).mean],
            Self::MeanAndDeviation(_, value) => {
                let sample = data.sample(group, value);
                vec![sample.mean, sample.deviation]
            }
            Self::Ratio(_, value, other) => {
                vec![data.sample(group, value).mean / data.sample(group, other).mean]
            }
            Self::Median(_, value) => vec![data.spread(group, value).median],
            Self::MedianAndRange(_, value) => {
                let spread = data.spread(group, value);
                vec![spread.median, spread.least, spread.greatest]
            }
        }
    }
}

/// The measurements and their settings.
pub(crate) struct Data<'a> {
    pub settings: &'a ExperimentSettings,
    pub store: &'a Store,
}

impl Data<'_> {
    /// One number of every measured run of a group; none of runs that do not have it (NaN).
    fn values(&self, group: &Group, value: Value) -> Vec<f64> {
        let cells = group.cells(value.kind());
        cells
            .filter_map(|cell| value.of(self.store, cell, group.percent))
            .filter(|value| !value.is_nan())
            .collect()
    }

    pub(crate) fn sample(&self, group: &Group, value: Value) -> Sample {
        Sample::of(self.values(group, value))
    }

    /// One number of each contender on a family of instances.
    fn samples<const N: usize>(
        &self,
        family: Family,
        size: usize,
        contenders: [Contender; N],
        value: Value,
    ) -> [Sample; N] {
        contenders
            .map(|contender| self.sample(&Group::of(self.settings, family, size, contender), value))
    }

    fn spread(&self, group: &Group, value: Value) -> Spread {
        Spread::of(self.values(group, value))
    }

    /// The number of measured runs of a group.
    fn runs(&self, group: &Group, kind: Kind) -> usize {
        group
            .cells(kind)
            .filter(|&cell| self.store.has(cell))
            .count()
    }
}

/// A row for each size and contender of one family.
fn rows(
    settings: &ExperimentSettings,
    family: Family,
    sizes: &[usize],
    contenders: &[Contender],
    keys: impl Fn(usize, String) -> Vec<String>,
) -> Vec<Row> {
    let mut rows = Vec::new();
    for &size in sizes {
        rows.extend(contenders.iter().map(|&contender| Row {
            keys: keys(size, contender.key()),
            group: Group::of(settings, family, size, contender),
        }));
    }
    rows
}

/// Keys as text.
fn texts(keys: &[&dyn ToString]) -> Vec<String> {
    keys.iter().map(|key| key.to_string()).collect()
}
