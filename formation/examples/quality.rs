//! Prints how good plans are on the paper's settings: means over seeded instances, one line a setting.
//!
//! `cargo run --release -p formation --example quality [INSTANCES]` (50 by default, as in the paper).

#![expect(
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "a program of its own around the core: it prints and takes the time"
)]

use std::sync::Arc;
use std::time::{Duration, Instant};

use formation::fixed::MicroUnits;
use formation::generate::{GenerateError, GeneratorParameters, Grouping, TreeKind, generate};
use formation::parameters::{PlannerParameters, TurnOrder};
use formation::planning::Planning;
use formation::problem::PlanningProblem;
use formation::scenario::Scenario;
use formation::statistics::Statistics;

use pathfinding::matrix::Matrix;
use pathfinding::prelude::kuhn_munkres;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let instances: u64 = match std::env::args().nth(1) {
        Some(argument) => argument.parse()?,
        None => 50,
    };
    println!("Utility gap of singletons to the optimal assignment, {instances} instances");
    println!("modules  spots  mean gap  worst gap  planning");
    for (modules, spots) in [(100, 100), (100, 50), (50, 100)] {
        singletons(instances, modules, spots)?;
    }
    println!();
    println!("100 modules, 100 spots, trees of maximum degree 3, means of {instances} instances");
    println!(
        "tree      size   order       broken  outside  alone  empty  ports  evictions  distance  planning"
    );
    for tree in [TreeKind::Lattice, TreeKind::UniformLabelled] {
        for size in [0, 2, 3, 5, 10, 20, 25, 50] {
            for order in [TurnOrder::SizeFirst, TurnOrder::Rank] {
                configurations(instances, tree, size, order)?;
            }
        }
    }
    Ok(())
}

fn problem(
    parameters: &GeneratorParameters,
    order: TurnOrder,
) -> Result<Arc<PlanningProblem>, Failure> {
    let scenario = match generate(parameters) {
        // A seed without a tree is not an instance; the next free one stands in.
        Err(GenerateError::NoTreeFound { .. }) => generate(&GeneratorParameters {
            seed: parameters.seed + 1_000_000,
            ..*parameters
        })?,
        other => other?,
    };
    let scenario = Scenario::try_from(scenario)?;
    let problem = scenario.problem();
    Ok(Arc::new(PlanningProblem::new(
        Arc::clone(problem.target()),
        PlannerParameters {
            order,
            ..PlannerParameters::default()
        },
        problem.modules().to_vec(),
    )?))
}

fn timed(problem: &Arc<PlanningProblem>) -> (Planning, Statistics, Duration) {
    let start = Instant::now();
    let mut planning = Planning::new(Arc::clone(problem));
    let decisions = planning.take_all_turns();
    let elapsed = start.elapsed();
    let statistics = Statistics::of(problem, &planning.outcome(decisions));
    (planning, statistics, elapsed)
}

fn singletons(instances: u64, modules: usize, spots: usize) -> Result<(), Failure> {
    let (mut sum, mut worst, mut elapsed) = (0, 0, Duration::ZERO);
    for seed in 0..instances {
        let problem = problem(
            &GeneratorParameters::new(modules, spots, seed),
            TurnOrder::Rank,
        )?;
        let (planning, _, time) = timed(&problem);
        elapsed += time;
        let utilities = &planning.instance().utilities;
        let formed = utilities.spot_count();
        let weight = |module: usize, spot: usize| utilities.of(module, spot).0;
        let optimum = if modules <= formed {
            kuhn_munkres(&Matrix::from_fn(modules, formed, |(row, column)| {
                weight(row, column)
            }))
        } else {
            kuhn_munkres(&Matrix::from_fn(formed, modules, |(column, row)| {
                weight(row, column)
            }))
        };
        let total: MicroUnits = problem
            .modules()
            .iter()
            .enumerate()
            .filter_map(|(position, module)| {
                let spot = planning.spot_of(module.id)?;
                let spot = planning.instance().target.position_of(spot)?;
                Some(utilities.of(position, spot))
            })
            .sum();
        let gap = optimum.0 - total.0;
        sum += gap;
        worst = worst.max(gap);
    }
    println!(
        "{modules:7}  {spots:5}  {:8.6}  {:9.6}  {:6} us",
        mean(sum, instances) / 1.0e6,
        mean(worst, 1) / 1.0e6,
        elapsed.as_micros() / u128::from(instances.max(1)),
    );
    Ok(())
}

/// Size 0 stands for mixed sizes.
fn configurations(
    instances: u64,
    tree: TreeKind,
    size: usize,
    order: TurnOrder,
) -> Result<(), Failure> {
    let grouping = match size {
        0 => Grouping::Mixed,
        size => Grouping::Configurations(size),
    };
    let mut sums = [0_usize; 6];
    let (mut distance, mut elapsed) = (0.0, Duration::ZERO);
    for seed in 0..instances {
        let parameters = GeneratorParameters {
            tree,
            ..GeneratorParameters::new(100, 100, seed).grouped(grouping)
        };
        let (_, statistics, time) = timed(&problem(&parameters, order)?);
        let counts = statistics.disconnected;
        let all = [
            counts.broken_links,
            counts.outside_largest_piece,
            counts.alone,
            counts.unmatched_on_empty_target,
            statistics.port_changes,
            statistics.evictions,
        ];
        for (sum, count) in sums.iter_mut().zip(all) {
            *sum += count;
        }
        distance += statistics.total_distance;
        elapsed += time;
    }
    let tree = match tree {
        TreeKind::Lattice => "lattice",
        TreeKind::UniformLabelled => "labelled",
    };
    let size = match size {
        0 => "mixed".to_owned(),
        size => size.to_string(),
    };
    let order = match order {
        TurnOrder::Rank => "rank",
        TurnOrder::SizeFirst => "size_first",
    };
    let [broken, outside, alone, empty, ports, evictions] =
        sums.map(|sum| mean(i64::try_from(sum).unwrap_or(i64::MAX), instances));
    println!(
        "{tree:8}  {size:5}  {order:10}  {broken:6.2}  {outside:7.2}  {alone:5.2}  {empty:5.2}  {ports:5.1}  {evictions:9.1}  {:8.1}  {:5} us",
        distance / mean(i64::try_from(instances)?, 1),
        elapsed.as_micros() / u128::from(instances.max(1)),
    );
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "for people")]
fn mean(sum: i64, count: u64) -> f64 {
    sum as f64 / count.max(1) as f64
}
