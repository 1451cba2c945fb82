//! Prints how good motion plans are: one line a setting, over seeded instances.
//!
//! `cargo run --release -p formation_motion --example motion_quality [INSTANCES [SETTING ...]]` (50 instances and all settings by
//! default; a setting is named by its line, such as `singles-100-2.5`)

#![expect(
    clippy::disallowed_macros,
    reason = "a program of its own around the core: it prints"
)]

use std::sync::Arc;
use std::time::Duration;

use formation_generate::{Apart, GeneratorParameters, Grouping, generate, set_apart};
use formation_model::{MotionPlan, PlanningProblem, Scenario, Variant};
use formation_motion::paths::{MotionParameters, MotionRequest, plan_motion};
use formation_planner::{PlanOutcome, plan};

type Failure = Box<dyn std::error::Error>;

/// One line of the table.
struct Setting {
    name: &'static str,
    modules: usize,
    /// Hundredths of the field's side by the root of the number of modules.
    percent: u32,
    grouping: Grouping,
    apart: Apart,
    /// The most instances that are worth their time.
    instances: u64,
}

const fn setting(
    name: &'static str,
    modules: usize,
    percent: u32,
    grouping: Grouping,
    apart: Apart,
    instances: u64,
) -> Setting {
    Setting {
        name,
        modules,
        percent,
        grouping,
        apart,
        instances,
    }
}

const SETTINGS: [Setting; 13] = [
    setting(
        "singles-17-2.0",
        17,
        200,
        Grouping::Singletons,
        Apart::Circles,
        50,
    ),
    setting(
        "singles-100-2.0",
        100,
        200,
        Grouping::Singletons,
        Apart::Circles,
        50,
    ),
    setting(
        "singles-100-2.5",
        100,
        250,
        Grouping::Singletons,
        Apart::Circles,
        50,
    ),
    setting(
        "singles-300-2.5",
        300,
        250,
        Grouping::Singletons,
        Apart::Circles,
        50,
    ),
    setting(
        "singles-1000-3.0",
        1_000,
        300,
        Grouping::Singletons,
        Apart::Circles,
        4,
    ),
    setting(
        "cells-100-1.2",
        100,
        120,
        Grouping::Singletons,
        Apart::Cells,
        50,
    ),
    setting(
        "cells-100-2.5",
        100,
        250,
        Grouping::Singletons,
        Apart::Cells,
        50,
    ),
    setting(
        "cells-300-2.5",
        300,
        250,
        Grouping::Singletons,
        Apart::Cells,
        50,
    ),
    setting("blocks-50-2.5", 50, 250, Grouping::Mixed, Apart::Cells, 50),
    setting(
        "blocks-100-2.5",
        100,
        250,
        Grouping::Mixed,
        Apart::Cells,
        50,
    ),
    setting(
        "blocks-300-2.5",
        300,
        250,
        Grouping::Mixed,
        Apart::Cells,
        50,
    ),
    setting(
        "blocks-100-apart",
        100,
        250,
        Grouping::Mixed,
        Apart::Circles,
        50,
    ),
    setting(
        "blocks-1000-3.0",
        1_000,
        300,
        Grouping::Mixed,
        Apart::Cells,
        4,
    ),
];

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let instances: u64 = arguments.next().map_or(Ok(50), |given| given.parse())?;
    let names: Vec<String> = arguments.collect();
    println!(
        "setting           solved  makespan/bound       steps/     CPU ms           faster       taken  lazy eager  \
         waits/module\n\
         \x20                         median   p95  max   shortest   median    max    than serial  apart       serial mean max"
    );
    for setting in &SETTINGS {
        if names.is_empty() || names.iter().any(|name| setting.name == name) {
            run(setting, instances.min(setting.instances));
        }
    }
    Ok(())
}

fn instance(setting: &Setting, seed: u64) -> Result<(Arc<PlanningProblem>, PlanOutcome), Failure> {
    let parameters =
        GeneratorParameters::new(setting.modules, setting.modules, seed).grouped(setting.grouping);
    let mut raw = generate(&parameters)?;
    set_apart(&mut raw, setting.apart, setting.percent, seed);
    let problem = Arc::new(Scenario::try_from(raw)?.problem().clone());
    let outcome = plan(Arc::clone(&problem));
    Ok((problem, outcome))
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
    variants: [usize; 3],
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
        let request = MotionRequest {
            problem: &problem,
            plan: &outcome.plan,
            obstacles: &[],
            walls: None,
            parameters: MotionParameters::default(),
        };
        totals.blocks += outcome.plan.blocks.len();
        let before = cpu_time();
        let planned = plan_motion(&request);
        let elapsed = cpu_time().saturating_sub(before);
        match planned {
            Ok(motion) => totals.add(&problem, &outcome, &motion, elapsed),
            Err(error) => println!("  seed {seed}: {error}"),
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
            "{:17} {:3}/{instances:<3}  {:5.2}  {:5.2} {:5.2}  {:5.2}  {:9.1} {:9.1}  {:7.1}  {:4}/{:<5} {}/{}/{}  {:5.1} {}",
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
