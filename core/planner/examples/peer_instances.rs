//! Prints instances and our times for them as JSON, for the comparison in `experiments/compare_peers.py`.
//!
//! `cargo run --release -p formation_planner --example peer_instances [SEED]`

#![expect(
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "a program of its own around the core: it prints and takes the time"
)]

#[path = "../benches/support/mod.rs"]
mod support;

use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

use formation_generate::{GeneratorParameters, Grouping, generate};
use formation_model::{MicroUnits, PlanningProblem, Scenario, Topology};
use formation_planner::assignment::Instance;
use formation_planner::placement::{MatchingInput, common_subtree};
use formation_planner::{Planning, betweenness};
use serde::Serialize;

use support::processor_time;

type Failure = Box<dyn std::error::Error>;

/// Each figure is the median of at most this many runs, of fewer if [`RUN_TIME_MAX`] is over before.
const RUNS_MAX: usize = 101;
/// The longest time for one figure.
const RUN_TIME_MAX: Duration = Duration::from_secs(3);

/// The compared instances.
#[derive(Serialize)]
struct Instances {
    common_subtrees: Vec<CommonSubtree>,
    assignments: Vec<Assignment>,
    centralities: Vec<Centrality>,
}

/// A configuration, a target, and the largest part of one that fits into the other.
#[derive(Serialize)]
struct CommonSubtree {
    seed: u64,
    configuration: Graph,
    target: Graph,
    matched: usize,
    utility: i64,
    seconds: f64,
}

/// Single modules with their utilities for each spot, in micro-units.
#[derive(Serialize)]
struct Assignment {
    utilities: Vec<Vec<i64>>,
    total: i64,
    seconds: f64,
}

/// A target and the betweenness of its spots in micro-units.
#[derive(Serialize)]
struct Centrality {
    target: Graph,
    betweenness: Vec<i64>,
    seconds: f64,
}

/// A graph.
#[derive(Serialize)]
struct Graph {
    nodes: usize,
    edges: Vec<(usize, usize)>,
}

impl Graph {
    fn of(topology: &Topology) -> Self {
        Self {
            nodes: topology.node_count(),
            edges: topology.edges().to_vec(),
        }
    }
}

fn main() -> Result<(), Failure> {
    let seed: u64 = match std::env::args().nth(1) {
        Some(argument) => argument.parse()?,
        None => 1,
    };
    let mut instances = Instances {
        common_subtrees: Vec::new(),
        assignments: Vec::new(),
        centralities: Vec::new(),
    };
    // Several of the largest, since the time of a search varies widely between instances.
    let sizes = [(5, 1), (10, 1), (20, 1), (30, 1), (50, 5)];
    for (size, count) in sizes {
        for seed in seed..seed + count {
            let instance = instance(size, 100, Grouping::Configurations(size), seed)?;
            instances
                .common_subtrees
                .push(common_subtree(&instance, seed));
        }
    }
    for count in [100, 300, 1_000] {
        let instance = instance(count, count, Grouping::Singletons, seed)?;
        instances.assignments.push(assignment(&instance));
        instances.centralities.push(centrality(&instance));
    }
    println!("{}", serde_json::to_string(&instances)?);
    Ok(())
}

fn instance(
    modules: usize,
    spots: usize,
    grouping: Grouping,
    seed: u64,
) -> Result<Instance, Failure> {
    let raw = generate(&GeneratorParameters::new(modules, spots, seed).grouped(grouping))?;
    let problem = Scenario::try_from(raw)?.problem().clone();
    let target = Arc::clone(problem.target());
    Ok(Instance::new(Arc::new(problem), target))
}

fn common_subtree(instance: &Instance, seed: u64) -> CommonSubtree {
    let (matching, seconds) = timed(|| {
        common_subtree::solve(&MatchingInput {
            configuration: &instance.links,
            target: instance.target.topology(),
            weight: |module, spot| Some(instance.utilities.of(module, spot)),
        })
    });
    CommonSubtree {
        seed,
        configuration: Graph::of(&instance.links),
        target: Graph::of(instance.target.topology()),
        matched: matching.pairs.len(),
        utility: matching.utility.0,
        seconds,
    }
}

fn assignment(instance: &Instance) -> Assignment {
    let problem: &Arc<PlanningProblem> = &instance.problem;
    let (planning, seconds) = timed(|| {
        let mut planning = Planning::new(Arc::clone(problem));
        planning.take_all_turns();
        planning
    });
    let total: MicroUnits = problem
        .modules()
        .iter()
        .enumerate()
        .filter_map(|(position, module)| {
            let spot = instance.target.position_of(planning.spot_of(module.id)?)?;
            Some(instance.utilities.of(position, spot))
        })
        .sum();
    Assignment {
        utilities: (0..problem.modules().len())
            .map(|module| instance.utilities.row(module))
            .collect(),
        total: total.0,
        seconds,
    }
}

fn centrality(instance: &Instance) -> Centrality {
    let topology = instance.target.topology();
    let (values, seconds) = timed(|| betweenness(topology));
    Centrality {
        target: Graph::of(topology),
        betweenness: values.into_iter().map(|value| value.0).collect(),
        seconds,
    }
}

/// Runs a function several times; returns its result and the median of the processor times in seconds.
fn timed<T>(mut run: impl FnMut() -> T) -> (T, f64) {
    let begin = Instant::now();
    let mut times = Vec::new();
    loop {
        let start = processor_time();
        let answer = black_box(run());
        times.push(processor_time() - start);
        if times.len() == RUNS_MAX || begin.elapsed() > RUN_TIME_MAX {
            times.sort_unstable();
            return (answer, times[times.len() / 2].as_secs_f64());
        }
    }
}
