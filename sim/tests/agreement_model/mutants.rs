//! Each mutant violates a property; so do the parts of the page that are corrected, and cases that no rule prevents.

use stateright::{Checker, HasDiscoveries, Model};

use super::configurations::{
    blind, clocks, false_removal, files, heartbeats, idle, idle_with_removal, lease_from_agreement,
    no_files, one_remains, rejoining, removal, sleep, two_rosters,
};
use super::state::Budget;
use super::{Action, Agreement, BODIES, GOALS, MOTION, Network, Rule};

/// A violation that takes fewer actions than this, if there is one; 0 is no limit.
fn violation(model: Agreement, property: &'static str, fewer_than: usize) -> Option<Vec<Action>> {
    // The checker counts states, one more than actions, and stops before this depth.
    let depth = if fewer_than == 0 { 0 } else { fewer_than + 1 };
    let only = HasDiscoveries::AnyOf([property].into());
    let checker = model
        .checker()
        .threads(1)
        .finish_when(only)
        .target_max_depth(depth);
    let path = checker.spawn_bfs().join().discovery(property)?;
    Some(path.into_actions())
}

/// How many actions the shortest violation takes. One whose modules keep their numbers is printed.
fn length(rule: Rule, model: Agreement, property: &'static str) -> usize {
    let model = Agreement { rule, ..model };
    let mut fewer_than = 0;
    while let Some(actions) = violation(model, property, fewer_than) {
        fewer_than = actions.len();
    }
    let model = Agreement {
        sorts: false,
        ..model
    };
    let Some(actions) = violation(model, property, fewer_than + 1) else {
        panic!("{rule:?}: {property}: no violation");
    };
    assert_eq!(actions.len(), fewer_than, "{rule:?}");
    println!("{rule:?}: not {property} after {fewer_than} actions: {actions:?}");
    fewer_than
}

fn holds(rule: Rule, model: Agreement, property: &'static str) -> bool {
    violation(Agreement { rule, ..model }, property, 0).is_none()
}

#[test]
fn two_plans_move_without_lease_majority_or_margins() {
    let lossy = heartbeats();
    let linked = Agreement {
        network: Network::Links,
        ..lossy
    };
    for (rule, lengths) in [
        (Rule::NoLease, (6, 8)),
        (Rule::NoMajority, (9, 9)),
        (Rule::NoMargins, (9, 11)),
    ] {
        assert_eq!(
            (length(rule, linked, GOALS), length(rule, lossy, GOALS)),
            lengths
        );
    }
    assert_eq!(length(Rule::NoMargins, two_rosters(clocks()), GOALS), 10);
    assert_eq!(length(Rule::NoMargins, lease_from_agreement(), GOALS), 10);
}

#[test]
fn two_plans_move_by_weaker_forms_of_rule_3() {
    let model = two_rosters(idle());
    assert_eq!(length(Rule::ShortIdle, model, GOALS), 8);
    assert_eq!(length(Rule::IdleWithoutMargins, model, GOALS), 13);
    assert_eq!(
        length(Rule::IdleDespiteRemoval, idle_with_removal(), GOALS),
        12
    );
    let model = rejoining();
    assert_eq!(length(Rule::LastPlanOfOthers, model, GOALS), 7);
    assert_eq!(length(Rule::OtherPlansForgotten, model, GOALS), 10);
}

#[test]
fn goals_exclude_each_other_but_drives_do_not_if_the_wait_leaves_them_out() {
    let linked = Agreement {
        network: Network::Links,
        ..heartbeats()
    };
    assert_eq!(length(Rule::DriveLeftOut, linked, MOTION), 11);
    for model in [heartbeats(), clocks(), idle()] {
        assert!(holds(Rule::DriveLeftOut, model, GOALS));
    }
}

#[test]
fn majorities_that_do_not_know_forget_bodies() {
    let (files, no_files) = (two_rosters(files()), two_rosters(no_files()));
    for model in [files, no_files] {
        assert_eq!(length(Rule::IgnorantMajority, model, BODIES), 11);
        assert_eq!(length(Rule::EmptyFileKnows, model, BODIES), 11);
    }
    // The second run after the file was lost finds one, which the first run wrote without knowing anything.
    assert_eq!(length(Rule::AnyFileKnows, files, BODIES), 13);
}

/// As on the page. Two of four voters move as exactly half, one of them ends and is removed, and the other two move without
/// knowing where these stand. If a later run of the removed one has a vote, two plans move.
#[test]
fn a_removal_that_counts_at_once_forgets_bodies_and_moves_two_plans() {
    let four = two_rosters(removal());
    assert_eq!(length(Rule::RemovalCountsAtOnce, four, BODIES), 10);
    assert!(holds(Rule::RemovalCountsAtOnce, four, GOALS));
    assert_eq!(length(Rule::PageRemovals, four, GOALS), 10);
    let at_once = Agreement {
        one_by_one: false,
        ..one_remains()
    };
    assert_eq!(length(Rule::LaterRunVotes, at_once, GOALS), 13);
}

/// With ties after a removal, one false removal moves two plans with three voters; with ties before a removal, as on the page,
/// it still does with four.
#[test]
fn a_false_removal_that_counts_at_once_moves_two_plans() {
    let [three, four] = [3, 4].map(|voters| two_rosters(false_removal(voters)));
    assert_eq!(
        length(
            Rule::TiesAfterRemoval,
            Agreement {
                sorts: false,
                ..three
            },
            GOALS
        ),
        10
    );
    assert!(holds(Rule::RemovalCountsAtOnce, three, GOALS));
    assert_eq!(length(Rule::RemovalCountsAtOnce, four, GOALS), 9);
}

/// No rule prevents this: what remains is less than a majority, and the user said that the others had ended.
#[test]
fn false_removals_of_half_the_voters_move_two_plans() {
    let [two, three] = [2, 3].map(|voters| two_rosters(false_removal(voters)));
    assert_eq!(length(Rule::Right, two, GOALS), 9);
    assert!(holds(Rule::NoTies, two, GOALS));
    let budget = Budget {
        removals: 2,
        false_removals: 2,
        ..three.budget
    };
    assert_eq!(
        length(Rule::Right, Agreement { budget, ..three }, GOALS),
        11
    );
}

#[test]
fn removals_that_name_no_run_move_two_plans() {
    assert_eq!(length(Rule::BlindRemovals, blind(), GOALS), 9);
}

#[test]
fn two_plans_move_if_runs_are_rebased_or_a_sleep_has_no_effect() {
    let late = sleep();
    let budget = Budget {
        sleeps: 0,
        ..late.budget
    };
    assert_eq!(
        length(Rule::Rebase, Agreement { budget, ..late }, GOALS),
        11
    );
    let mut timely = late;
    timely.times.delay = 0;
    let sleeps = |sleeps| Agreement {
        budget: Budget {
            sleeps,
            ..timely.budget
        },
        ..timely
    };
    assert_eq!(length(Rule::GoesOnAfterSleep, sleeps(1), GOALS), 12);
    assert_eq!(length(Rule::ShortSleepsPass, sleeps(1), GOALS), 12);
    assert!(holds(Rule::ShortSleepsCovered, sleeps(1), GOALS));
    assert!(!holds(Rule::ShortSleepsCovered, sleeps(2), GOALS));
}
