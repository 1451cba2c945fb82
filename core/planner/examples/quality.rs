//! Prints the quality of plans on the paper's settings: means over seeded instances, one line for each setting.
//!
//! `cargo run --release -p formation_planner --example quality [INSTANCES [FIRST_SEED]]` (50 from 0 by default; the paper has 50)

#![expect(
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "a program of its own around the core: it prints and takes the time"
)]

use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use formation_generate::{GenerateError, GeneratorParameters, Grouping, TreeKind, generate};
use formation_model::{
    CutPrice, MicroUnits, PlannerParameters, PlanningProblem, Policy, Scenario, TurnOrder,
};
use formation_planner::{Planning, Statistics};

use pathfinding::matrix::Matrix;
use pathfinding::prelude::kuhn_munkres;

type Failure = Box<dyn std::error::Error>;

/// One kind of generated trees.
struct Trees {
    name: &'static str,
    kind: TreeKind,
    degree_max: usize,
    /// The links that a prototype of the planning rules broke on such trees, by configuration size, with `size_first` and `rank`.
    prototype: &'static [(usize, [f64; 2])],
    /// The paper's "number of modules disconnected", by configuration size.
    paper: &'static [(usize, f64)],
}

const LATTICE: Trees = Trees {
    name: "lattice trees of maximum degree 3",
    kind: TreeKind::Lattice,
    degree_max: 3,
    prototype: &[
        (10, [15.2, 16.3]),
        (20, [16.9, 18.7]),
        (25, [17.7, 19.4]),
        (50, [19.0, 20.4]),
    ],
    paper: &[],
};

const LABELLED: Trees = Trees {
    name: "uniform labelled trees of maximum degree 4",
    kind: TreeKind::UniformLabelled,
    degree_max: 4,
    prototype: &[],
    paper: &[(10, 0.12), (20, 4.32), (25, 8.76), (50, 29.68)],
};

/// The planners that are compared on configurations.
const PLANNERS: [(&str, Policy, CutPrice); 3] = [
    ("exact", Policy::Exact, CutPrice::ONE),
    ("exact, cut_price 0", Policy::Exact, CutPrice::ZERO),
    ("paper", Policy::Paper, CutPrice::ZERO),
];

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default| arguments.next().map_or(Ok(default), |given| given.parse());
    let (instances, first): (u64, u64) = (number(50)?, number(0)?);
    let seeds = first..first + instances;
    println!(
        "Singletons, {instances} instances: how far the total utility is below the optimal assignment to the spots that \
         are formed, in units"
    );
    println!(
        "modules  spots  policy  keep_all_spots   mean gap  worst gap  gap in %  open spots  planning"
    );
    for (modules, spots) in [(100, 100), (100, 50), (50, 100)] {
        for policy in [Policy::Exact, Policy::Paper] {
            for keep_all_spots in [false, true] {
                if keep_all_spots && modules >= spots {
                    continue;
                }
                let parameters = PlannerParameters {
                    policy,
                    keep_all_spots,
                    ..PlannerParameters::default()
                };
                singletons(seeds.clone(), modules, spots, parameters)?;
            }
        }
    }
    for trees in [LATTICE, LABELLED] {
        println!();
        println!(
            "100 modules, 100 spots, {}, means of {instances} instances",
            trees.name
        );
        println!(
            "size   order       planner             broken  prototype  outside  alone  empty  paper's  ports  evictions  \
             utility  distance  planning"
        );
        for size in [0, 2, 3, 5, 10, 20, 25, 50] {
            for order in [TurnOrder::SizeFirst, TurnOrder::Rank] {
                for (name, policy, cut_price) in PLANNERS {
                    let parameters = PlannerParameters {
                        policy,
                        order,
                        cut_price,
                        ..PlannerParameters::default()
                    };
                    configurations(seeds.clone(), &trees, size, name, parameters)?;
                }
            }
        }
    }
    Ok(())
}

fn problem(
    generator: &GeneratorParameters,
    parameters: PlannerParameters,
) -> Result<Arc<PlanningProblem>, Failure> {
    let scenario = match generate(generator) {
        // The next free seed replaces one without a tree.
        Err(GenerateError::NoTreeFound { .. }) => generate(&GeneratorParameters {
            seed: generator.seed + 1_000_000,
            ..*generator
        })?,
        other => other?,
    };
    let scenario = Scenario::try_from(scenario)?;
    let problem = scenario.problem();
    Ok(Arc::new(PlanningProblem::new(
        Arc::clone(problem.target()),
        parameters,
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

fn singletons(
    seeds: Range<u64>,
    modules: usize,
    spots: usize,
    parameters: PlannerParameters,
) -> Result<(), Failure> {
    let instances = seeds.end - seeds.start;
    let (mut sum, mut worst, mut optima, mut open) = (0, 0, 0, 0);
    let mut elapsed = Duration::ZERO;
    for seed in seeds {
        let problem = problem(&GeneratorParameters::new(modules, spots, seed), parameters)?;
        let (planning, statistics, time) = timed(&problem);
        elapsed += time;
        let utilities = &planning.instance().utilities;
        let formed = planning.instance().target.spots().len();
        let weight = |module: usize, spot: usize| utilities.of(module, spot).0;
        let (optimum, _) = if modules <= formed {
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
        let gap = optimum - total.0;
        sum += gap;
        worst = worst.max(gap);
        optima += optimum.abs();
        open += statistics.open_spots.len();
    }
    let policy = match parameters.policy {
        Policy::Paper => "paper",
        _ => "exact",
    };
    println!(
        "{modules:7}  {spots:5}  {policy:6}  {:14}  {:9.6}  {:9.6}  {:8.2}  {:10.2}  {:5} us",
        parameters.keep_all_spots,
        mean(sum, instances) / 1.0e6,
        mean(worst, 1) / 1.0e6,
        100.0 * mean(sum, 1) / mean(optima, 1),
        mean(i64::try_from(open)?, instances),
        elapsed.as_micros() / u128::from(instances.max(1)),
    );
    Ok(())
}

/// Size 0 means mixed sizes.
fn configurations(
    seeds: Range<u64>,
    trees: &Trees,
    size: usize,
    planner: &str,
    parameters: PlannerParameters,
) -> Result<(), Failure> {
    let instances = seeds.end - seeds.start;
    let grouping = match size {
        0 => Grouping::Mixed,
        size => Grouping::Configurations(size),
    };
    let mut sums = [0_usize; 6];
    let (mut utility, mut distance, mut elapsed) = (0.0, 0.0, Duration::ZERO);
    for seed in seeds {
        let generator = GeneratorParameters {
            tree: trees.kind,
            degree_max: trees.degree_max,
            ..GeneratorParameters::new(100, 100, seed).grouped(grouping)
        };
        let (_, statistics, time) = timed(&problem(&generator, parameters)?);
        let counts = statistics.changes.disconnected;
        let all = [
            counts.broken_links,
            counts.outside_largest_piece,
            counts.alone,
            counts.unmatched_on_empty_target,
            statistics.changes.port_changes,
            statistics.changes.evictions,
        ];
        for (sum, count) in sums.iter_mut().zip(all) {
            *sum += count;
        }
        utility += statistics.total_utility;
        distance += statistics.total_distance;
        elapsed += time;
    }
    let (order, column) = match parameters.order {
        TurnOrder::SizeFirst => ("size_first", 0),
        TurnOrder::Rank => ("rank", 1),
    };
    let text = |number: Option<f64>| number.map_or(String::new(), |number| format!("{number:.2}"));
    // The prototype followed the planning rules, so its figures do not apply to the paper's planner.
    let prototype = trees
        .prototype
        .iter()
        .find(|&&(of, _)| of == size && parameters.policy == Policy::Exact)
        .map(|(_, figures)| figures[column]);
    let paper = trees.paper.iter().find(|&&(of, _)| of == size);
    let [broken, outside, alone, empty, ports, evictions] =
        sums.map(|sum| mean(i64::try_from(sum).unwrap_or(i64::MAX), instances));
    println!(
        "{:5}  {order:10}  {planner:18}  {broken:6.2}  {:>9}  {outside:7.2}  {alone:5.2}  {empty:5.2}  {:>7}  {ports:5.1}  \
         {evictions:9.1}  {:7.1}  {:8.1}  {:5} us",
        match size {
            0 => "mixed".to_owned(),
            size => size.to_string(),
        },
        text(prototype),
        text(paper.map(|&(_, figure)| figure)),
        utility / mean(i64::try_from(instances)?, 1),
        distance / mean(i64::try_from(instances)?, 1),
        elapsed.as_micros() / u128::from(instances.max(1)),
    );
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "for people")]
fn mean(sum: i64, count: u64) -> f64 {
    sum as f64 / count.max(1) as f64
}
