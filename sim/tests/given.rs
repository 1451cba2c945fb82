//! The policy `given` carried out by simulated agents.

use std::sync::Arc;
use std::time::Duration;

use formation_generate::{GeneratorParameters, Grouping, Random, generate_apart};
use formation_model::{
    ModuleId, PlanningProblem, Policy, RawGiven, RawGivenSpot, Scenario, SpotId,
};
use formation_planner::given_by;
use formation_protocol::Event;
use formation_sim::Cluster;

use crate::support::{Trial, scenario};

fn drawn(seed: u64) -> (PlanningProblem, Vec<(ModuleId, SpotId)>) {
    let mut random = Random::from_seed(seed);
    let grouping = [
        Grouping::Singletons,
        Grouping::Mixed,
        Grouping::Configurations(3),
    ][random.index(3)];
    let (modules, spots) = [(9, 9), (10, 7)][random.index(2)];
    let parameters = GeneratorParameters::new(modules, spots, seed).grouped(grouping);
    let scenario = Scenario::try_from(generate_apart(&parameters).unwrap()).unwrap();
    let problem = scenario.problem().clone();
    let mut ids: Vec<ModuleId> = problem.modules().iter().map(|module| module.id).collect();
    for last in (1..ids.len()).rev() {
        ids.swap(last, random.index(last + 1));
    }
    let spots = problem.target().spots().iter().map(|spot| spot.id);
    let mut allocation: Vec<(ModuleId, SpotId)> = ids.into_iter().zip(spots).collect();
    allocation.sort_unstable();
    (problem, allocation)
}

#[test]
fn random_allocations_are_carried_out_to_the_letter() {
    for seed in 0..50 {
        let (problem, allocation) = drawn(seed);
        let given = problem
            .with_given(&given_by(&problem, &allocation))
            .unwrap();
        let mut trial = Trial::new(&given, seed);
        trial.until(Cluster::has_formed);
        let mut settled = trial.settled();
        settled.sort_unstable();
        assert_eq!(settled, allocation, "seed {seed}");
    }
}

/// Agents that are asked for what they cannot carry out, past the checks of scenarios, say so and stay where they are.
#[test]
fn an_impossible_allocation_moves_nobody() {
    let problem = scenario(
        "{target: {spots: [{id: 1, x: 5, y: 5}, {id: 2, x: 6, y: 5}], edges: [[1, 2]]}, \
         singletons: [{id: 1, x: 5, y: 0}, {id: 2, x: 7, y: 0}]}",
    );
    let entry = |module, spot| RawGivenSpot { module, spot };
    for (allocation, reason) in [
        (
            vec![entry(1, 1)],
            "target.allocation: module 2 is missing, although there are spots for all modules",
        ),
        (
            vec![entry(1, 1), entry(3, 2)],
            "target.allocation: module 3 takes no part; announce an allocation for the modules that do",
        ),
    ] {
        let raw = RawGiven {
            allocation,
            detached: Vec::new(),
        };
        let target = problem.target().as_ref().clone().with_given(&raw).unwrap();
        let parameters = problem.parameters().under(Policy::Given);
        let modules = problem.modules().to_vec();
        let asked = PlanningProblem::new(Arc::new(target), parameters, modules).unwrap();
        let mut trial = Trial::new(&asked, 1);
        trial.run_for(Duration::from_secs(60));
        let reported = trial.noted.iter().find_map(|(_, event)| match event {
            Event::GivenRefused(reason) => Some(reason.to_string()),
            _ => None,
        });
        assert_eq!(reported.as_deref(), Some(reason));
        assert_eq!(trial.rosters, [], "nothing to plan for is published");
        for module in problem.modules() {
            let body = trial.cluster.body(module.id).unwrap();
            assert_eq!(body, module.pose);
        }
    }
}
