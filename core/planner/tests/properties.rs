//! The guarantees of the planning rules (listed at `verify::check_plan`) on random problems, cyclic ones included.
//!
//! `proptest-regressions` keeps failing cases; they run first.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail the test")]

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use formation_model::{Decision, ModuleId, PlanningProblem, SpotId};
use formation_planner::{Planning, Turn, plan};
use formation_verify::check_plan;
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;

use crate::support::hungarian;
use crate::support::world::{World, worlds};

/// The turns of a plan with the public state after each.
struct Replay {
    problem: Arc<PlanningProblem>,
    planning: Planning,
    turns: Vec<(Turn, Decision)>,
}

impl Replay {
    /// Takes every turn; fails if there are too many.
    fn of(problem: &Arc<PlanningProblem>) -> Self {
        let mut planning = Planning::new(Arc::clone(problem));
        let mut turns = Vec::new();
        // Each turn places a module or a block, or splits or dissolves a configuration.
        let turns_max = 2 * problem.modules().len();
        while let Some(turn) = planning.turn() {
            let decision = planning.decide().unwrap();
            planning.apply(turn.claimant, &decision).unwrap();
            turns.push((turn, decision));
            assert!(turns.len() <= turns_max, "more than {turns_max} turns");
        }
        Self {
            problem: Arc::clone(problem),
            planning,
            turns,
        }
    }

    fn assignment(&self) -> BTreeMap<ModuleId, SpotId> {
        let modules = self.problem.modules().iter();
        modules
            .filter_map(|module| Some((module.id, self.planning.spot_of(module.id)?)))
            .collect()
    }

    /// The modules that took their spot with a block, and pinned ones.
    fn fixed(&self) -> BTreeSet<ModuleId> {
        let pinned = self
            .problem
            .modules()
            .iter()
            .filter(|module| module.pin.is_some())
            .map(|module| module.id);
        let in_blocks = self.turns.iter().flat_map(|(turn, decision)| {
            let stays =
                |module: &&ModuleId| turn.modules.len() > 1 && !decision.detached.contains(module);
            turn.modules.iter().filter(stays).copied()
        });
        pinned.chain(in_blocks).collect()
    }
}

/// The spots of the formed target: if pinned modules are too far apart, there can be more than modules.
fn spots_formed(run: &Replay) -> usize {
    run.planning.instance().target.spots().len()
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 600,
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("proptest-regressions"))),
        ..ProptestConfig::default()
    })]

    #[test]
    fn guarantee_1_every_run_ends(world in worlds(3)) {
        let run = Replay::of(&world.problem());
        let numbers: Vec<u32> = run.turns.iter().map(|(turn, _)| turn.number).collect();
        prop_assert!(numbers.iter().copied().eq(0..run.planning.applied_turns()));
        prop_assert!(run.planning.finish().is_some());
    }

    #[test]
    fn guarantee_2_all_spots_that_can_be_are_filled_once(world in worlds(3)) {
        let problem = world.problem();
        let run = Replay::of(&problem);
        let assignment = run.assignment();
        let spots: BTreeSet<SpotId> = assignment.values().copied().collect();
        prop_assert_eq!(spots.len(), assignment.len());
        prop_assert_eq!(spots.len(), problem.modules().len().min(problem.target().spots().len()));
        if !world.keep_all_spots && world.pinned == 0 {
            prop_assert_eq!(spots_formed(&run), spots.len());
        }
    }

    #[test]
    fn guarantee_3_no_member_of_a_block_is_evicted(world in worlds(3)) {
        let run = Replay::of(&world.problem());
        let mut fixed: BTreeSet<ModuleId> = BTreeSet::new();
        for (turn, decision) in &run.turns {
            for eviction in &decision.evictions {
                prop_assert!(!fixed.contains(&eviction.evicted));
            }
            if turn.modules.len() > 1 {
                fixed.extend(turn.modules.iter().filter(|id| !decision.detached.contains(id)));
            }
        }
        for module in run.problem.modules() {
            if module.pin.is_some() {
                prop_assert_eq!(run.planning.spot_of(module.id), module.pin);
            }
        }
    }

    #[test]
    fn guarantee_4_a_chain_beats_insertion_without_eviction(world in worlds(3)) {
        // An exact finish can move more than one chain of modules.
        let mut planning = Planning::new(World { exact_finish: false, ..world.clone() }.problem());
        let problem = Arc::clone(planning.problem());
        let position = |module| problem.position_of(module).unwrap();
        while let Some(turn) = planning.turn() {
            let before: BTreeMap<ModuleId, Option<SpotId>> = problem
                .modules()
                .iter()
                .map(|module| (module.id, planning.spot_of(module.id)))
                .collect();
            let decision = planning.decide().unwrap();
            planning.apply(turn.claimant, &decision).unwrap();
            if turn.modules.len() > 1 {
                continue;
            }
            let instance = planning.instance();
            let utility = |module: ModuleId, spot: Option<SpotId>| {
                spot.and_then(|spot| instance.target.position_of(spot))
                    .map_or(0, |spot| instance.utilities.of(position(module), spot).0)
            };
            let gain: i64 = before
                .iter()
                .map(|(&module, &spot)| utility(module, planning.spot_of(module)) - utility(module, spot))
                .sum();
            let taken: BTreeSet<SpotId> =
                before.values().flatten().copied().chain(planning.closed_spots()).collect();
            let alone = instance
                .target
                .spots()
                .iter()
                .filter(|spot| !taken.contains(&spot.id))
                .map(|spot| utility(turn.claimant, Some(spot.id)))
                .max()
                .unwrap_or(0);
            if decision.evictions.is_empty() {
                prop_assert_eq!(gain, alone);
            } else {
                prop_assert!(gain > alone, "gained {}, alone {}", gain, alone);
            }
            if let Some(limit) = world.d_max {
                prop_assert!(decision.evictions.len() <= limit as usize);
            }
        }
    }

    #[test]
    fn guarantee_4_singletons_are_optimal_given_the_blocks(world in worlds(3)) {
        // Bounded chains reach it only with the exact finish.
        let exact_finish = world.d_max.is_some();
        let run = Replay::of(&World { exact_finish, ..world }.problem());
        let instance = run.planning.instance();
        let fixed = run.fixed();
        let assignment = run.assignment();
        let held: BTreeSet<SpotId> = fixed
            .iter()
            .filter_map(|id| assignment.get(id))
            .copied()
            .chain(run.planning.closed_spots())
            .collect();
        let open: Vec<usize> = (0..instance.target.spots().len())
            .filter(|&spot| !held.contains(&instance.target.spots()[spot].id))
            .collect();
        let single: Vec<ModuleId> = run
            .problem
            .modules()
            .iter()
            .map(|module| module.id)
            .filter(|id| !fixed.contains(id))
            .collect();
        let utility = |module: ModuleId, spot: usize| {
            instance.utilities.of(run.problem.position_of(module).unwrap(), spot).0
        };
        let total: i64 = single
            .iter()
            .filter_map(|&module| {
                let spot = instance.target.position_of(*assignment.get(&module)?)?;
                Some(utility(module, spot))
            })
            .sum();
        let utilities: Vec<Vec<i64>> = single
            .iter()
            .map(|&module| open.iter().map(|&spot| utility(module, spot)).collect())
            .collect();
        prop_assert_eq!(total, hungarian::best_total(&utilities));
    }

    /// Shows T4.
    #[test]
    fn guarantee_5_replicas_agree_bit_for_bit(world in worlds(3)) {
        let problem = world.problem();
        let mut speaker = Planning::new(Arc::clone(&problem));
        // The same modules in another order.
        let mut modules = problem.modules().to_vec();
        modules.reverse();
        let target = Arc::clone(problem.target());
        let again = PlanningProblem::new(target, *problem.parameters(), modules).unwrap();
        let mut listener = Planning::new(Arc::new(again));
        while let Some(turn) = speaker.turn() {
            let decision = speaker.decide().unwrap();
            prop_assert_eq!(listener.turn(), Some(turn.clone()));
            prop_assert_eq!(listener.apply(turn.claimant, &decision), Ok(()));
            prop_assert_eq!(speaker.apply(turn.claimant, &decision), Ok(()));
        }
        prop_assert_eq!(speaker.finish(), listener.finish());
    }

    #[test]
    fn the_independent_checker_finds_nothing_wrong(world in worlds(3)) {
        let problem = world.problem();
        let outcome = plan(Arc::clone(&problem));
        let decisions: Vec<Decision> =
            outcome.decisions.iter().map(|(_, decision)| decision.clone()).collect();
        prop_assert_eq!(check_plan(&problem, &decisions, &outcome.plan), Ok(()));
    }

    /// Without ties, which identifiers decide, and without trimming, for which all leaves have the same value.
    #[test]
    fn other_identifiers_give_the_same_plan(world in worlds(3), stride in 1..1_000_u32) {
        let world = World { grid: 1, keep_all_spots: true, ..world };
        // Multiplication by an odd number changes the order of identifiers and keeps them distinct.
        let other = |id: u32| (id + 7).wrapping_mul(2 * stride + 1) & 0xffff;
        let plain = Replay::of(&world.problem()).assignment();
        let relabelled = Replay::of(&world.problem_with(&other, &other, (0, 0))).assignment();
        let expected: BTreeMap<ModuleId, SpotId> = plain
            .into_iter()
            .map(|(module, spot)| (ModuleId(other(module.0)), SpotId(other(spot.0))))
            .collect();
        prop_assert_eq!(expected, relabelled);
    }

    #[test]
    fn other_origins_give_the_same_plan(
        world in worlds(3),
        shift in (0..900_000_000_000_i64, 0..900_000_000_000_i64),
    ) {
        let identity = |id| id;
        let here = Replay::of(&world.problem());
        let there = Replay::of(&world.problem_with(&identity, &identity, shift));
        prop_assert_eq!(here.turns, there.turns);
    }
}
