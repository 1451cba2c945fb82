//! Plans that take their time, computed by the host of each agent.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation_generate::Grouping;
use formation_model::{ModuleId, ModulePhase};
use formation_planner as planner;
use formation_protocol::Event;
use formation_sim::{Cluster, ClusterParameters};

use crate::support::{Trial, drawn, in_phase, settled};

/// Clusters in which every plan takes up to `plan_time_max`.
fn planned_within(plan_time_max: Duration) -> ClusterParameters {
    ClusterParameters {
        plan_time_max: Some(plan_time_max),
        ..ClusterParameters::default()
    }
}

/// Shows T5.
#[test]
fn plans_of_the_host_are_those_of_the_agents() {
    for seed in 0..10 {
        let problem = drawn(8, 8, Grouping::Mixed, seed);
        let mut trial = Trial::with(&problem, planned_within(Duration::from_secs(8)), seed);
        trial.until(Cluster::has_formed);
        // The heartbeats continue, and no member is taken for stuck.
        assert_eq!(trial.newest_epoch(), 1, "{}", trial.cluster.transcript());
        let offline = planner::plan(Arc::new(problem)).plan;
        for module in trial.cluster.running() {
            let plan = trial.cluster.agent(module).and_then(|agent| agent.plan());
            assert_eq!(plan, Some(&offline));
        }
    }
}

/// Shows T5.
#[test]
fn a_member_that_computes_its_plan_is_not_stuck() {
    let problem = drawn(6, 6, Grouping::Singletons, 3);
    let mut trial = Trial::with(&problem, planned_within(Duration::ZERO), 3);
    let slow = problem.modules()[2].id;
    // Longer than `stuck_s` and `suspicion_s`, and shorter than `plan_limit_s`.
    trial.cluster.plan_slowly(slow, Duration::from_secs(40));
    trial.until(|cluster| !in_phase(cluster, ModulePhase::Computing).is_empty());
    trial.run_for(Duration::from_secs(30));
    assert_eq!(trial.in_phase(ModulePhase::Computing), [slow]);
    trial.until(Cluster::has_formed);
    assert_eq!(trial.newest_epoch(), 1, "{}", trial.cluster.transcript());
}

#[test]
fn a_member_that_computes_for_too_long_is_left_out() {
    let problem = drawn(6, 6, Grouping::Singletons, 3);
    let mut trial = Trial::with(&problem, planned_within(Duration::ZERO), 3);
    let slow = problem.modules()[2].id;
    trial
        .cluster
        .plan_slowly(slow, Duration::from_secs(100_000));
    let others: BTreeSet<ModuleId> = problem
        .modules()
        .iter()
        .map(|module| module.id)
        .filter(|&module| module != slow)
        .collect();
    trial.until(|cluster| {
        let settled = settled(cluster).into_iter();
        settled.map(|(module, _)| module).eq(others.iter().copied())
    });
    let overdue = |event: &Event| matches!(event, Event::PlanOverdue(_));
    assert_eq!(trial.count(overdue), 1, "{}", trial.cluster.transcript());
    // It is called again after longer and longer times, up to sixteen times `stuck_s`; each call ends after `plan_limit_s`, and
    // costs a second epoch.
    let before = trial.convened.len();
    trial.run_for(Duration::from_secs(3_600));
    let opened = trial.convened.len() - before;
    assert!(opened <= 40, "{opened} epochs in an hour");
}

#[test]
fn a_convener_that_computes_which_pins_stay_is_waited_for() {
    let problem = drawn(8, 7, Grouping::Singletons, 4);
    let mut trial = Trial::with(&problem, planned_within(Duration::ZERO), 4);
    trial.until(Cluster::has_formed);
    let running = trial.cluster.running();
    let lowest = *running.first().unwrap();
    let second = *running.iter().nth(1).unwrap();
    // Longer than `gather_limit_s` and `stuck_s`.
    trial.cluster.plan_slowly(second, Duration::from_secs(50));
    trial.cluster.crash(lowest);
    trial.until_formed_again();
    assert_eq!(trial.newest_epoch(), 2, "{}", trial.cluster.transcript());
    assert_eq!(trial.rosters.last().unwrap().epoch.convener, second);
}
