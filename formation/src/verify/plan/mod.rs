//! Checks a plan against the guarantees of the planning rules, from its input and its turns alone.

use std::collections::{BTreeMap, BTreeSet};

use super::Violation;
use super::replay::{Replay, groups};
use crate::model::{Decision, ModuleId, Plan, PlanningProblem, SpotId};

/// Checks that a plan keeps every guarantee that does not depend on the policy:
///
/// 1. the turns end: there are at most two for each module;
/// 2. exactly `min(|A|, |S|)` spots are filled, each by one module, and with too few modules they hang together unless
///    `keep_all_spots` is set or pinned modules are too far apart for that;
/// 3. no member of a configuration is evicted, and no pinned module leaves its spot;
/// 4. the turns, replayed, lead to the plan's assignment, and no chain is longer than `d_max`, save in the last
///    turn if that restores the optimum (`exact_finish`), when modules may also move to a spot that is free;
/// 5. the blocks are the ones that the turns placed, each connected by links that it keeps, and the kept links are
///    exactly those of a block's modules, or of pinned modules, on adjacent spots;
/// 6. the acting order lists each placed module once, each block as one unit, pinned ones first, and every spot has an
///    adjacent one filled before it, but for the first of each connected part of the filled spots.
///
/// # Errors
/// Lists every violation that was found, in no order of weight.
pub fn check_plan(
    problem: &PlanningProblem,
    decisions: &[Decision],
    plan: &Plan,
) -> Result<(), Vec<Violation>> {
    let mut replay = Replay::new(problem);
    for (turn, decision) in (0..).zip(decisions) {
        replay.apply(problem, turn, decision);
    }
    let mut violations = std::mem::take(&mut replay.violations);
    if decisions.len() > 2 * problem.modules().len() {
        violations.push(Violation::TooManyTurns {
            turns: decisions.len(),
            modules: problem.modules().len(),
        });
    }
    check_assignment(problem, &replay, plan, &mut violations);
    check_blocks(problem, &replay, plan, &mut violations);
    check_units(problem, plan, &mut violations);
    check_order(problem, plan, &mut violations);
    if violations.is_empty() {
        Ok(())
    } else {
        Err(violations)
    }
}

fn check_assignment(
    problem: &PlanningProblem,
    replay: &Replay,
    plan: &Plan,
    violations: &mut Vec<Violation>,
) {
    let mut holders = BTreeMap::new();
    for (&module, &spot) in &plan.assignments {
        if problem.position_of(module).is_none() {
            violations.push(Violation::UnknownModule { module });
        }
        if problem.target().position_of(spot).is_none() {
            violations.push(Violation::UnknownSpot { spot });
        }
        if let Some(first) = holders.insert(spot, module) {
            violations.push(Violation::TwoHolders {
                spot,
                first,
                second: module,
            });
        }
    }
    for module in problem.modules() {
        let planned = plan.assignments.get(&module.id).copied();
        let claimed = replay.spots.get(&module.id).copied();
        if planned != claimed {
            violations.push(Violation::ReplayDiffers {
                module: module.id,
                claimed,
                planned,
            });
        }
        if let Some(pin) = module.pin.filter(|&pin| planned != Some(pin)) {
            violations.push(Violation::PinLost {
                module: module.id,
                pin,
                spot: planned,
            });
        }
    }
    let filled: BTreeSet<SpotId> = holders.into_keys().collect();
    check_filled(problem, &filled, violations);
}

/// Checks how many spots are filled and whether they hang together.
pub(super) fn check_filled(
    problem: &PlanningProblem,
    filled: &BTreeSet<SpotId>,
    violations: &mut Vec<Violation>,
) {
    let expected = problem.modules().len().min(problem.target().spots().len());
    if filled.len() != expected {
        violations.push(Violation::WrongCount {
            filled: filled.len(),
            expected,
        });
    }
    if problem.parameters().keep_all_spots {
        return;
    }
    let pins: BTreeSet<SpotId> = problem.modules().iter().filter_map(|one| one.pin).collect();
    let parts = filled_parts(problem, filled);
    let (Some(first), Some(other)) = (parts.first(), parts.get(1)) else {
        return;
    };
    // Modules that stay where they settled may be too far apart to be joined by the modules that are left.
    let anchored = parts
        .iter()
        .all(|part| part.iter().any(|spot| pins.contains(spot)));
    if !anchored || spots_joining(problem, &pins).is_some_and(|needed| needed <= expected) {
        violations.push(Violation::Apart {
            from: first[0],
            unreached: other[0],
        });
    }
}

/// The connected parts of the filled spots.
pub(super) fn filled_parts(
    problem: &PlanningProblem,
    filled: &BTreeSet<SpotId>,
) -> Vec<Vec<SpotId>> {
    groups(filled, |spot| {
        problem.target().neighbours_of(spot).collect()
    })
}

/// How many spots the smallest connected part of a tree has that holds all of `pins`; `None` where the target is no
/// tree, as the question is hard there.
fn spots_joining(problem: &PlanningProblem, pins: &BTreeSet<SpotId>) -> Option<usize> {
    let target = problem.target();
    if !target.topology().is_tree() {
        return None;
    }
    let mut left: BTreeSet<SpotId> = target.spots().iter().map(|spot| spot.id).collect();
    let mut degrees: BTreeMap<SpotId, usize> = left
        .iter()
        .map(|&spot| (spot, target.neighbours_of(spot).count()))
        .collect();
    let is_idle_leaf = |spot: &SpotId, degrees: &BTreeMap<SpotId, usize>| {
        !pins.contains(spot) && degrees.get(spot).is_some_and(|&degree| degree <= 1)
    };
    let mut leaves: Vec<SpotId> = left
        .iter()
        .copied()
        .filter(|spot| is_idle_leaf(spot, &degrees))
        .collect();
    while let Some(leaf) = leaves.pop() {
        left.remove(&leaf);
        for neighbour in target.neighbours_of(leaf).filter(|one| left.contains(one)) {
            if let Some(degree) = degrees.get_mut(&neighbour) {
                *degree -= 1;
            }
            if degrees.get(&neighbour) == Some(&1) && !pins.contains(&neighbour) {
                leaves.push(neighbour);
            }
        }
    }
    Some(left.len())
}

fn check_blocks(
    problem: &PlanningProblem,
    replay: &Replay,
    plan: &Plan,
    violations: &mut Vec<Violation>,
) {
    let claimed: BTreeSet<&Vec<ModuleId>> = replay.blocks.iter().collect();
    let planned: BTreeSet<&Vec<ModuleId>> = plan.blocks.iter().collect();
    violations.extend(
        claimed
            .symmetric_difference(&planned)
            .filter_map(|block| block.first())
            .map(|&module| Violation::WrongBlock { module }),
    );
    if planned.len() != plan.blocks.len() {
        let module = plan.blocks[0].first().copied();
        violations.extend(module.map(|module| Violation::WrongBlock { module }));
    }
    // Modules that stay where they settled keep the links that they have there.
    let pinned = problem
        .modules()
        .iter()
        .filter(|module| module.pin.is_some())
        .map(|module| module.id)
        .collect();
    let mut kept = kept_links_of(problem, plan, &pinned);
    for block in &plan.blocks {
        let members: BTreeSet<ModuleId> = block.iter().copied().collect();
        let links = kept_links_of(problem, plan, &members);
        let mut docked: BTreeMap<ModuleId, Vec<ModuleId>> = BTreeMap::new();
        for &(first, second) in &links {
            docked.entry(first).or_default().push(second);
            docked.entry(second).or_default().push(first);
        }
        let parts = groups(&members, |module| {
            docked.get(&module).cloned().unwrap_or_default()
        });
        if let (Some(first), Some(other)) = (parts.first(), parts.get(1)) {
            violations.push(Violation::BlockApart {
                first: first[0],
                unreached: other[0],
            });
        }
        kept.extend(links);
    }
    for &(first, second) in kept.symmetric_difference(&plan.kept_links) {
        violations.push(Violation::WrongKeptLink {
            first,
            second,
            listed: plan.kept_links.contains(&(first, second)),
        });
    }
}

/// The links among some modules whose ends have adjacent spots.
fn kept_links_of(
    problem: &PlanningProblem,
    plan: &Plan,
    members: &BTreeSet<ModuleId>,
) -> BTreeSet<(ModuleId, ModuleId)> {
    let mut links = BTreeSet::new();
    for &first in members {
        let (Some(module), Some(&spot)) = (problem.module(first), plan.assignments.get(&first))
        else {
            continue;
        };
        let adjacent: BTreeSet<SpotId> = problem.target().neighbours_of(spot).collect();
        links.extend(
            module
                .links
                .iter()
                .filter(|&&second| first < second && members.contains(&second))
                .filter(|&second| {
                    plan.assignments
                        .get(second)
                        .is_some_and(|spot| adjacent.contains(spot))
                })
                .map(|&second| (first, second)),
        );
    }
    links
}

fn check_units(problem: &PlanningProblem, plan: &Plan, violations: &mut Vec<Violation>) {
    let mut listed: BTreeMap<ModuleId, usize> =
        plan.assignments.keys().map(|&module| (module, 0)).collect();
    let blocks: BTreeSet<&Vec<ModuleId>> = plan.blocks.iter().collect();
    let in_blocks: BTreeSet<ModuleId> = plan.blocks.iter().flatten().copied().collect();
    let mut moving_began = false;
    for unit in &plan.assembly.units {
        for (module, spot) in &unit.placements {
            let right = plan.assignments.get(module) == Some(spot);
            *listed.entry(*module).or_default() += usize::from(right);
            if !right {
                violations.push(Violation::WrongListing {
                    module: *module,
                    times: 0,
                });
            }
        }
        let mut modules: Vec<ModuleId> =
            unit.placements.iter().map(|&(module, _)| module).collect();
        modules.sort_unstable();
        // Modules that stay where they settled do not move, so how they are grouped means nothing.
        let is_whole = unit.pinned
            || modules.len() == 1 && !in_blocks.contains(&modules[0])
            || blocks.contains(&modules);
        if !is_whole || modules.first() != Some(&unit.lead) {
            violations.push(Violation::WrongUnit { lead: unit.lead });
        }
        let is_pinned = |module: &ModuleId| {
            problem
                .module(*module)
                .is_some_and(|module| module.pin.is_some())
        };
        moving_began |= !unit.pinned;
        if modules
            .iter()
            .any(|module| is_pinned(module) != unit.pinned)
            || unit.pinned && moving_began
        {
            violations.push(Violation::WrongPin { lead: unit.lead });
        }
    }
    violations.extend(
        listed
            .into_iter()
            .filter(|&(_, times)| times != 1)
            .map(|(module, times)| Violation::WrongListing { module, times }),
    );
}

fn check_order(problem: &PlanningProblem, plan: &Plan, violations: &mut Vec<Violation>) {
    let filled: BTreeSet<SpotId> = plan.assignments.values().copied().collect();
    let mut part_of = BTreeMap::new();
    for (number, part) in filled_parts(problem, &filled).into_iter().enumerate() {
        part_of.extend(part.into_iter().map(|spot| (spot, number)));
    }
    let mut begun = BTreeSet::new();
    let mut placed = BTreeSet::new();
    for unit in &plan.assembly.units {
        for &(module, spot) in &unit.placements {
            let part = part_of.get(&spot);
            let has_neighbour = problem
                .target()
                .neighbours_of(spot)
                .any(|neighbour| placed.contains(&neighbour));
            if begun.contains(&part) && !has_neighbour && !unit.pinned {
                violations.push(Violation::NoPlacedNeighbour { module, spot });
            }
            begun.insert(part);
            placed.insert(spot);
        }
    }
}

#[cfg(test)]
mod tests;
