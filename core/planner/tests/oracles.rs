//! The planner against third-party solvers and exhaustive search.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail the test")]

use std::collections::BTreeMap;
use std::sync::Arc;

use formation_generate::Grouping;
use formation_model::{CutPrice, MicroUnits, ModuleId, PlannerParameters, Spread, Topology};
use formation_planner::placement::{MatchingInput, common_subtree};
use formation_planner::{Planning, betweenness, plan};
use formation_verify::check_plan;

use crate::support::brute_force::best_common_subtree;
use crate::support::{Numbers, hungarian, problem, random_tree, size_first, with_parameters};

/// Checks that pairs are a common subtree, and returns its size and weight.
fn judged(
    configuration: &Topology,
    target: &Topology,
    weights: &[Vec<Option<MicroUnits>>],
    pairs: &[(usize, usize)],
) -> (usize, MicroUnits) {
    let image: BTreeMap<usize, usize> = pairs.iter().copied().collect();
    let mut spots: Vec<usize> = pairs.iter().map(|&(_, spot)| spot).collect();
    spots.sort_unstable();
    spots.dedup();
    assert_eq!((image.len(), spots.len()), (pairs.len(), pairs.len()));
    for (first, second) in configuration.edges() {
        if let (Some(&one), Some(&other)) = (image.get(first), image.get(second)) {
            assert!(target.has_edge(one, other));
        }
    }
    let parts = configuration.components_within(|node| image.contains_key(&node));
    assert!(parts.len() <= 1);
    let weight = pairs
        .iter()
        .map(|&(node, spot)| weights[node][spot].unwrap())
        .sum();
    (pairs.len(), weight)
}

#[test]
fn the_common_subtree_equals_brute_force() {
    let mut numbers = Numbers(1);
    for case in 0..1_500 {
        let configuration_size = 1 + numbers.below(6);
        let configuration = random_tree(&mut numbers, configuration_size);
        let target_size = 1 + numbers.below(7);
        let target = random_tree(&mut numbers, target_size);
        let forbidden = [0, 10, 40][case % 3];
        let spread = [2, 1_000_000][case % 2];
        let weights: Vec<Vec<Option<MicroUnits>>> = (0..configuration_size)
            .map(|_| {
                (0..target_size)
                    .map(|_| {
                        let weight = MicroUnits(numbers.within(-spread, spread));
                        (!numbers.chance(forbidden)).then_some(weight)
                    })
                    .collect()
            })
            .collect();
        let matching = common_subtree::solve(&MatchingInput {
            configuration: &configuration,
            target: &target,
            weight: |node: usize, spot: usize| weights[node][spot],
        });
        let judged = judged(&configuration, &target, &weights, &matching.pairs);
        assert!(matching.proven);
        assert_eq!(judged.1, matching.utility, "case {case}");
        assert_eq!(
            judged,
            best_common_subtree(&configuration, &target, &weights),
            "case {case}: {configuration:?} in {target:?}, {weights:?}"
        );
    }
}

/// The weights of a configuration's turn by the definition in the planning rules, from public data.
fn weights_by_definition(
    planning: &Planning,
    members: &[ModuleId],
    fixed: &[ModuleId],
    others_wait: bool,
) -> Vec<Vec<Option<MicroUnits>>> {
    let instance = planning.instance();
    let spots = instance.target.spots();
    let position = |module: ModuleId| planning.problem().position_of(module).unwrap();
    let holder_of: BTreeMap<usize, ModuleId> = planning
        .problem()
        .modules()
        .iter()
        .filter_map(|module| {
            let spot = planning.spot_of(module.id)?;
            Some((instance.target.position_of(spot).unwrap(), module.id))
        })
        .collect();
    let price = |spot: usize| {
        let Some(&holder) = holder_of.get(&spot) else {
            return Some(MicroUnits::ZERO);
        };
        let elsewhere = (0..spots.len())
            .filter(|other| !holder_of.contains_key(other))
            .map(|other| instance.utilities.of(position(holder), other))
            .max();
        let own = instance.utilities.of(position(holder), spot);
        (!fixed.contains(&holder)).then(|| own - elsewhere.unwrap_or(MicroUnits::ZERO))
    };
    let is_open = |spot: &usize| {
        holder_of
            .get(spot)
            .is_none_or(|holder| !fixed.contains(holder))
    };
    let cut_price = planning.problem().parameters().cut_price.per_cut();
    let cuts = |member: ModuleId, spot: usize| {
        let links = &planning.problem().module(member).unwrap().links;
        let broken = links
            .iter()
            .filter(|&other| members.contains(other))
            .count();
        let neighbours = instance.target.topology().neighbours(spot).iter();
        let cut_off = neighbours.filter(|&spot| is_open(spot)).count();
        cut_price.times(broken + if others_wait { cut_off } else { 0 })
    };
    members
        .iter()
        .map(|&member| {
            (0..spots.len())
                .map(|spot| {
                    let utility = instance.utilities.of(position(member), spot);
                    Some(utility - price(spot)? - cuts(member, spot))
                })
                .collect()
        })
        .collect()
}

/// The groups of two or more linked modules.
fn joined(planning: &Planning, modules: &[ModuleId]) -> Vec<Vec<ModuleId>> {
    let problem = planning.problem();
    let mut groups = Vec::new();
    let mut left = modules.to_vec();
    while let Some(module) = left.pop() {
        let mut group = vec![module];
        let mut next = 0;
        while let Some(&member) = group.get(next) {
            let links = &problem.module(member).unwrap().links;
            group.extend(left.extract_if(.., |other| links.contains(other)));
            next += 1;
        }
        if group.len() > 1 {
            groups.push(group);
        }
    }
    groups
}

#[test]
fn every_turn_of_a_configuration_equals_brute_force() {
    let mut turns_with_held_spots = 0;
    let mut turns = 0;
    for seed in 0..1_500 {
        let mut numbers = Numbers(seed);
        let spots = 4 + numbers.below(4);
        let modules = 4 + numbers.below(5);
        let size = 2 + numbers.below(3);
        let parameters = PlannerParameters {
            keep_all_spots: numbers.chance(50),
            cut_price: CutPrice::from_units([0.0, 1.0, 1.0, 20.0][numbers.below(4)]).unwrap(),
            spread: Spread::from_units([0.0, 0.001, 0.1][numbers.below(3)]).unwrap(),
            ..PlannerParameters::default()
        };
        let grouping = if numbers.chance(50) {
            Grouping::Mixed
        } else {
            Grouping::Configurations(size)
        };
        let problem = problem(modules, spots, grouping, seed, parameters);
        let mut planning = Planning::new(problem);
        let mut fixed = Vec::new();
        let all: Vec<ModuleId> = planning
            .problem()
            .modules()
            .iter()
            .map(|one| one.id)
            .collect();
        let mut waiting = joined(&planning, &all);
        while let Some(turn) = planning.turn() {
            let decision = planning.decide().unwrap();
            if turn.modules.len() > 1 {
                waiting.retain(|group| !group.contains(&turn.claimant));
                let others_wait = !waiting.is_empty();
                let weights = weights_by_definition(&planning, &turn.modules, &fixed, others_wait);
                let edges: Vec<(usize, usize)> = turn
                    .modules
                    .iter()
                    .enumerate()
                    .flat_map(|(first, &id)| {
                        let links = &planning.problem().module(id).unwrap().links;
                        turn.modules[first + 1..]
                            .iter()
                            .enumerate()
                            .filter(|(_, other)| links.contains(other))
                            .map(move |(offset, _)| (first, first + 1 + offset))
                            .collect::<Vec<_>>()
                    })
                    .collect();
                let configuration = Topology::new(turn.modules.len(), &edges);
                let target = &planning.instance().target;
                let pairs: Vec<(usize, usize)> = decision
                    .selections
                    .iter()
                    .filter_map(|selection| {
                        let node = turn.modules.binary_search(&selection.module).ok()?;
                        Some((node, target.position_of(selection.spot).unwrap()))
                    })
                    .collect();
                let best = best_common_subtree(&configuration, target.topology(), &weights);
                if best.0 < 2 {
                    assert!(pairs.is_empty());
                    assert_eq!(decision.detached, turn.modules);
                } else {
                    let judged = judged(&configuration, target.topology(), &weights, &pairs);
                    assert_eq!(judged, best, "seed {seed}, turn {}", turn.number);
                    waiting.extend(joined(&planning, &decision.detached));
                }
                turns += 1;
                turns_with_held_spots += usize::from(!decision.evictions.is_empty());
                fixed.extend(
                    turn.modules
                        .iter()
                        .filter(|id| !decision.detached.contains(id)),
                );
            }
            planning.apply(turn.claimant, &decision).unwrap();
        }
    }
    assert!(turns >= 1_000, "{turns}");
    assert!(turns_with_held_spots >= 250, "{turns_with_held_spots}");
}

/// The total utility of the single modules, and the optimum over the spots that no block holds.
///
/// `inserted` are the single modules that have taken their turn.
fn singletons_and_optimum(
    planning: &Planning,
    inserted: &[ModuleId],
    fixed: &[ModuleId],
) -> (i64, i64) {
    let instance = planning.instance();
    let position = |module: ModuleId| planning.problem().position_of(module).unwrap();
    let held_by_blocks: Vec<usize> = fixed
        .iter()
        .filter_map(|&module| instance.target.position_of(planning.spot_of(module)?))
        .collect();
    let open: Vec<usize> = (0..instance.target.spots().len())
        .filter(|spot| !held_by_blocks.contains(spot))
        .collect();
    let utility = |module: ModuleId, spot: usize| instance.utilities.of(position(module), spot).0;
    let total = inserted
        .iter()
        .filter_map(|&module| {
            let spot = instance.target.position_of(planning.spot_of(module)?)?;
            Some(utility(module, spot))
        })
        .sum();
    let utilities: Vec<Vec<i64>> = inserted
        .iter()
        .map(|&module| open.iter().map(|&spot| utility(module, spot)).collect())
        .collect();
    (total, hungarian::best_total(&utilities))
}

/// Compares after every turn, or only at the end.
fn compare_with_hungarian(planning: &mut Planning, after_every_turn: bool) {
    let (mut inserted, mut fixed) = (Vec::new(), Vec::new());
    while let Some(turn) = planning.turn() {
        let decision = planning.decide().unwrap();
        if turn.modules.len() > 1 {
            fixed.extend(
                turn.modules
                    .iter()
                    .filter(|id| !decision.detached.contains(id)),
            );
        } else {
            inserted.push(turn.claimant);
        }
        planning.apply(turn.claimant, &decision).unwrap();
        if after_every_turn || planning.turn().is_none() {
            let (total, optimum) = singletons_and_optimum(planning, &inserted, &fixed);
            assert_eq!(total, optimum, "after turn {}", turn.number);
        }
    }
}

#[test]
fn singletons_equal_the_hungarian_method_in_equal_over_and_undersupply() {
    for seed in 0..1_200 {
        let mut numbers = Numbers(seed);
        let spots = 1 + numbers.below(30);
        let modules = match seed % 3 {
            0 => spots,
            1 => spots + numbers.below(20),
            _ => 1 + numbers.below(spots),
        };
        let parameters = PlannerParameters {
            keep_all_spots: numbers.chance(50),
            ..PlannerParameters::default()
        };
        let problem = problem(modules, spots, Grouping::Singletons, seed, parameters);
        compare_with_hungarian(&mut Planning::new(problem), seed % 10 < 3);
    }
}

#[test]
fn singletons_stay_optimal_given_the_blocks_through_displacement_and_dropping() {
    let mut dropped = 0;
    for seed in 0..600 {
        let mut numbers = Numbers(seed);
        let spots = 5 + numbers.below(20);
        let modules = (spots + numbers.below(15) - numbers.below(5)).max(3);
        let grouping = if numbers.chance(70) {
            Grouping::Mixed
        } else {
            Grouping::Configurations(3)
        };
        let parameters = if numbers.chance(80) {
            PlannerParameters::default()
        } else {
            size_first()
        };
        let problem = problem(modules, spots, grouping, seed, parameters);
        let mut planning = Planning::new(problem);
        compare_with_hungarian(&mut planning, true);
        dropped += Planning::new(planning.problem().clone())
            .take_all_turns()
            .iter()
            .flat_map(|(_, decision)| &decision.evictions)
            .filter(|eviction| eviction.to.is_none())
            .count();
    }
    assert!(dropped > 100, "{dropped}");
}

/// The greatest gain of a chain that begins with `module`, over all chains of at most `evictions_left` evictions.
fn best_chain(
    utilities: &[Vec<i64>],
    holders: &[Option<usize>],
    visited: &mut Vec<bool>,
    module: usize,
    evictions_left: u32,
) -> i64 {
    let free = (0..holders.len()).filter(|&spot| holders[spot].is_none());
    // Without a free spot, the last displaced module is dropped.
    let mut best = free.map(|spot| utilities[module][spot]).max().unwrap_or(0);
    for spot in 0..holders.len() {
        let Some(holder) = holders[spot].filter(|_| evictions_left > 0 && !visited[spot]) else {
            continue;
        };
        visited[spot] = true;
        let onward = best_chain(utilities, holders, visited, holder, evictions_left - 1);
        visited[spot] = false;
        best = best.max(utilities[module][spot] - utilities[holder][spot] + onward);
    }
    best
}

#[test]
fn bounded_chains_equal_brute_force() {
    let mut cut_short = 0;
    for seed in 0..600 {
        let mut numbers = Numbers(seed);
        let spots = 2 + numbers.below(6);
        let modules = spots + numbers.below(3);
        let d_max = u32::try_from(numbers.below(4)).unwrap();
        let parameters = PlannerParameters {
            d_max: Some(d_max),
            ..PlannerParameters::default()
        };
        let problem = problem(modules, spots, Grouping::Singletons, seed, parameters);
        let mut planning = Planning::new(problem);
        let utilities: Vec<Vec<i64>> = (0..modules)
            .map(|module| planning.instance().utilities.row(module))
            .collect();
        let mut holders = vec![None; spots];
        while let Some(turn) = planning.turn() {
            let total = |holders: &[Option<usize>]| -> i64 {
                let held = holders.iter().enumerate();
                held.filter_map(|(spot, holder)| Some(utilities[(*holder)?][spot]))
                    .sum()
            };
            let before = total(&holders);
            let module = planning.problem().position_of(turn.claimant).unwrap();
            let best =
                |limit| best_chain(&utilities, &holders, &mut vec![false; spots], module, limit);
            let (bounded, unbounded) = (best(d_max), best(u32::MAX));
            let decision = planning.decide().unwrap();
            planning.apply(turn.claimant, &decision).unwrap();
            assert!(decision.evictions.len() <= d_max as usize);
            for (spot, holder) in holders.iter_mut().enumerate() {
                let id = planning.instance().target.spots()[spot].id;
                *holder = (0..modules).find(|&module| {
                    planning.spot_of(planning.problem().modules()[module].id) == Some(id)
                });
            }
            let gain = total(&holders) - before;
            assert_eq!(
                gain, bounded,
                "seed {seed}, turn {}, d_max {d_max}",
                turn.number
            );
            cut_short += usize::from(bounded < unbounded);
        }
    }
    assert!(cut_short > 200, "{cut_short}");
}

#[test]
fn bounded_chains_with_an_exact_finish_equal_the_hungarian_method() {
    let (mut restored, mut readmitted) = (0, 0);
    for seed in 0..900 {
        let mut numbers = Numbers(seed);
        let spots = 4 + numbers.below(20);
        let modules = match seed % 3 {
            0 => spots,
            1 => spots + numbers.below(12),
            _ => 1 + numbers.below(spots),
        };
        let grouping = match numbers.below(3) {
            0 => Grouping::Mixed,
            1 if modules >= 3 => Grouping::Configurations(3),
            _ => Grouping::Singletons,
        };
        let parameters = PlannerParameters {
            d_max: Some(u32::try_from(numbers.below(4)).unwrap()),
            exact_finish: true,
            keep_all_spots: numbers.chance(50),
            // Totals are at plain distances, which these plans are compared by.
            spread: Spread::ZERO,
            ..PlannerParameters::default()
        };
        let problem = problem(modules, spots, grouping, seed, parameters);
        let mut planning = Planning::new(Arc::clone(&problem));
        compare_with_hungarian(&mut planning, false);
        let outcome = plan(Arc::clone(&problem));
        let decisions: Vec<_> = outcome
            .decisions
            .iter()
            .map(|(_, one)| one.clone())
            .collect();
        let checked = check_plan(&problem, &decisions, &outcome.plan);
        assert_eq!(checked.err(), None, "seed {seed}");
        let unfinished = plan(with_parameters(
            &problem,
            PlannerParameters {
                exact_finish: false,
                ..parameters
            },
        ));
        // A dry run with the exact finish can trim the target differently.
        if outcome.trimmed_spots != unfinished.trimmed_spots {
            continue;
        }
        assert!(
            outcome.total_utility >= unfinished.total_utility,
            "seed {seed}"
        );
        restored += usize::from(outcome.total_utility > unfinished.total_utility);
        readmitted += usize::from(outcome.unassigned != unfinished.unassigned);
    }
    assert!(
        restored > 200 && readmitted > 50,
        "{restored}, {readmitted}"
    );
}

/// Reads `fixtures/betweenness.txt`, which `fixtures/betweenness.py` writes with networkx.
#[test]
fn betweenness_equals_networkx() {
    let text = include_str!("fixtures/betweenness.txt");
    let (mut trees, mut others) = (0, 0);
    for graph in text.split("graph ").skip(1) {
        let mut lines = graph.lines();
        let name = lines.next().unwrap();
        let edges: Vec<(usize, usize)> = lines
            .next()
            .unwrap()
            .split_whitespace()
            .map(|edge| {
                let (first, second) = edge.split_once('-').unwrap();
                (first.parse().unwrap(), second.parse().unwrap())
            })
            .collect();
        let expected: Vec<f64> = lines
            .next()
            .unwrap()
            .split_whitespace()
            .map(|value| value.parse().unwrap())
            .collect();
        let topology = Topology::new(expected.len(), &edges);
        let values = betweenness(&topology);
        for (node, (value, expected)) in values.iter().zip(expected).enumerate() {
            let gap = (value.to_units() - expected).abs();
            assert!(
                gap <= 0.500_001e-6,
                "{name}, node {node}: {value}, networkx {expected}"
            );
        }
        if topology.is_tree() {
            trees += 1;
        } else {
            others += 1;
        }
    }
    assert!(
        trees >= 20 && others >= 20,
        "{trees} trees, {others} others"
    );
}
