//! Formations without faults, on quiet and on rough networks.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation_generate::{GeneratorParameters, Grouping};
use formation_model::{ModuleId, ModulePhase, PlanningProblem, Scenario};
use formation_planner as planner;
use formation_sim::{
    CampaignParameters, Cluster, ClusterParameters, Ending, FaultKind, NetworkParameters, run_seed,
};

use crate::support::{Trial, drawn, in_phase, scenario, waiting_for_a_lease};

fn problem(modules: usize, spots: usize, seed: u64) -> PlanningProblem {
    let parameters = GeneratorParameters::new(modules, spots, seed).grouped(Grouping::Mixed);
    let raw = formation_generate::generate_apart(&parameters).unwrap();
    Scenario::try_from(raw).unwrap().problem().clone()
}

/// Runs a cluster until it has formed, and checks its plan against the offline one.
fn forms_as_planned(problem: &PlanningProblem, network: NetworkParameters, seed: u64) {
    let parameters = ClusterParameters {
        network,
        ..ClusterParameters::default()
    };
    let mut cluster = Cluster::new(problem, parameters, seed);
    cluster.keep_transcript();
    cluster.announce_problem(problem, 1);
    let formed = cluster.run_until(Duration::from_secs(600), Cluster::has_formed);
    assert!(
        formed,
        "seed {seed} did not form:\n{}",
        cluster.transcript()
    );
    let offline = planner::plan(Arc::new(problem.clone())).plan;
    for module in cluster.running() {
        let plan = cluster
            .agent(module)
            .and_then(|agent| agent.plan())
            .unwrap();
        assert_eq!(*plan, offline, "seed {seed}, {module}");
    }
}

/// Shows T1.
#[test]
fn agents_form_what_the_offline_planner_plans() {
    for seed in 0..40 {
        let modules = 2 + usize::try_from(seed).unwrap() % 12;
        forms_as_planned(
            &problem(modules, modules, seed),
            NetworkParameters::default(),
            seed,
        );
    }
}

/// Shows C1, G7.
#[test]
fn loss_delay_and_duplication_change_nothing() {
    for seed in 0..40 {
        forms_as_planned(&problem(8, 8, seed), NetworkParameters::rough(), seed);
    }
}

#[test]
fn too_many_and_too_few_modules_form_too() {
    for seed in 0..10 {
        forms_as_planned(&problem(12, 7, seed), NetworkParameters::default(), seed);
        forms_as_planned(&problem(7, 12, seed), NetworkParameters::default(), seed);
    }
}

#[test]
fn one_seed_replays_one_run() {
    let problem = problem(9, 9, 5);
    let run = || {
        let mut cluster = Cluster::new(&problem, ClusterParameters::default(), 77);
        cluster.keep_transcript();
        cluster.announce_problem(&problem, 1);
        cluster.run_until(Duration::from_secs(600), Cluster::has_formed);
        cluster.transcript().clone()
    };
    let transcript = run();
    assert!(transcript.events().contains(" settled spot="));
    assert_eq!(transcript, run());
}

/// The corners of a square, docked in a ring. Two neighbours are cut off, one after the other: each time, the rest plans without it, and
/// the other one undocks from it. When both are back they stay on their spots, and dock again.
/// Shows X2.
#[test]
fn modules_that_a_plan_has_parted_dock_again() {
    let problem = scenario(
        "target:
  frame_id: map
  spots:
    - {id: 1, x: 0.0, y: 0.0, theta: 0.0}
    - {id: 2, x: 1.0, y: 0.0, theta: 0.0}
    - {id: 3, x: 1.0, y: 1.0, theta: 0.0}
    - {id: 4, x: 0.0, y: 1.0, theta: 0.0}
  edges: [[1, 2], [2, 3], [3, 4], [4, 1]]
singletons:
  - {id: 1, x: 10.0, y: 0.0, theta: 0.0}
  - {id: 2, x: 12.0, y: 0.0, theta: 0.0}
  - {id: 3, x: 14.0, y: 0.0, theta: 0.0}
  - {id: 4, x: 16.0, y: 0.0, theta: 0.0}",
    );
    let mut trial = Trial::new(&problem, 1);
    trial.until(Cluster::has_formed);
    trial.run_for(Duration::from_secs(3));
    let links = |cluster: &Cluster| -> Vec<BTreeSet<ModuleId>> {
        let links = cluster.modules().into_iter();
        links
            .map(|one| cluster.links(one).unwrap().clone())
            .collect()
    };
    let docked = links(&trial.cluster);
    let one = ModuleId(1);
    let other = docked[0].first().copied().unwrap();
    for (aside, partner) in [(one, other), (other, one)] {
        let before = trial.newest_epoch();
        trial.cluster.cut(&[aside].into());
        trial.until(|cluster| {
            let others = cluster
                .running()
                .into_iter()
                .filter(|&module| module != aside);
            let mut standings = others.filter_map(|module| cluster.standing(module));
            standings.all(|standing| {
                let is_newer = standing.epoch.is_some_and(|epoch| epoch.number > before);
                is_newer && standing.phase == ModulePhase::Settled
            })
        });
        let left = trial.cluster.links(partner);
        assert!(left.is_some_and(|links| !links.contains(&aside)));
    }
    trial.cluster.heal();
    trial.until_formed_again();
    trial.run_for(Duration::from_secs(3));
    assert_eq!(links(&trial.cluster), docked);
}

/// Before any process runs there is no formation, and nobody who waits for one.
#[test]
fn a_run_is_not_over_before_its_processes_have_started() {
    let parameters = CampaignParameters {
        faults: FaultKind::None,
        problem: Some(Arc::new(problem(1, 1, 0))),
        ..CampaignParameters::default()
    };
    for seed in 0..16 {
        let report = run_seed(&parameters, seed).unwrap();
        assert_eq!(report.ending, Ending::Formed, "seed {seed}");
    }
}

/// All links fail while the members wait for the lease, and come back: they go on with the plan on which they had agreed.
/// Shows Q6.
#[test]
fn a_module_that_moves_does_not_show_that_it_waits_for_a_quorum() {
    let problem = drawn(6, 6, Grouping::Singletons, 3);
    let mut trial = Trial::with(&problem, waiting_for_a_lease(), 3);
    trial.until(|cluster| !in_phase(cluster, ModulePhase::Waiting).is_empty());
    let all: Vec<ModuleId> = (1..=6).map(ModuleId).collect();
    let links = all
        .iter()
        .flat_map(|&from| all.iter().map(move |&to| (from, to)));
    trial.cluster.sever(&links.collect());
    trial.until(|cluster| in_phase(cluster, ModulePhase::WaitingForQuorum).len() == 6);
    trial.cluster.heal();
    let mut have_moved = BTreeSet::new();
    while trial.settled().len() < 6 {
        trial.run_for(Duration::from_millis(5));
        for &module in &all {
            let standing = trial.cluster.standing(module).unwrap();
            if standing.moving {
                have_moved.insert(module);
                assert_ne!(standing.phase, ModulePhase::WaitingForQuorum, "{module}");
            }
        }
    }
    assert!(!have_moved.is_empty());
}
