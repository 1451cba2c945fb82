//! Processes that begin new runs of their modules with what these know.

use super::*;

/// As a process does whose machine gets another address: the other participant sends as the next runs of the modules.
#[test]
fn a_majority_that_joins_the_graph_again_still_counts_without_a_file() {
    let (mut first, target) = host(&[4, 5]);
    first.take_message(TARGET_PUBLISHER, target.clone());
    let (mut second, _) = host(&[17]);
    second.take_message(TARGET_PUBLISHER, target.clone());
    let mut hosts = vec![first, second];
    let (rejoins, end) = (Duration::from_secs(30), Duration::from_secs(90));
    run(&mut hosts, rejoins);
    assert_eq!(phase_of(&hosts[1], 17), Some(ModulePhase::Settled));

    let left = hosts.remove(0);
    let mut modules = left.modules();
    for (identity, _) in &mut modules {
        assert!(identity.last_plan.is_some(), "{identity:?}");
        identity.incarnation.0 += 5;
    }
    let (parameters, motion) = (AgentParameters::default(), Motion::default());
    let memory = left.into_memory();
    let mut again = Host::new(SourceId(200), modules, parameters, &motion, &[], memory);
    again.take_message(TARGET_PUBLISHER, target);
    hosts.push(again);
    run_between(&mut hosts, rejoins, end);
    for (host, module) in [(0, 17), (1, 4), (1, 5)] {
        let phase = phase_of(&hosts[host], module);
        assert_eq!(phase, Some(ModulePhase::Settled), "module {module}");
    }
}

/// The modules of one process have one clock, so they are no evidence for each other.
/// Shows M8.
#[test]
fn a_process_whose_machine_was_suspended_begins_new_runs() {
    let (mut first, target) = host(&[4, 5]);
    first.take_message(TARGET_PUBLISHER, target.clone());
    let (mut second, _) = host(&[17]);
    second.take_message(TARGET_PUBLISHER, target);
    let mut hosts = vec![first, second];
    let [suspended, goes_on, end] = [30, 60, 70].map(Duration::from_secs);
    run(&mut hosts, suspended);
    assert_eq!(phase_of(&hosts[0], 4), Some(ModulePhase::Settled));
    run_between(&mut hosts[1..], suspended, goes_on);
    assert_eq!(hosts[1].stood_still(), None);

    let late = goes_on - suspended;
    run_with_clocks(&mut hosts, goes_on, end, &[late, Duration::ZERO]);
    let found = hosts[0].stood_still().unwrap();
    assert!(found.abs_diff(late) < Duration::from_secs(1), "{found:?}");
    assert_eq!(hosts[1].stood_still(), None, "its clock went on");
}
