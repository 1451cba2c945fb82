//! Prints how good motion plans are: one line a setting, over seeded instances.
//!
//! `cargo run --release -p formation_motion --example motion_quality [INSTANCES [SETTING ...]]` (50 instances and all settings by
//! default; a setting is named by its line, such as `singles-100-2.5`)

#![expect(
    clippy::disallowed_macros,
    reason = "a program of its own around the core: it prints"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use formation_generate::{
    Apart, GeneratorParameters, Grouping, LatticeCell, Random, generate, on_cells, set_apart,
};
use formation_model::{
    MotionPlan, PlanningProblem, RawModule, RawScenario, RawSpot, Scenario, Variant,
};
use formation_motion::PlannedMotion;
use formation_planner::{PlanOutcome, plan};

type Failure = Box<dyn std::error::Error>;

/// Where modules start and what the target looks like.
#[derive(Clone, Copy)]
enum Field {
    /// A tree, and starts in a square field about it.
    Tree(Grouping, Apart),
    /// A compact target in a square field without walls, and single modules on other cells of it.
    Compact,
    /// Single modules on random cells of a square, and as many random cells of it that are connected as the target.
    Crowded,
}

/// One line of the table.
struct Setting {
    name: &'static str,
    modules: usize,
    /// Hundredths of the field's side by the root of the number of modules.
    percent: u32,
    field: Field,
    /// The most instances that are worth their time.
    instances: u64,
}

const fn setting(
    name: &'static str,
    modules: usize,
    percent: u32,
    field: Field,
    instances: u64,
) -> Setting {
    Setting {
        name,
        modules,
        percent,
        field,
        instances,
    }
}

const SINGLES: Field = Field::Tree(Grouping::Singletons, Apart::Circles);
const CELLS: Field = Field::Tree(Grouping::Singletons, Apart::Cells);
const BLOCKS: Field = Field::Tree(Grouping::Mixed, Apart::Cells);
const BLOCKS_APART: Field = Field::Tree(Grouping::Mixed, Apart::Circles);

const SETTINGS: [Setting; 25] = [
    setting("singles-17-2.0", 17, 200, SINGLES, 50),
    setting("singles-100-2.0", 100, 200, SINGLES, 50),
    setting("singles-100-2.5", 100, 250, SINGLES, 50),
    setting("singles-300-2.5", 300, 250, SINGLES, 50),
    setting("singles-1000-3.0", 1_000, 300, SINGLES, 4),
    setting("cells-100-1.2", 100, 120, CELLS, 50),
    setting("cells-100-2.5", 100, 250, CELLS, 50),
    setting("cells-300-1.2", 300, 120, CELLS, 10),
    setting("cells-300-2.5", 300, 250, CELLS, 50),
    setting("cells-1000-1.2", 1_000, 120, CELLS, 5),
    setting("cells-1000-2.5", 1_000, 250, CELLS, 5),
    setting("cells-1000-1.5", 1_000, 150, CELLS, 5),
    setting("cells-1000-2.0", 1_000, 200, CELLS, 5),
    setting("blocks-1000-1.5", 1_000, 150, BLOCKS, 5),
    setting("blocks-1000-2.5", 1_000, 250, BLOCKS, 6),
    setting("compact-100-2.5", 100, 250, Field::Compact, 50),
    setting("compact-300-2.5", 300, 250, Field::Compact, 50),
    setting("compact-1000-2.5", 1_000, 250, Field::Compact, 5),
    setting("crowded-100-1.1", 100, 112, Field::Crowded, 20),
    setting("crowded-810-1.1", 810, 106, Field::Crowded, 5),
    setting("blocks-50-2.5", 50, 250, BLOCKS, 50),
    setting("blocks-100-2.5", 100, 250, BLOCKS, 50),
    setting("blocks-300-2.5", 300, 250, BLOCKS, 50),
    setting("blocks-100-apart", 100, 250, BLOCKS_APART, 50),
    setting("blocks-1000-3.0", 1_000, 300, BLOCKS, 4),
];

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let instances: u64 = arguments.next().map_or(Ok(50), |given| given.parse())?;
    let names: Vec<String> = arguments.collect();
    println!(
        "setting           solved  makespan/bound       steps/     CPU ms           faster       taken  lazy eager       \
         waits/module\n\
         \x20                         median   p95  max   shortest   median    max    than serial  apart       serial swapping mean max"
    );
    for setting in &SETTINGS {
        if names.is_empty() || names.iter().any(|name| setting.name == name) {
            run(setting, instances.min(setting.instances));
        }
    }
    Ok(())
}

fn instance(setting: &Setting, seed: u64) -> Result<(Arc<PlanningProblem>, PlanOutcome), Failure> {
    let raw = match setting.field {
        Field::Tree(grouping, apart) => {
            let parameters = GeneratorParameters::new(setting.modules, setting.modules, seed);
            let mut raw = generate(&parameters.grouped(grouping))?;
            set_apart(&mut raw, apart, setting.percent, seed);
            raw
        }
        Field::Compact => {
            on_cells(&square(setting), setting.modules, seed).ok_or("the field is too small")?
        }
        Field::Crowded => crowded(setting, seed).ok_or("the field is too small")?,
    };
    let problem = Arc::new(Scenario::try_from(raw)?.problem().clone());
    let outcome = plan(Arc::clone(&problem));
    Ok((problem, outcome))
}

/// The cells of the field.
fn square(setting: &Setting) -> BTreeSet<LatticeCell> {
    let side = (setting.modules as u64 * u64::from(setting.percent).pow(2)).isqrt() / 100;
    let along = 0..side.cast_signed();
    along
        .clone()
        .flat_map(|x| along.clone().map(move |y| (x, y)))
        .collect()
}

/// The target is drawn as the starts are, and then without what is not connected to most of it.
fn crowded(setting: &Setting, seed: u64) -> Option<RawScenario> {
    let mut random = Random::from_seed(seed);
    let mut cells: Vec<LatticeCell> = square(setting).into_iter().collect();
    let mut drawn = || {
        random.shuffle(&mut cells);
        cells.get(..setting.modules).map(<[_]>::to_vec)
    };
    let (starts, goals) = (drawn()?, drawn()?);
    let goals: BTreeSet<LatticeCell> = goals.into_iter().collect();
    let mut raw = on_cells(&goals, 1, seed)?;
    let spots = largest_part(&goals);
    let ids: BTreeMap<LatticeCell, u32> = spots.into_iter().zip(1..).collect();
    let beside = |(&(x, y), &id): (&LatticeCell, &u32)| {
        let others = [(x + 1, y), (x, y + 1)];
        let ids = others.map(|other| ids.get(&other).map(|&other| [id, other]));
        ids.into_iter().flatten().collect::<Vec<_>>()
    };
    raw.target.edges = ids.iter().flat_map(beside).collect();
    #[expect(clippy::cast_precision_loss, reason = "cells of a field are few")]
    let at = |(x, y): LatticeCell| (x as f64, y as f64);
    let theta = 0.0;
    let spot = |(&cell, &id): (&LatticeCell, &u32)| {
        let (x, y) = at(cell);
        RawSpot { id, x, y, theta }
    };
    raw.target.spots = ids.iter().map(spot).collect();
    let module = |(cell, id): (LatticeCell, u32)| {
        let (x, y) = at(cell);
        RawModule { id, x, y, theta }
    };
    raw.singletons = starts.into_iter().zip(1..).map(module).collect();
    Some(raw)
}

/// The largest connected part of some cells.
fn largest_part(cells: &BTreeSet<LatticeCell>) -> Vec<LatticeCell> {
    let mut left = cells.clone();
    let mut largest = Vec::new();
    while let Some(first) = left.pop_first() {
        let mut part = vec![first];
        let mut next = 0;
        while let Some(&(x, y)) = part.get(next) {
            next += 1;
            let beside = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)];
            part.extend(beside.into_iter().filter(|cell| left.remove(cell)));
        }
        if part.len() > largest.len() {
            largest = part;
        }
    }
    largest
}

#[derive(Default)]
struct Totals {
    solved: usize,
    by_bound: Vec<f64>,
    steps: (f64, f64),
    milliseconds: Vec<f64>,
    faster: Vec<f64>,
    taken_apart: usize,
    blocks: usize,
    variants: [usize; 4],
    waits: (usize, usize, usize),
}

fn run(setting: &Setting, instances: u64) {
    let mut totals = Totals::default();
    for seed in 0..instances {
        let (problem, outcome) = match instance(setting, seed) {
            Ok(instance) => instance,
            Err(error) => {
                println!("  seed {seed}: {error}");
                continue;
            }
        };
        totals.blocks += outcome.plan.blocks.len();
        let before = cpu_time();
        let (planned, _) = PlannedMotion::of(&problem, outcome.plan.clone());
        let elapsed = cpu_time().saturating_sub(before);
        match planned {
            PlannedMotion::Paths(motion) => totals.add(&problem, &outcome, &motion, elapsed),
            PlannedMotion::Refused(error) => {
                println!("  seed {seed}: {error}");
            }
        }
    }
    totals.print(setting, instances);
}

impl Totals {
    #[expect(clippy::cast_precision_loss, reason = "for people")]
    fn add(
        &mut self,
        problem: &PlanningProblem,
        outcome: &PlanOutcome,
        motion: &MotionPlan,
        elapsed: Duration,
    ) {
        self.solved += 1;
        let makespan = f64::from(motion.makespan);
        self.by_bound
            .push(makespan / f64::from(motion.bound.max(1)));
        let steps = motion.units.iter().map(|unit| unit.steps.len());
        self.steps.0 += steps.sum::<usize>() as f64;
        let shortest = motion.units.iter().map(|unit| f64::from(unit.shortest));
        self.steps.1 += shortest.sum::<f64>();
        self.milliseconds.push(elapsed.as_secs_f64() * 1.0e3);
        self.faster
            .push(serial(problem, outcome) / makespan.max(1.0));
        self.taken_apart += motion.taken_apart.len();
        self.variants[match motion.variant {
            Variant::Lazy => 0,
            Variant::Eager => 1,
            Variant::Serial => 2,
            Variant::Swapping => 3,
        }] += 1;
        for unit in &motion.units {
            self.waits.0 += unit.waits.len();
            self.waits.1 += 1;
            self.waits.2 = self.waits.2.max(unit.waits.len());
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "for people")]
    fn print(mut self, setting: &Setting, instances: u64) {
        for list in [&mut self.by_bound, &mut self.milliseconds, &mut self.faster] {
            list.sort_by(f64::total_cmp);
        }
        println!(
            "{:17} {:3}/{instances:<3}  {:5.2}  {:5.2} {:5.2}  {:5.2}  {:9.1} {:9.1}  {:7.1}  {:4}/{:<5} {}/{}/{}/{}  {:5.1} {}",
            setting.name,
            self.solved,
            quantile(&self.by_bound, 50),
            quantile(&self.by_bound, 95),
            quantile(&self.by_bound, 100),
            self.steps.0 / self.steps.1,
            quantile(&self.milliseconds, 50),
            quantile(&self.milliseconds, 100),
            quantile(&self.faster, 50),
            self.taken_apart,
            self.blocks,
            self.variants[0],
            self.variants[1],
            self.variants[2],
            self.variants[3],
            self.waits.0 as f64 / self.waits.1.max(1) as f64,
            self.waits.2,
        );
    }
}

/// How long the units take one after another on straight lines, in units of length.
fn serial(problem: &PlanningProblem, outcome: &PlanOutcome) -> f64 {
    let length = |module, spot| {
        let module = problem.module(module)?;
        let spot = problem.target().spot(spot)?;
        Some(module.pose.distance_to(&spot.pose).to_units())
    };
    let units = outcome
        .plan
        .assembly
        .units
        .iter()
        .filter(|unit| !unit.pinned);
    units
        .map(|unit| {
            let lengths = unit
                .placements
                .iter()
                .filter_map(|&(module, spot)| length(module, spot));
            lengths.fold(0.0, f64::max)
        })
        .sum()
}

/// The smallest entry that `percent` of the entries do not exceed.
fn quantile(sorted: &[f64], percent: usize) -> f64 {
    let rank = (sorted.len() * percent).div_ceil(100).max(1) - 1;
    sorted.get(rank).copied().unwrap_or(f64::NAN)
}

fn cpu_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::try_from(time).unwrap_or_default()
}
