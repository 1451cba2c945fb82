//! The baselines: replicas agree on each turn, the central policies are optimal, and the paper's violates only completeness.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail the test")]

use std::sync::Arc;

use formation_generate::Grouping;
use formation_model::{
    Decision, PaperBundle, PlannerParameters, PlanningProblem, Policy, TurnOrder,
};
use formation_planner::{PlanOutcome, Planning, Statistics, plan};
use formation_verify::{Violation, check_plan};

use crate::support::{problem, with_parameters};

const GROUPINGS: [Grouping; 3] = [
    Grouping::Singletons,
    Grouping::Mixed,
    Grouping::Configurations(4),
];

fn following(policy: Policy) -> PlannerParameters {
    PlannerParameters {
        policy,
        ..PlannerParameters::default()
    }
}

fn violations(problem: &PlanningProblem, outcome: &PlanOutcome) -> Vec<Violation> {
    let decisions: Vec<Decision> = outcome
        .decisions
        .iter()
        .map(|(_, decision)| decision.clone())
        .collect();
    check_plan(problem, &decisions, &outcome.plan)
        .err()
        .unwrap_or_default()
}

#[test]
fn replicas_agree_turn_by_turn_under_every_policy() {
    // The policy `given` needs a target that gives an allocation.
    for (policy, _) in Policy::all().filter(|&(policy, _)| policy != Policy::Given) {
        for (seed, grouping) in (0..).zip(GROUPINGS) {
            for (modules, spots) in [(20, 20), (24, 15), (15, 24)] {
                let problem = problem(modules, spots, grouping, seed, following(policy));
                let mut claiming = Planning::new(Arc::clone(&problem));
                let mut applying = Planning::new(problem);
                while let Some(turn) = claiming.turn() {
                    let decision = claiming.decide().unwrap();
                    assert_eq!(applying.turn(), Some(turn.clone()));
                    assert_eq!(applying.apply(turn.claimant, &decision), Ok(()));
                    claiming.apply(turn.claimant, &decision).unwrap();
                }
                assert_eq!(claiming.finish(), applying.finish());
            }
        }
    }
}

#[test]
fn auction_and_hungarian_plans_are_sound_and_equally_good() {
    for (seed, grouping) in (0..60).zip(GROUPINGS.into_iter().cycle()) {
        for (modules, spots) in [(20, 20), (30, 12), (12, 30)] {
            let auction = problem(modules, spots, grouping, seed, following(Policy::Auction));
            let hungarian = with_parameters(&auction, following(Policy::Hungarian));
            let (bidding, solved) = (plan(Arc::clone(&auction)), plan(Arc::clone(&hungarian)));
            assert_eq!(violations(&auction, &bidding), []);
            assert_eq!(violations(&hungarian, &solved), []);
            assert!(bidding.plan.blocks.is_empty() && bidding.plan.kept_links.is_empty());
            let evicted = |outcome: &PlanOutcome| {
                outcome
                    .decisions
                    .iter()
                    .any(|(_, decision)| !decision.evictions.is_empty())
            };
            assert!(!evicted(&bidding) && !evicted(&solved));
            // With too few modules, each policy trims the target by its own dry run, which ties can change.
            if modules >= spots || bidding.trimmed_spots == solved.trimmed_spots {
                assert_eq!(bidding.total_utility, solved.total_utility, "seed {seed}");
            }
        }
    }
}

#[test]
fn single_modules_do_as_well_by_chains_of_evictions_as_by_an_auction() {
    for seed in 0..20 {
        for (modules, spots) in [(40, 40), (60, 30)] {
            let auction = problem(
                modules,
                spots,
                Grouping::Singletons,
                seed,
                following(Policy::Auction),
            );
            let exact = with_parameters(&auction, following(Policy::Exact));
            assert_eq!(plan(auction).total_utility, plan(exact).total_utility);
        }
    }
}

#[test]
fn bids_and_prices_count_as_messages() {
    let auction = problem(30, 30, Grouping::Singletons, 1, following(Policy::Auction));
    let outcome = plan(Arc::clone(&auction));
    let counts = outcome.auction.unwrap();
    assert!(counts.bids >= 30 && counts.price_updates >= 30 && counts.rounds > 1);
    let statistics = Statistics::of(&auction, &outcome);
    let samples = 30 + counts.bids + counts.price_updates;
    assert_eq!(statistics.messages.samples, samples);
    assert_eq!(statistics.messages.deliveries, samples * 29);
    assert_eq!(statistics.messages.pairs, samples * 29);
    let exact = plan(with_parameters(&auction, following(Policy::Exact)));
    assert_eq!(exact.auction, None);
}

#[test]
fn the_papers_plans_violate_nothing_but_completeness() {
    let mut with_holes = 0;
    let parameters = [
        PlannerParameters::of_paper(PaperBundle::Literal),
        PlannerParameters {
            order: TurnOrder::SizeFirst,
            ..PlannerParameters::of_paper(PaperBundle::Charitable)
        },
    ];
    for seed in 0..150 {
        for grouping in GROUPINGS {
            let problem = problem(
                16,
                16,
                grouping,
                seed,
                parameters[usize::from(seed % 2 == 0)],
            );
            let outcome = plan(Arc::clone(&problem));
            let found = violations(&problem, &outcome);
            let has_hole = outcome.plan.assignments.len() < 16;
            with_holes += usize::from(has_hole);
            assert!(has_hole || found.is_empty(), "seed {seed}: {found:?}");
            for violation in &found {
                let follows_from_holes = matches!(
                    violation,
                    Violation::WrongCount { .. } | Violation::Apart { .. }
                );
                assert!(follows_from_holes, "seed {seed}: {violation}");
            }
            assert!(!has_hole || grouping != Grouping::Singletons);
        }
    }
    assert!(with_holes > 0);
}

/// A module that leaves its configuration can be evicted by the next one of the same turn, in a chain.
#[test]
fn chains_within_the_turn_of_a_configuration_are_consistent() {
    let mut longest = 0;
    for seed in 1..25 {
        let parameters = PlannerParameters::of_paper(PaperBundle::Charitable);
        let problem = problem(60, 60, Grouping::Mixed, seed, parameters);
        let outcome = plan(Arc::clone(&problem));
        let decisions = outcome.decisions.iter();
        let evictions = decisions
            .map(|(_, decision)| decision.evictions.len())
            .max();
        longest = longest.max(evictions.unwrap());
        assert_eq!(violations(&problem, &outcome), [], "seed {seed}");
    }
    assert!(longest > 1);
}
