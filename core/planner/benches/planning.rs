//! The time that planning takes, next to third-party solvers: `cargo bench -p formation_planner`.

#![allow(
    missing_docs,
    clippy::unwrap_used,
    reason = "a program of its own around the core: a fault ends it"
)]

mod support;

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use criterion::{
    BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, criterion_group, criterion_main,
};
use formation_generate::{GeneratorParameters, Grouping, Random, generate};
use formation_model::{PlanningProblem, Scenario, Topology};
use formation_planner::assignment::Instance;
use formation_planner::placement::{MatchingInput, common_subtree};
use formation_planner::{self as planner, Planning};
use pathfinding::matrix::Matrix;
use pathfinding::prelude::kuhn_munkres;
use petgraph::algo::subgraph_isomorphisms_iter;
use petgraph::graph::UnGraph;

use support::processor_time;

/// Measures the processor time of the thread.
struct ProcessorTime;

impl Measurement for ProcessorTime {
    type Intermediate = Duration;
    type Value = Duration;

    fn start(&self) -> Duration {
        processor_time()
    }

    fn end(&self, start: Duration) -> Duration {
        processor_time() - start
    }

    fn add(&self, first: &Duration, second: &Duration) -> Duration {
        *first + *second
    }

    fn zero(&self) -> Duration {
        Duration::ZERO
    }

    fn to_f64(&self, value: &Duration) -> f64 {
        WallTime.to_f64(value)
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        WallTime.formatter()
    }
}

/// Whole plans are computed for this many seeds in turn, so that no single instance decides a figure.
const SEEDS: u64 = 10;

fn problem(modules: usize, spots: usize, grouping: Grouping, seed: u64) -> Arc<PlanningProblem> {
    let raw = generate(&GeneratorParameters::new(modules, spots, seed).grouped(grouping)).unwrap();
    Arc::new(Scenario::try_from(raw).unwrap().problem().clone())
}

fn problems(modules: usize, grouping: Grouping) -> Vec<Arc<PlanningProblem>> {
    (0..SEEDS)
        .map(|seed| problem(modules, modules, grouping, seed))
        .collect()
}

/// All turns, without the acting order.
fn allocate(problem: &Arc<PlanningProblem>) -> usize {
    Planning::new(Arc::clone(problem)).take_all_turns().len()
}

fn instance(problem: &Arc<PlanningProblem>) -> Instance {
    Instance::new(Arc::clone(problem), Arc::clone(problem.target()))
}

fn graph(topology: &Topology) -> UnGraph<(), (), usize> {
    let mut graph = UnGraph::default();
    for _ in 0..topology.node_count() {
        graph.add_node(());
    }
    for &(first, second) in topology.edges() {
        graph.add_edge(first.into(), second.into(), ());
    }
    graph
}

/// A random connected part of a tree, its nodes in random order, so that no solver profits from the numbers.
fn part_of(topology: &Topology, size: usize) -> Topology {
    let mut random = Random::from_seed(1);
    let mut nodes = vec![random.index(topology.node_count())];
    while nodes.len() < size {
        let adjacent = topology.neighbours(nodes[random.index(nodes.len())]);
        let neighbour = adjacent[random.index(adjacent.len())];
        if !nodes.contains(&neighbour) {
            nodes.push(neighbour);
        }
    }
    random.shuffle(&mut nodes);
    let edges: Vec<(usize, usize)> = topology
        .edges()
        .iter()
        .filter_map(|&(first, second)| {
            let label = |node| nodes.iter().position(|&other| other == node);
            Some((label(first)?, label(second)?))
        })
        .collect();
    Topology::new(size, &edges)
}

fn common_subtrees(criterion: &mut Criterion<ProcessorTime>) {
    let mut group = criterion.benchmark_group("common_subtree");
    for size in [10, 20, 30, 50, 100] {
        let problem = problem(size, 100, Grouping::Configurations(size), 1);
        let instance = instance(&problem);
        group.bench_function(BenchmarkId::from_parameter(size), |bencher| {
            bencher.iter(|| {
                common_subtree::solve(&MatchingInput {
                    configuration: &instance.links,
                    target: instance.target.topology(),
                    weight: |module, spot| Some(instance.utilities.of(module, spot)),
                })
            });
        });
    }
    group.finish();
}

/// The place of a whole configuration: the first fit by petgraph, and the best fit by our solver, on the same pairs of trees.
fn fits(criterion: &mut Criterion<ProcessorTime>) {
    for size in [10, 20, 30] {
        let mut group = criterion.benchmark_group(format!("fit_of_{size}_in_100"));
        let problem = problem(100, 100, Grouping::Singletons, 1);
        let instance = instance(&problem);
        let target = instance.target.topology();
        let part = part_of(target, size);
        group.bench_function("ours_best", |bencher| {
            bencher.iter(|| {
                let matching = common_subtree::solve(&MatchingInput {
                    configuration: &part,
                    target,
                    weight: |module, spot| Some(instance.utilities.of(module, spot)),
                });
                assert_eq!(matching.pairs.len(), size);
                matching
            });
        });
        let (pattern, host) = (graph(&part), graph(target));
        group.bench_function("petgraph_vf2_first", |bencher| {
            bencher.iter(|| {
                let (pattern, host) = (&pattern, &host);
                let (mut nodes, mut edges) = (|_: &(), _: &()| true, |_: &(), _: &()| true);
                let mut fits =
                    subgraph_isomorphisms_iter(&pattern, &host, &mut nodes, &mut edges).unwrap();
                // Only the first: `size_hint` of the iterator panics at 21 nodes.
                let first = fits.next().unwrap();
                assert_eq!(first.len(), size);
                first
            });
        });
        group.finish();
    }
}

fn plans(criterion: &mut Criterion<ProcessorTime>) {
    for (name, whole) in [("allocation_of_100", false), ("plan_of_100", true)] {
        let mut group = criterion.benchmark_group(name);
        for (label, grouping) in [
            ("singletons", Grouping::Singletons),
            ("mixed", Grouping::Mixed),
            ("configurations_of_10", Grouping::Configurations(10)),
            ("configurations_of_20", Grouping::Configurations(20)),
            ("configurations_of_25", Grouping::Configurations(25)),
            ("configurations_of_50", Grouping::Configurations(50)),
        ] {
            let problems = problems(100, grouping);
            let mut turns = problems.iter().cycle();
            group.bench_function(label, |bencher| {
                bencher.iter(|| {
                    let problem = turns.next().unwrap();
                    if whole {
                        planner::plan(Arc::clone(problem)).decisions.len()
                    } else {
                        allocate(problem)
                    }
                });
            });
        }
        group.finish();
    }
}

/// Single modules only: our turns, and one central solution by the method of Kuhn and Munkres. Our time includes the
/// computation of utilities from the poses; the other solver gets the finished matrix.
fn assignments(criterion: &mut Criterion<ProcessorTime>) {
    for count in [100, 300, 1_000] {
        let mut group = criterion.benchmark_group(format!("assignment_of_{count}"));
        let problem = problem(count, count, Grouping::Singletons, 1);
        group.bench_function("ours", |bencher| bencher.iter(|| allocate(&problem)));
        let instance = instance(&problem);
        let matrix = Matrix::from_fn(count, count, |(module, spot)| {
            instance.utilities.of(module, spot).0
        });
        slow(&mut group, count);
        group.bench_function("pathfinding_kuhn_munkres", |bencher| {
            bencher.iter(|| kuhn_munkres(black_box(&matrix)).0);
        });
        group.finish();
    }
}

/// Ten samples of one run each, for runs that take long.
fn slow(group: &mut BenchmarkGroup<'_, ProcessorTime>, count: usize) {
    if count >= 1_000 {
        group.sampling_mode(SamplingMode::Flat);
        group.warm_up_time(Duration::from_millis(1));
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .with_measurement(ProcessorTime)
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1));
    targets = common_subtrees, fits, plans, assignments
}
criterion_main!(benches);
