//! Helpers of the planner's tests: seeded instances and slow, obvious solvers.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::sync::Arc;

use formation_generate::{GeneratorParameters, Grouping, generate};
use formation_model::{PlannerParameters, PlanningProblem, Scenario, Topology, TurnOrder};

pub mod brute_force;
pub mod hungarian;
mod numbers;
pub mod paper;
pub mod world;

pub use numbers::Numbers;

impl Numbers {
    /// Uniform in `least..=most`.
    pub fn within(&mut self, least: i64, most: i64) -> i64 {
        let width = u64::try_from(most - least + 1).unwrap();
        least + i64::try_from(self.next() % width).unwrap()
    }
}

/// A random tree in which each node is linked to a random earlier one, with shuffled numbers.
pub fn random_tree(numbers: &mut Numbers, node_count: usize) -> Topology {
    let mut labels: Vec<usize> = (0..node_count).collect();
    for last in (1..node_count).rev() {
        labels.swap(last, numbers.below(last + 1));
    }
    let edges: Vec<(usize, usize)> = (1..node_count)
        .map(|node| (labels[node], labels[numbers.below(node)]))
        .collect();
    Topology::new(node_count, &edges)
}

/// A generated scenario with other planner parameters.
pub fn problem(
    modules: usize,
    spots: usize,
    grouping: Grouping,
    seed: u64,
    parameters: PlannerParameters,
) -> Arc<PlanningProblem> {
    let raw = generate(&GeneratorParameters::new(modules, spots, seed).grouped(grouping)).unwrap();
    with_parameters(Scenario::try_from(raw).unwrap().problem(), parameters)
}

/// The text of a scenario file of the launcher.
pub fn shipped_scenario(name: &str) -> &'static str {
    macro_rules! texts {
        ($($name:literal),+) => {
            match name {
                $($name => include_str!(concat!("../../../../launch_scripts/scenarios/", $name, ".yaml")),)+
                _ => panic!("{name} is not listed here"),
            }
        };
    }
    texts!(
        "case_studies/case_6_ring_with_tail",
        "paper/eviction_chain",
        "paper/missing_candidate",
        "paper/theorem_1_hole",
        "paper/theorem_1_walled_in",
        "paper/theorem_3_stuck"
    )
}

/// The same problem with other planner parameters.
pub fn with_parameters(
    problem: &PlanningProblem,
    parameters: PlannerParameters,
) -> Arc<PlanningProblem> {
    Arc::new(
        PlanningProblem::new(
            Arc::clone(problem.target()),
            parameters,
            problem.modules().to_vec(),
        )
        .unwrap(),
    )
}

pub fn size_first() -> PlannerParameters {
    PlannerParameters {
        order: TurnOrder::SizeFirst,
        ..PlannerParameters::default()
    }
}
