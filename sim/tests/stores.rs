//! Modules whose memory outlives their process.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::time::Duration;

use crate::support::{Trial, drawn};
use formation::generate::Grouping;
use formation_sim::{CampaignParameters, Cluster, ClusterParameters, Ending, FaultKind, run_seed};

fn with_stores() -> ClusterParameters {
    ClusterParameters {
        stores: true,
        names_founders: true,
        ..ClusterParameters::default()
    }
}

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
    assert!((5..60).contains(&formed), "{formed} of 60 formed");
}

#[test]
#[ignore = "a soak: 2,000 storms of each kind"]
fn two_thousand_storms() {
    assert_eq!(storms(true, 0..2_000), 2_000);
    println!("without stores {} of 2,000 formed", storms(false, 0..2_000));
}
