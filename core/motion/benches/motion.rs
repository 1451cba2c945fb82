//! How good paths are and how long the core needs for them: `cargo bench -p formation_motion --bench motion`.
//!
//! Prints a table: how many instances are solved; makespan over bound; how many times earlier the last module arrives than if
//! the units moved one after another along the same paths; and the processor time of a plan. `FORMATION_BENCH_SEEDS` sets the
//! number of seeds of each size, [`SEEDS`] by default; sizes from [`FEW_FROM`] modules on have a tenth of them.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "a program of its own around the core: it prints, takes the time, and a fault ends it"
)]

#[path = "../../planner/benches/support/mod.rs"]
mod support;

use std::sync::Arc;

use formation_generate::{Apart, GeneratorParameters, Grouping, generate, set_apart};
use formation_model::{MotionPlan, PlanningProblem, Scenario};
use formation_motion::paths::{MotionParameters, MotionRequest, plan_motion};
use formation_planner as planner;

use support::processor_time;

const SEEDS: u64 = 50;
const FEW_FROM: usize = 1_000;

/// The field is 2.5 times the square root of the number of modules wide.
const PERCENT: u32 = 250;

fn main() {
    let seeds = std::env::var("FORMATION_BENCH_SEEDS").ok();
    let seeds = seeds.map_or(SEEDS, |value| value.parse().unwrap());
    println!(
        "{:20} {:>7} {:>9} {:>16} {:>16} {:>18}",
        "grouping", "modules", "solved", "makespan / bound", "times earlier", "processor time, ms"
    );
    println!(
        "{:38} {:>16} {:>16} {:>18}",
        "", "median, 95 %", "median, least", "median, worst"
    );
    for (name, grouping, starts) in [
        ("singletons", Grouping::Singletons, Apart::Cells),
        ("singletons, turned", Grouping::Singletons, Apart::Circles),
        ("mixed", Grouping::Mixed, Apart::Cells),
        ("mixed, turned", Grouping::Mixed, Apart::Circles),
    ] {
        for modules in [30, 100, 300, 1_000] {
            let count = if modules >= FEW_FROM {
                seeds.div_ceil(10)
            } else {
                seeds
            };
            print_row(name, modules, count, |seed| {
                problem(modules, grouping, starts, seed)
            });
        }
    }
}

fn problem(modules: usize, grouping: Grouping, starts: Apart, seed: u64) -> PlanningProblem {
    let parameters = GeneratorParameters::new(modules, modules, seed).grouped(grouping);
    let mut scenario = generate(&parameters).unwrap();
    set_apart(&mut scenario, starts, PERCENT, seed);
    Scenario::try_from(scenario).unwrap().problem().clone()
}

fn print_row(name: &str, modules: usize, seeds: u64, problem: impl Fn(u64) -> PlanningProblem) {
    let (mut ratios, mut earlier, mut times) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 1..=seeds {
        let problem = problem(seed);
        let outcome = planner::plan(Arc::new(problem.clone()));
        let before = processor_time();
        let planned = plan_motion(&MotionRequest {
            problem: &problem,
            plan: &outcome.plan,
            obstacles: &[],
            walls: None,
            parameters: MotionParameters::default(),
        });
        times.push((processor_time() - before).as_secs_f64() * 1e3);
        match planned {
            Ok(motion) => {
                ratios.push(f64::from(motion.makespan) / f64::from(motion.bound.max(1)));
                earlier.push(one_after_another(&motion) / f64::from(motion.makespan.max(1)));
            }
            Err(error) => println!("{name}, {modules} modules, seed {seed}: {error}"),
        }
    }
    println!(
        "{name:20} {modules:7} {:>9} {:>16} {:>16} {:>18}",
        format!("{}/{seeds}", ratios.len()),
        format!(
            "{:.3}, {:.3}",
            share(&mut ratios, 0.5),
            share(&mut ratios, 0.95)
        ),
        format!(
            "{:.1}, {:.1}",
            share(&mut earlier, 0.5),
            share(&mut earlier, 0.0)
        ),
        format!(
            "{:.1}, {:.1}",
            share(&mut times, 0.5),
            share(&mut times, 1.0)
        ),
    );
}

/// The plan time of all steps if the units moved one after another; each step takes one unit of it.
fn one_after_another(motion: &MotionPlan) -> f64 {
    let steps = motion.units.iter().map(|unit| unit.steps.len());
    steps.sum::<usize>() as f64
}

/// The value below which this share of all values lies, between two of them by their distance to it: the median of an even
/// number of values is the mean of the middle two.
fn share(values: &mut [f64], share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let at = values.len().saturating_sub(1) as f64 * share;
    let value = |index: f64| values.get(index as usize).copied().unwrap_or(f64::NAN);
    let (below, above) = (value(at.floor()), value(at.ceil()));
    below + (above - below) * at.fract()
}
