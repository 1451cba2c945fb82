//! Machines that are suspended with their clocks.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::time::Duration;

use formation_generate::Grouping;
use formation_model::{Incarnation, ModuleId};
use formation_protocol::Event;
use formation_sim::{CampaignParameters, Cluster, FaultKind};

use crate::support::{Trial, drawn, run_all};

const SUSPENDED: Duration = Duration::from_secs(30);
/// A run that is younger is not known well enough to be found late.
const KNOWN: Duration = Duration::from_secs(3);

fn is_found(event: &Event) -> bool {
    matches!(event, Event::ClockStoodStill(_))
}

/// A formation of modules that have formed and heard each other for long enough.
fn formed(modules: usize, grouping: Grouping, seed: u64) -> Trial {
    let mut trial = Trial::new(&drawn(modules, modules, grouping, seed), seed);
    trial.until_formed_again();
    trial.run_for(KNOWN);
    trial
}

fn until_noted(trial: &mut Trial, wanted: impl Fn(&Event) -> bool) {
    for _ in 0..6_000 {
        if trial.count(&wanted) > 0 {
            return;
        }
        trial.run_for(Duration::from_millis(10));
    }
    panic!("not within a minute:\n{}", trial.cluster.transcript());
}

/// The clock of one module, another each time, stops for half a minute once all have settled.
/// Shows M8.
#[test]
fn a_module_whose_clock_stood_still_is_back_on_its_spot_within_a_minute() {
    for turn in 0..30 {
        let (seed, modules) = (turn as u64, 2 + turn % 9);
        let mut trial = formed(modules, Grouping::Mixed, seed);
        let running = trial.cluster.running();
        let mut running = running.iter().cycle().skip(turn);
        let module = *running.next().unwrap();
        trial.cluster.suspend(module, SUSPENDED);
        trial.run_for(SUSPENDED);
        assert_eq!(trial.count(is_found), 0, "{seed}");
        let woken = trial.cluster.now();
        trial.until_formed_again();
        assert_eq!(trial.count(is_found), 1, "{seed}");
        let took = trial.cluster.now() - woken;
        assert!(took < Duration::from_secs(60), "{seed}: {took:?}");
    }
}

/// Of two that wake one after the other, the second compares itself with those that go on and with the first, whose clock is later.
#[test]
fn two_of_three_machines_that_were_suspended_both_begin_new_runs() {
    let mut trial = formed(3, Grouping::Singletons, 5);
    trial.cluster.suspend(ModuleId(1), SUSPENDED);
    trial.run_for(Duration::from_secs(5));
    trial.cluster.suspend(ModuleId(2), SUSPENDED / 2);
    trial.run_for(SUSPENDED);
    trial.until(Cluster::has_formed);
    assert_eq!(trial.count(is_found), 2);
}

/// Its new run has hardly heard the others when its machine is suspended again.
/// Shows M8.
#[test]
fn a_machine_that_is_suspended_again_as_soon_as_it_woke_begins_another_run() {
    let again = [(150, 30), (400, 30), (1_400, 30), (1_400, 4)];
    for (turn, (millis, seconds)) in again.into_iter().enumerate() {
        let mut trial = formed(5, Grouping::Singletons, 6 + turn as u64);
        trial.cluster.suspend(ModuleId(3), SUSPENDED / 2);
        until_noted(&mut trial, is_found);
        trial.run_for(Duration::from_millis(millis));
        let span = Duration::from_secs(seconds);
        trial.cluster.suspend(ModuleId(3), span);
        trial.run_for(span);
        trial.until_formed_again();
        assert_eq!(trial.count(is_found), 2, "{millis}");
    }
}

/// The other module begins a new run that is not let in yet when this one is suspended, so it compares itself with a clock that it
/// has only heard.
#[test]
fn a_machine_that_is_suspended_while_it_refuses_the_new_run_of_another_begins_a_new_run() {
    let mut trial = formed(2, Grouping::Singletons, 5);
    trial.cluster.suspend(ModuleId(1), SUSPENDED / 10);
    until_noted(&mut trial, |event| {
        matches!(event, Event::DuplicateModule(ModuleId(1)))
    });
    trial.run_for(Duration::from_millis(300));
    trial.cluster.suspend(ModuleId(2), SUSPENDED);
    trial.run_for(SUSPENDED);
    trial.until_formed_again();
    assert_eq!(trial.count(is_found), 2);
}

/// Four of five stand on one machine: they are no evidence for each other.
#[test]
fn most_of_a_formation_on_one_machine_begins_new_runs_after_a_suspension() {
    let mut trial = formed(5, Grouping::Singletons, 4);
    for module in 2..=5 {
        trial.cluster.suspend(ModuleId(module), SUSPENDED);
    }
    trial.run_for(SUSPENDED);
    trial.until_formed_again();
    assert_eq!(trial.count(is_found), 4);
}

/// Three of eight stand on one machine, and of the others they hear one when they wake.
#[test]
fn a_machine_that_hears_few_others_when_it_wakes_begins_new_runs_after_more_than_a_lease() {
    let mut trial = formed(8, Grouping::Singletons, 4);
    for module in [3, 8, 4, 7] {
        trial.cluster.suspend(ModuleId(module), SUSPENDED);
    }
    trial.run_for(Duration::from_secs(2));
    for module in [1, 5, 6] {
        trial
            .cluster
            .suspend(ModuleId(module), Duration::from_millis(4_918));
    }
    trial.run_for(Duration::from_secs(8));
    assert_eq!(trial.count(is_found), 3);
    trial.until_formed_again();
}

/// They are most of the formation, and sleep for less than it takes the others to miss them.
#[test]
fn a_machine_that_is_suspended_for_little_more_than_a_lease_begins_new_runs() {
    let mut trial = formed(8, Grouping::Singletons, 4);
    for module in 1..=5 {
        let span = Duration::from_millis(3_437);
        trial.cluster.suspend(ModuleId(module), span);
    }
    trial.until_formed_again();
    assert_eq!(trial.count(is_found), 5);
}

/// One module is slow to be heard and then is not: the others halt for a moment, and none of them begins a new run for it.
#[test]
fn one_link_that_becomes_faster_is_no_reason_for_a_new_run() {
    let problem = drawn(6, 6, Grouping::Singletons, 3);
    // A participant that claims to have run for 22 s, and for 25 s a second later, which is less than a lease; and one that is heard for
    // longer.
    for (heard, jump) in [(2, 3), (15, 3)] {
        let mut trial = Trial::new(&problem, 3);
        trial.until_formed_again();
        let stranger = ModuleId(99).run(Incarnation(1));
        for uptime in (20..=20 + heard).chain([20 + heard + jump]) {
            trial.run_for(Duration::from_secs(1));
            trial.cluster.forge_heartbeat(stranger, uptime, None);
        }
        trial.run_for(Duration::from_secs(5));
        let doubts = |event: &Event| matches!(event, Event::ClockInDoubt { .. });
        assert_eq!(trial.count(doubts), 6, "{heard}");
        assert_eq!(trial.count(is_found), 0, "{heard}");
        assert!(trial.cluster.has_formed());
    }
}

#[test]
fn machines_that_are_suspended_leave_no_hole() {
    let parameters = CampaignParameters {
        faults: FaultKind::Suspended,
        modules_min: 2,
        modules_max: 12,
        ..CampaignParameters::default()
    };
    run_all(&parameters, 0..150);
}
