//! The growth of the time of an allocation with the number of modules: `cargo bench -p formation_planner --bench growth`.
//!
//! Prints a table and the growth exponent between each size and the one before it. The sizes end at 3,000; with
//! `FORMATION_BENCH_LARGE=1` they end at 10,000, which takes minutes. An argument such as `singletons` runs only the
//! groupings whose name begins with it, in a process whose peak memory is theirs alone. It prints processor time
//! and wall-clock time, since only the latter depends on the load of the machine.

#![allow(
    clippy::unwrap_used,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "a program of its own around the core: it prints, takes the time, and a fault ends it"
)]

mod support;

use std::sync::Arc;
use std::time::{Duration, Instant};

use formation_generate::{GeneratorParameters, Grouping, generate};
use formation_model::{PlanningProblem, Scenario};
use formation_planner::Planning;

use support::processor_time;

/// Each figure is the median of this many runs, one for each seed; from [`ONCE_FROM`] modules on, of one run.
const SEEDS: u64 = 5;
const ONCE_FROM: u32 = 3_000;

fn main() {
    let large = std::env::var("FORMATION_BENCH_LARGE").is_ok_and(|value| value == "1");
    // Cargo passes `--bench` on.
    let only = std::env::args()
        .skip(1)
        .find(|argument| !argument.starts_with('-'))
        .unwrap_or_default();
    println!(
        "grouping              modules  processor seconds  exponent  seconds gone by  peak memory so far"
    );
    for (name, grouping) in [
        ("singletons", Grouping::Singletons),
        ("mixed", Grouping::Mixed),
        ("configurations of 10", Grouping::Configurations(10)),
    ] {
        if !name.starts_with(&only) {
            continue;
        }
        let mut before: Option<(u32, f64)> = None;
        for modules in [100, 300, 1_000, 3_000, 10_000] {
            if modules > 3_000 && !large {
                continue;
            }
            let times = median_times(modules, grouping);
            let (seconds, wall_clock) = (
                times.processor.as_secs_f64(),
                times.wall_clock.as_secs_f64(),
            );
            let exponent = before.map_or(String::new(), |(fewer, less)| {
                let ratio = f64::from(modules) / f64::from(fewer);
                format!("{:.2}", (seconds / less).ln() / ratio.ln())
            });
            println!(
                "{name:20}  {modules:7}  {seconds:17.6}  {exponent:>8}  {wall_clock:15.6}  {}",
                peak_memory()
            );
            before = Some((modules, seconds));
        }
    }
}

/// The times of an allocation; ordered by processor time.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Times {
    processor: Duration,
    wall_clock: Duration,
}

fn median_times(modules: u32, grouping: Grouping) -> Times {
    let seeds = if modules >= ONCE_FROM { 1 } else { SEEDS };
    let count = usize::try_from(modules).unwrap();
    let mut times: Vec<Times> = (1..=seeds)
        .map(|seed| {
            let parameters = GeneratorParameters::new(count, count, seed).grouped(grouping);
            let scenario = Scenario::try_from(generate(&parameters).unwrap()).unwrap();
            allocation_times(&Arc::new(scenario.problem().clone()))
        })
        .collect();
    times.sort_unstable();
    times[times.len() / 2]
}

/// The times of all turns, without the acting order; for fewer modules the mean of more runs.
fn allocation_times(problem: &Arc<PlanningProblem>) -> Times {
    let modules = u32::try_from(problem.modules().len()).unwrap();
    let runs = (1_000 / modules).pow(2).max(1);
    let (start, before) = (Instant::now(), processor_time());
    for _ in 0..runs {
        let mut planning = Planning::new(Arc::clone(problem));
        let turns = planning.take_all_turns();
        assert!(turns.len() <= problem.modules().len() * 2);
    }
    Times {
        processor: (processor_time() - before) / runs,
        wall_clock: start.elapsed() / runs,
    }
}

/// The peak memory of this process by Linux.
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
