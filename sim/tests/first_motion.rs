//! Nobody waits for a lease after a plan whose members are all there again.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::time::Duration;

use formation_generate::Grouping;
use formation_model::{ModuleId, TargetAnnouncement};
use formation_protocol::{AgentParameters, Event};
use formation_sim::{ClusterParameters, Stores};

use crate::support::{Trial, drawn, newest_epoch};

const FIRST: ModuleId = ModuleId(1);
const LAST: ModuleId = ModuleId(6);

fn waits_for_lease(event: &Event) -> bool {
    matches!(event, Event::WaitingForLease(_))
}

/// Six modules on their way by the first plan of a session, for which nobody waited.
fn on_the_way() -> Trial {
    let parameters = ClusterParameters {
        stores: Stores::All,
        speed_units_per_s: 0.2,
        ..ClusterParameters::default()
    };
    let mut trial = Trial::with(&drawn(6, 6, Grouping::Singletons, 2), parameters, 2);
    trial.until(|cluster| cluster.is_moving(LAST));
    trial.run_for(AgentParameters::default().lease * 2);
    assert_eq!(trial.count(waits_for_lease), 0);
    trial
}

/// Runs until all modules have formed in a later epoch; returns how often modules waited for a lease.
fn waits_until_formed(mut trial: Trial) -> usize {
    trial.until_formed_again();
    trial.count(waits_for_lease)
}

/// Shows A2.
#[test]
fn a_target_that_is_replaced_on_the_way_costs_no_lease() {
    let mut trial = on_the_way();
    let other = drawn(6, 6, Grouping::Singletons, 3);
    trial.cluster.announce_problem(&other, 2);
    assert_eq!(waits_until_formed(trial), 0);
}

/// Its process knows what the former run showed, and its drive stands.
/// Shows A2.
#[test]
fn a_process_that_begins_a_new_run_costs_no_lease() {
    let mut trial = on_the_way();
    trial
        .cluster
        .suspend(LAST, AgentParameters::default().lease * 3 / 2);
    assert_eq!(waits_until_formed(trial), 0);
}

/// A process that restarts knows of no plan. One that is let in as the former run is silent has shown nothing for a lease; but that run
/// may hear the others and move on, if both live.
#[test]
fn a_process_that_restarts_costs_a_lease() {
    for leaves in [true, false] {
        let mut trial = on_the_way();
        if leaves {
            trial.cluster.leave(LAST);
        } else {
            trial.cluster.crash(LAST);
        }
        trial.run_for(Duration::from_millis(500));
        trial.cluster.restart(LAST);
        assert!(waits_until_formed(trial) > 0, "{leaves}");
    }
}

/// Whoever is left out may move by the last plan, and is waited for.
#[test]
fn a_module_that_is_cut_off_costs_a_lease() {
    let mut trial = on_the_way();
    trial.cluster.cut(&[LAST].into());
    let before = trial.newest_epoch();
    trial.until(|cluster| cluster.is_moving(FIRST) && newest_epoch(cluster) > before);
    assert!(trial.count(waits_for_lease) > 0);
}

/// Its new run has shown nothing and is old, but knows the last plan, which a member of it that is gone may carry out.
#[test]
fn a_convener_that_is_idle_judges_its_last_plan_as_well() {
    let mut trial = Trial::new(&drawn(3, 3, Grouping::Singletons, 2), 2);
    trial.until_formed_again();
    trial.run_for(Duration::from_secs(5));
    let withdrawn = TargetAnnouncement {
        revision: 2,
        target: None,
        ..trial.cluster.announcement().unwrap().as_ref().clone()
    };
    trial.cluster.announce(withdrawn);
    trial.run_for(Duration::from_secs(5));
    trial.cluster.suspend(FIRST, Duration::from_secs(4));
    trial.run_for(Duration::from_secs(20));
    trial.cluster.crash(ModuleId(3));
    trial.run_for(Duration::from_secs(10));
    let other = drawn(3, 3, Grouping::Singletons, 3);
    trial.cluster.announce_problem(&other, 3);
    let announced = trial.cluster.now();
    trial.until(|cluster| cluster.is_moving(FIRST) || cluster.is_moving(ModuleId(2)));
    let took = trial.cluster.now() - announced;
    assert!(took < Duration::from_secs(60), "{took:?}");
    let stood_still = |event: &Event| matches!(event, Event::ClockStoodStill(_));
    assert_eq!(trial.count(stood_still), 1);
}
