//! The rule, and what holds as well, violate no property; and rosters move by it.

use stateright::{Checker, HasDiscoveries, Model};

use super::configurations::{
    blind, clocks, everything, false_removal, false_removal_without_files, files, five_voters,
    heartbeats, idle, idle_with_removal, lease_from_agreement, links, long_sleep, lossy_crash,
    no_files, one_by_one, one_remains, rejoining, rejoining_apart, removal, removal_without_files,
    sleep, two_removals, two_rosters,
};
use super::state::Budget;
use super::{AFTER_CRASH, Agreement, IN_FORCE, MOVES, Rule, Search, WITHOUT_WAIT};

/// With ties once a removal is in force, the voters are not alike, so they are not sorted.
fn ties(model: Agreement) -> Agreement {
    Agreement {
        rule: Rule::TiesInForce,
        sorts: false,
        ..model
    }
}

/// Searches all states, which must be about so many, so that a model that lost actions does not pass.
fn search(name: &str, model: Agreement, at_least: usize) {
    let checker = model
        .checker()
        .threads(1)
        .finish_when(HasDiscoveries::AnyFailures);
    let checker = checker.spawn_bfs().join();
    let (states, depth) = (checker.unique_state_count(), checker.max_depth());
    println!(
        "{name}, {:?}: {states} states, up to {} actions",
        model.rule,
        depth - 1
    );
    if let Some((property, path)) = checker.discoveries().into_iter().next() {
        panic!("{name}: not {property} after {:?}", path.into_actions());
    }
    assert!(states > at_least, "{name}: {states} states");
}

/// All of these happen.
fn reach(name: &str, model: Agreement, events: &[&'static str]) {
    let model = Agreement {
        search: Search::Progress,
        ..model
    };
    let all = HasDiscoveries::AllOf(events.iter().copied().collect());
    let checker = model
        .checker()
        .threads(1)
        .finish_when(all)
        .spawn_bfs()
        .join();
    for event in events {
        assert!(checker.discovery(event).is_some(), "{name}: never {event}");
    }
}

#[test]
fn leases_keep_two_plans_apart() {
    search("heartbeats", heartbeats(), 70_000);
    search("lease from agreement", lease_from_agreement(), 300_000);
    search("a crash", lossy_crash(), 100_000);
    search("clocks", clocks(), 400_000);
    search("links", links(), 200_000);
}

#[test]
fn no_idle_lease_where_nobody_can_be_running() {
    search("idle", idle(), 200_000);
    search("idle, removal", idle_with_removal(), 50_000);
    search("rejoining", rejoining(), 100_000);
}

#[test]
fn those_that_know_keep_bodies_known() {
    search("files", files(), 100_000);
    search("no files", no_files(), 1_000);
}

#[test]
fn truthful_removals_are_safe() {
    search("one of four", removal(), 200_000);
    search("two of three", one_remains(), 100_000);
}

#[test]
fn a_false_removal_that_leaves_a_majority_is_safe_and_a_blind_one_has_no_effect() {
    search("one of three", false_removal(3), 10_000);
    search("one of four", two_rosters(false_removal(4)), 50_000);
    search("blind", blind(), 1_000);
}

#[test]
fn sleep_and_late_heartbeats_are_safe() {
    search("sleep", sleep(), 500_000);
}

#[test]
fn other_rules_hold_as_well() {
    let budget = Budget {
        sleeps: 2,
        ..sleep().budget
    };
    let ages = Agreement {
        rule: Rule::SleepAges,
        budget,
        ..sleep()
    };
    search("sleep", ages, 150_000);
    for (name, model) in [
        ("two of three", one_remains()),
        ("one of four", two_rosters(removal())),
    ] {
        let rule = Rule::LaterRunForgets;
        search(name, Agreement { rule, ..model }, 10_000);
    }
    search("one of four", ties(two_rosters(removal())), 100_000);
    search(
        "one of three, false",
        ties(two_rosters(false_removal(3))),
        50_000,
    );
    search(
        "one of four, false",
        ties(two_rosters(false_removal(4))),
        200_000,
    );
}

#[test]
fn rosters_come_into_force_and_move() {
    let all = [IN_FORCE, MOVES, AFTER_CRASH, WITHOUT_WAIT];
    reach("links", links(), &all);
    reach("idle", idle(), &all);
    reach("files", files(), &all);
    reach("removal", removal(), &all);
    reach("clocks", clocks(), &all[..2]);
    reach("blind", blind(), &all[..2]);
    reach("sleep", sleep(), &all[..2]);
}

#[test]
#[ignore = "millions of states, minutes"]
fn the_rule_holds_in_larger_searches() {
    search("five voters", five_voters(), 1_000_000);
    search("two of four", two_removals(), 1_000_000);
    search("everything", everything(), 1_000_000);
    search("rejoining apart", rejoining_apart(), 10_000_000);
    search("no files", removal_without_files(), 1_000_000);
    search("no files, false", false_removal_without_files(), 1_000_000);
    search("one by one", one_by_one(), 1_000_000);
    search("long sleep", long_sleep(), 1_000_000);
    let unsorted = Agreement {
        sorts: false,
        ..heartbeats()
    };
    search("unsorted", unsorted, 500_000);
    search("one of three, false", ties(false_removal(3)), 500_000);
    search("one of four", ties(removal()), 1_000_000);
    search("two of three", ties(one_remains()), 500_000);
}
