//! Stopping all modules on command, until they are resumed.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::time::Duration;

use crate::support::{Trial, drawn, in_phase, spots};
use formation_generate::Grouping;
use formation_model::{Message, ModuleId, ModulePhase, STAMP_AHEAD_MAX, Stop};
use formation_protocol::{AgentParameters, Event};
use formation_sim::{Cluster, ClusterParameters};

fn moving(cluster: &Cluster) -> Vec<ModuleId> {
    let modules = cluster.modules().into_iter();
    modules
        .filter(|&module| cluster.is_moving(module))
        .collect()
}

/// Runs for a while in which nothing may move.
#[track_caller]
fn stands_still(trial: &mut Trial, duration: Duration) {
    let end = trial.cluster.now() + duration;
    let moved = trial
        .cluster
        .run_until(end, |cluster| !moving(cluster).is_empty());
    assert!(!moved, "{:?}", moving(&trial.cluster));
}

/// Shows H1.
#[test]
fn a_stop_in_mid_motion_reaches_all_and_lasts_until_it_is_resumed() {
    let lease = AgentParameters::default().lease;
    for seed in 0..6 {
        let mut trial = Trial::new(&drawn(8, 7, Grouping::Mixed, seed), seed);
        trial.until(|cluster| !moving(cluster).is_empty());
        let on_the_way = moving(&trial.cluster)[0];
        let informed = trial
            .cluster
            .running()
            .into_iter()
            .find(|&one| one != on_the_way);
        let stop = |revision, stopped| Stop { revision, stopped };
        trial.cluster.stop(informed.unwrap(), stop(1, true));
        trial.run_for(lease);
        stands_still(&mut trial, Duration::from_secs(60));
        // Neither a restart nor the epochs that it brings end the stop.
        trial.cluster.crash(on_the_way);
        trial.cluster.restart(on_the_way);
        stands_still(&mut trial, Duration::from_secs(60));
        assert!(trial.newest_epoch() > 1, "seed {seed}");
        assert_eq!(in_phase(&trial.cluster, ModulePhase::Listening), []);
        // An older command changes nothing.
        trial.cluster.stop(on_the_way, stop(0, false));
        stands_still(&mut trial, Duration::from_secs(10));
        trial.cluster.stop(on_the_way, stop(2, false));
        trial.until(Cluster::has_formed);
        assert_eq!(spots(&trial.settled()).len(), 7, "seed {seed}");
        let failed = trial.count(|event| matches!(event, Event::MotionOverdue(_)));
        assert_eq!(failed, 0, "seed {seed}");
    }
}

/// A stranger raises the revision step by step. A module that starts later knows none of the steps, and stands still all the same.
/// Shows H1.
#[test]
fn a_stop_of_a_high_revision_reaches_a_module_that_starts_later() {
    let mut trial = Trial::new(&drawn(3, 3, Grouping::Singletons, 3), 3);
    trial.until(|cluster| !moving(cluster).is_empty());
    let late = moving(&trial.cluster)[0];
    trial.cluster.crash(late);
    for (revision, stopped) in [(1 << 20, false), (1 << 21, true)] {
        let stop = Stop { revision, stopped };
        trial.cluster.inject(&Message::Stop(stop));
    }
    trial.cluster.restart(late);
    trial.run_for(Duration::from_secs(60));
    let mut noted = trial.noted.iter();
    assert!(noted.any(|(module, event)| *module == late && matches!(event, Event::Stopped)));
}

/// A stranger has raised the revision as far as the clock of module 1 allows, which is a minute ahead.
/// Shows H1.
#[test]
fn a_stop_that_only_one_module_takes_over_reaches_the_others_in_time() {
    let parameters = ClusterParameters {
        speed_units_per_s: 0.02,
        ..ClusterParameters::default()
    };
    let mut trial = Trial::with(&drawn(5, 5, Grouping::Singletons, 3), parameters, 3);
    let fast = ModuleId(1);
    trial.cluster.set_clock_ahead(fast, Duration::from_secs(60));
    trial.until(|cluster| !moving(cluster).is_empty());
    let run = trial.cluster.run_of(fast).unwrap();
    let uptime = u64::try_from(trial.cluster.now().as_micros()).unwrap();
    let revision = STAMP_AHEAD_MAX + run.incarnation.0 + uptime - 600_000;
    for (revision, stopped) in [(revision, false), (revision + 1, true)] {
        let stop = Stop { revision, stopped };
        trial.cluster.inject(&Message::Stop(stop));
        trial.run_for(Duration::from_secs(5));
    }
    trial.run_for(Duration::from_secs(60));
    let stopped = trial.count(|event| matches!(event, Event::Stopped));
    assert_eq!(stopped, 5);
}

/// Shows H2.
#[test]
fn a_module_that_is_cut_off_when_all_are_stopped_halts_within_the_lease() {
    let lease = AgentParameters::default().lease;
    let mut trial = Trial::new(&drawn(6, 6, Grouping::Singletons, 3), 3);
    trial.until(|cluster| !moving(cluster).is_empty());
    let on_the_way = moving(&trial.cluster)[0];
    let others: Vec<ModuleId> = trial.cluster.running().into_iter().collect();
    let informed = others.into_iter().find(|&one| one != on_the_way).unwrap();
    trial.cluster.cut(&[on_the_way].into());
    let stopped = Stop {
        revision: 1,
        stopped: true,
    };
    trial.cluster.stop(informed, stopped);
    trial.run_for(lease);
    stands_still(&mut trial, Duration::from_secs(30));
    trial.cluster.heal();
    stands_still(&mut trial, Duration::from_secs(60));
    trial.run_for(Duration::ZERO);
    let stopped = trial.count(|event| matches!(event, Event::Stopped));
    assert_eq!(stopped, 6, "each module reports it once");
}
