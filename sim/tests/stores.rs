//! Modules whose memory outlives their process.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::time::Duration;

use crate::support::{Trial, drawn, run_each, spots};
use formation_generate::Grouping;
use formation_model::{ModuleId, Stop};
use formation_protocol::{Agent, AgentParameters, Mutation};
use formation_sim::{
    AgentFactory, CampaignParameters, Cluster, ClusterParameters, Ending, FaultKind, Stores,
    run_seed,
};

fn with_stores() -> ClusterParameters {
    ClusterParameters {
        stores: Stores::All,
        ..ClusterParameters::default()
    }
}

/// Shows Q8.
#[test]
fn whole_formations_restart_and_go_on() {
    for seed in 0..6 {
        let problem = drawn(6, 6, Grouping::Mixed, seed);
        let mut trial = Trial::with(&problem, with_stores(), seed);
        trial.until(Cluster::has_formed);
        let before = trial.settled();
        for module in trial.cluster.running() {
            trial.cluster.crash(module);
        }
        trial.run_for(Duration::from_secs(20));
        for module in problem.modules() {
            trial.cluster.restart(module.id);
        }
        trial.until_formed_again();
        // Each module remembers its epochs and its spot.
        assert_eq!(trial.settled(), before, "seed {seed}");
    }
}

#[test]
fn a_formation_on_its_way_restarts_and_finishes() {
    for seed in 0..6 {
        let problem = drawn(6, 6, Grouping::Singletons, seed);
        let mut trial = Trial::with(&problem, with_stores(), seed);
        trial.until(|cluster| {
            cluster
                .running()
                .iter()
                .any(|&module| cluster.plan_in_motion(module).is_some())
        });
        for module in trial.cluster.running() {
            trial.cluster.crash(module);
            trial.cluster.restart(module);
        }
        trial.until_formed_again();
        assert_eq!(trial.settled().len(), 6, "seed {seed}");
    }
}

/// Forms with one spare and stores.
fn formed_with_spare(seed: u64, mutation: Option<Mutation>) -> Trial {
    let agents = AgentFactory::new(move |identity, parameters, now| {
        let agent = Agent::new(identity, parameters, now);
        match mutation {
            Some(mutation) => agent.mutated(mutation),
            None => agent,
        }
    });
    let problem = drawn(6, 5, Grouping::Singletons, seed);
    let mut trial = Trial::of_agents(&problem, with_stores(), seed, agents);
    trial.until(Cluster::has_formed);
    trial
}

/// Lets all processes end, and all modules but one restart.
fn restart_all_but(trial: &mut Trial, lost: ModuleId) {
    for module in trial.cluster.modules() {
        trial.cluster.crash(module);
    }
    trial.run_for(Duration::from_secs(20));
    for module in trial.cluster.modules() {
        if module != lost {
            trial.cluster.restart(module);
        }
    }
    trial.until_formed_again();
}

/// The number of modules on or near the spot of a module.
fn bodies_at(trial: &Trial, module: ModuleId) -> usize {
    let here = trial.cluster.body(module).unwrap();
    let modules = trial.cluster.modules().into_iter();
    modules
        .filter_map(|other| trial.cluster.body(other))
        .filter(|body| body.distance_to(&here).to_units() < 0.5)
        .count()
}

/// A body is known from before, or becomes known by the restart itself.
/// Shows Q8.
#[test]
fn a_body_on_a_spot_outlives_the_restart_of_all_that_know_it() {
    for seed in 0..12 {
        let mut trial = formed_with_spare(seed, None);
        let (lost, spot) = trial.settled()[2];
        if seed % 2 == 0 {
            trial.cluster.crash(lost);
            trial.until_formed_again();
        }
        restart_all_but(&mut trial, lost);
        assert_eq!(bodies_at(&trial, lost), 1, "seed {seed}");
        assert!(!spots(&trial.settled()).contains(&spot), "seed {seed}");
        // So does its removal.
        let before = trial.newest_epoch();
        trial.cluster.remove(lost);
        trial.until_formed_after(before);
        assert_eq!(spots(&trial.settled()).len(), 5, "seed {seed}");
        restart_all_but(&mut trial, lost);
        assert_eq!(spots(&trial.settled()).len(), 5, "seed {seed}");
    }
}

#[test]
fn stores_without_bodies_lead_to_two_bodies_on_one_spot() {
    let mut trial = formed_with_spare(0, Some(Mutation::ForgetStoredBodies));
    let (lost, _) = trial.settled()[2];
    restart_all_but(&mut trial, lost);
    assert_eq!(bodies_at(&trial, lost), 2);
}

/// Shows H2.
#[test]
fn a_stop_outlives_the_restart_of_all_modules() {
    for seed in 0..6 {
        let problem = drawn(6, 6, Grouping::Singletons, seed);
        let mut trial = Trial::with(&problem, with_stores(), seed);
        let is_moving = |cluster: &Cluster| {
            let modules = cluster.running();
            modules.into_iter().any(|module| cluster.is_moving(module))
        };
        trial.until(is_moving);
        let stop = |revision, stopped| Stop { revision, stopped };
        trial.cluster.stop(ModuleId(1), stop(1, true));
        trial.run_for(AgentParameters::default().lease);
        for module in trial.cluster.running() {
            trial.cluster.crash(module);
            trial.cluster.restart(module);
        }
        let end = trial.cluster.now() + Duration::from_secs(120);
        assert!(!trial.cluster.run_until(end, is_moving), "seed {seed}");
        trial.cluster.stop(ModuleId(1), stop(2, false));
        trial.until(Cluster::has_formed);
        assert_eq!(spots(&trial.settled()).len(), 6, "seed {seed}");
    }
}

fn storms(stores: bool, seeds: std::ops::Range<u64>) -> usize {
    let parameters = CampaignParameters {
        faults: FaultKind::Storm,
        modules_min: 2,
        modules_max: 12,
        stores: Some(stores),
        ..CampaignParameters::default()
    };
    let mut formed = 0;
    for seed in seeds {
        let report = run_seed(&parameters, seed).unwrap();
        assert!(
            report.violations.is_empty(),
            "seed {seed}: {:?}",
            report.violations
        );
        assert_ne!(report.ending, Ending::Neither, "seed {seed}");
        formed += usize::from(report.ending == Ending::Formed);
    }
    formed
}

#[test]
fn after_a_storm_all_modules_with_stores_form() {
    assert_eq!(storms(true, 0..60), 60);
}

/// The monitor confirms of each group that waits that it lacks a majority.
#[test]
fn after_a_storm_modules_without_stores_form_or_rightly_wait() {
    let formed = storms(false, 0..60);
    assert!(formed > 40, "{formed} of 60 formed");
}

/// A convener that restarted without a store opens an epoch again whose number it used before. The monitor counts both rosters.
#[test]
fn after_a_storm_modules_wait_rightly_for_those_of_an_epoch_that_was_opened_twice() {
    let seeds = [77_012_747, 77_019_096, 77_020_627];
    run_each(FaultKind::Storm, [2, 12], &seeds);
}

/// A convener has the whole plan, and its store the roster, before the roster is published. The monitor counts that roster.
#[test]
fn modules_wait_rightly_for_those_of_a_roster_that_was_planned_before_it_was_published() {
    run_each(FaultKind::Mixed, [2, 12], &[77_017_863]);
}

#[test]
#[ignore = "a soak: 2,000 storms of each kind"]
fn two_thousand_storms() {
    assert_eq!(storms(true, 0..2_000), 2_000);
    println!("without stores {} of 2,000 formed", storms(false, 0..2_000));
}
