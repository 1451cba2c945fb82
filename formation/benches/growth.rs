//! How the time of an allocation grows with the number of modules: `cargo bench -p formation --bench growth`.
//!
//! Prints a table and the growth exponent between each size and the one before it. The sizes end at 3,000; with
//! `FORMATION_BENCH_LARGE=1` they end at 10,000, which takes minutes.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "a program of its own around the core: it prints, takes the time, and a fault ends it"
)]

use std::sync::Arc;
use std::time::{Duration, Instant};

use formation::generate::{GeneratorParameters, Grouping, generate};
use formation::planning::Planning;
use formation::problem::PlanningProblem;
use formation::scenario::Scenario;

/// Each figure is the median of this many runs, one a seed; above [`ONCE_FROM`] modules one run has to do.
const SEEDS: u64 = 5;
const ONCE_FROM: u32 = 3_000;

fn main() {
    let large = std::env::var("FORMATION_BENCH_LARGE").is_ok_and(|value| value == "1");
    println!("grouping              modules        seconds  exponent  peak memory so far");
    for (name, grouping) in [
        ("singletons", Grouping::Singletons),
        ("mixed", Grouping::Mixed),
        ("configurations of 10", Grouping::Configurations(10)),
    ] {
        let mut before: Option<(u32, f64)> = None;
        for modules in [100, 300, 1_000, 3_000, 10_000] {
            if modules > 3_000 && !large {
                continue;
            }
            let seconds = median_time(modules, grouping).as_secs_f64();
            let exponent = before.map_or(String::new(), |(fewer, less)| {
                let ratio = f64::from(modules) / f64::from(fewer);
                format!("{:.2}", (seconds / less).ln() / ratio.ln())
            });
            println!(
                "{name:20}  {modules:7}  {seconds:13.6}  {exponent:>8}  {}",
                peak_memory()
            );
            before = Some((modules, seconds));
        }
    }
}

fn median_time(modules: u32, grouping: Grouping) -> Duration {
    let seeds = if modules >= ONCE_FROM { 1 } else { SEEDS };
    let count = usize::try_from(modules).unwrap();
    let mut times: Vec<Duration> = (1..=seeds)
        .map(|seed| {
            let parameters = GeneratorParameters::new(count, count, seed).grouped(grouping);
            let scenario = Scenario::try_from(generate(&parameters).unwrap()).unwrap();
            allocation_time(&Arc::new(scenario.problem().clone()))
        })
        .collect();
    times.sort_unstable();
    times[times.len() / 2]
}

/// The time of all turns, without the acting order.
fn allocation_time(problem: &Arc<PlanningProblem>) -> Duration {
    let start = Instant::now();
    let mut planning = Planning::new(Arc::clone(problem));
    let turns = planning.take_all_turns();
    let elapsed = start.elapsed();
    assert!(turns.len() <= problem.modules().len() * 2);
    elapsed
}

/// The most memory that this process has held, as Linux tells it.
fn peak_memory() -> String {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|status| {
            let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
            let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
            Some(format!("{} MiB", kilobytes / 1024))
        })
        .unwrap_or_else(|| "unknown".to_owned())
}
