//! The planner's facade over whole scenarios.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail the test")]

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_generate::Grouping;
use formation_model::{Decision, PlannerParameters};
use formation_planner::{ClaimRefused, Planning, Statistics, plan};

use crate::support::{problem, size_first};

#[test]
fn the_greatest_possible_number_of_spots_is_filled() {
    for (seed, (modules, spots)) in [(30, 30), (40, 25), (25, 40)].into_iter().enumerate() {
        for grouping in [
            Grouping::Singletons,
            Grouping::Mixed,
            Grouping::Configurations(5),
        ] {
            for parameters in [PlannerParameters::default(), size_first()] {
                let problem = problem(modules, spots, grouping, seed as u64, parameters);
                let outcome = plan(Arc::clone(&problem));
                let filled: BTreeSet<_> = outcome.plan.assignments.values().collect();
                assert_eq!(filled.len(), modules.min(spots));
                assert_eq!(outcome.plan.assignments.len(), filled.len());
                assert_eq!(outcome.unassigned.len(), modules.saturating_sub(spots));
                assert_eq!(outcome.open_spots.len(), spots.saturating_sub(modules));
                assert_eq!(outcome.trimmed_spots, outcome.open_spots);
            }
        }
    }
}

#[test]
fn replicas_that_apply_each_others_decisions_agree() {
    let problem = problem(40, 40, Grouping::Mixed, 7, PlannerParameters::default());
    let mut speaker = Planning::new(Arc::clone(&problem));
    let mut listener = Planning::new(problem);
    while let Some(turn) = speaker.turn() {
        let decision = speaker.decide().unwrap();
        assert_eq!(speaker.decide().unwrap(), decision);
        assert_eq!(listener.turn(), Some(turn.clone()));
        speaker.apply(turn.claimant, &decision).unwrap();
        listener.apply(turn.claimant, &decision).unwrap();
        assert_eq!(listener.applied_turns(), turn.number + 1);
    }
    assert_eq!(speaker.finish().unwrap(), listener.finish().unwrap());
}

/// Shows T2.
#[test]
fn a_claim_that_does_not_follow_from_the_input_is_refused() {
    let problem = problem(
        10,
        10,
        Grouping::Singletons,
        3,
        PlannerParameters::default(),
    );
    let mut planning = Planning::new(problem);
    let turn = planning.turn().unwrap();
    let decision = planning.decide().unwrap();
    let other = planning
        .problem()
        .modules()
        .iter()
        .map(|module| module.id)
        .find(|&id| id != turn.claimant)
        .unwrap();
    assert_eq!(
        planning.apply(other, &decision),
        Err(ClaimRefused::WrongClaimant {
            expected: turn.claimant
        })
    );
    let refused = planning.apply(turn.claimant, &Decision::default());
    assert!(matches!(
        refused,
        Err(ClaimRefused::DifferentDecision { turn: 0, .. })
    ));
    assert_eq!(planning.turn(), Some(turn));
    planning.take_all_turns();
    assert_eq!(
        planning.apply(other, &decision),
        Err(ClaimRefused::NoTurnLeft)
    );
}

#[test]
fn the_statistics_account_for_every_module_and_link() {
    let problem = problem(60, 60, Grouping::Configurations(12), 5, size_first());
    let outcome = plan(Arc::clone(&problem));
    let statistics = Statistics::of(&problem, &outcome);
    assert_eq!(
        statistics.changes.kept_links + statistics.changes.broken_links,
        55
    );
    assert_eq!(statistics.messages.samples, outcome.decisions.len());
    assert_eq!(
        statistics.messages.deliveries,
        59 * statistics.messages.samples
    );
    assert!(statistics.messages.pairs >= 59 * 60);
    assert_eq!(statistics.assembly_order.len(), 60);
    assert_eq!(statistics.assignments.len(), 60);
    // Modules that do not fit an empty target do not fit one with other modules.
    let disconnected = statistics.changes.disconnected;
    assert!(disconnected.unmatched_on_empty_target <= disconnected.outside_largest_piece);
    assert!(disconnected.outside_largest_piece <= statistics.changes.detached_modules);
    assert!(disconnected.alone <= statistics.changes.detached_modules);
    // Each module that leaves breaks at least one link and at most all of its links.
    assert!(disconnected.broken_links >= disconnected.outside_largest_piece.div_ceil(2));
}
