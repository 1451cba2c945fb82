//! Checks a plan against the guarantees of the planning rules, from its input and its decisions alone.

use std::collections::{BTreeMap, BTreeSet};

use petgraph::visit::Bfs;

use super::replay::{Replay, groups, kept_links_of};
use super::violation::Violation;
use formation_model::{Decision, ModuleId, Plan, PlanningProblem, Policy, SpotId};

/// Checks that a plan keeps every guarantee that does not depend on the policy:
///
/// 1. There are at most two turns for each module.
/// 2. Exactly `min(|A|, |S|)` spots are filled, each by one module, where A are the modules that walls do not cut off. With too few modules they are connected, unless
///    the target is not trimmed (`keep_all_spots`, or the policy `paper`) or pinned
///    modules are too far apart. The policy `paper` promises neither.
/// 3. No member of a configuration is evicted, and no pinned module leaves its spot.
/// 4. The turns, replayed, lead to the plan's assignment. No chain is longer than `d_max`, except in the last turn with
///    `exact_finish`, when modules can also move to a free spot.
/// 5. The blocks are those that the turns placed, each connected by links that it keeps. The kept links are exactly those of
///    a block's modules, or of pinned modules, on adjacent spots.
/// 6. Under the policy `given`, each module has the spot that the target gives it.
/// 7. The acting order lists each placed module once, each block as one unit, pinned modules first. Every spot has an
///    adjacent one that is filled before it, except the first of each connected part of the filled spots.
///
/// # Errors
/// Lists all violations found, in no particular order.
pub fn check_plan(
    problem: &PlanningProblem,
    decisions: &[Decision],
    plan: &Plan,
) -> Result<(), Vec<Violation>> {
    checked(problem, decisions, plan, check_blocks)
}

/// Checks a plan whose motion swaps spots after the claims: the last decision has the swaps, and the plan the units that the
/// motion gave it. The same guarantees hold, except that the motion may take blocks apart.
///
/// # Errors
/// Lists all violations found, in no particular order.
pub fn check_swapped_plan(
    problem: &PlanningProblem,
    decisions: &[Decision],
    plan: &Plan,
) -> Result<(), Vec<Violation>> {
    checked(problem, decisions, plan, |_, _, _, _| ())
}

fn checked(
    problem: &PlanningProblem,
    decisions: &[Decision],
    plan: &Plan,
    check_blocks: impl Fn(&PlanningProblem, &Replay, &Plan, &mut Vec<Violation>),
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
    check_as_given(problem, plan, violations);
    let filled: BTreeSet<SpotId> = holders.into_keys().collect();
    if problem.parameters().policy != Policy::Paper {
        check_filled(problem, &filled, violations);
    }
}

/// Checks that each module has the spot that the target gives it, if it gives any.
fn check_as_given(problem: &PlanningProblem, plan: &Plan, violations: &mut Vec<Violation>) {
    let Some(given) = problem.target().given() else {
        return;
    };
    for module in problem.modules() {
        let spot_in = |spots: &BTreeMap<ModuleId, SpotId>| spots.get(&module.id).copied();
        let (given, spot) = (spot_in(given.spots()), spot_in(&plan.assignments));
        if given != spot {
            let module = module.id;
            violations.push(Violation::NotAsGiven {
                module,
                given,
                spot,
            });
        }
    }
}

/// What is wrong with the spots that a plan fills: too few of them, or in several parts that could be joined. `check_plan`
/// reports the same, except under the policy `paper`, which promises neither, and except for spots that stay open because
/// walls cut modules off.
pub fn hole_of(problem: &PlanningProblem, plan: &Plan) -> Vec<Violation> {
    let filled: BTreeSet<SpotId> = plan.assignments.values().copied().collect();
    let mut violations = Vec::new();
    let expected = problem.modules().len().min(problem.target().spots().len());
    if problem.fillable_count() < expected {
        let filled = filled.len();
        violations.push(Violation::WrongCount { filled, expected });
    }
    check_filled(problem, &filled, &mut violations);
    violations
}

/// Checks the number of filled spots and that they are connected.
pub(super) fn check_filled(
    problem: &PlanningProblem,
    filled: &BTreeSet<SpotId>,
    violations: &mut Vec<Violation>,
) {
    let expected = problem.fillable_count();
    if filled.len() != expected {
        violations.push(Violation::WrongCount {
            filled: filled.len(),
            expected,
        });
    }
    if !problem.parameters().trims_target() {
        return;
    }
    let pins: BTreeSet<SpotId> = problem.modules().iter().filter_map(|one| one.pin).collect();
    let parts = filled_parts(problem, filled);
    let (Some(first), Some(other)) = (parts.first(), parts.get(1)) else {
        return;
    };
    // The other modules can be too few to join the pinned ones.
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

/// The connected parts of the filled spots; parts and spots ascend.
pub(super) fn filled_parts(
    problem: &PlanningProblem,
    filled: &BTreeSet<SpotId>,
) -> Vec<Vec<SpotId>> {
    let spots = problem.target().spots();
    let edges = problem.target().topology().edges().iter();
    groups(
        filled,
        edges.map(|&(first, second)| (spots[first].id, spots[second].id)),
    )
}

/// The number of spots of the smallest connected part of a tree that contains all of `pins`; `None` if the target is no
/// tree, where the problem is NP-hard.
fn spots_joining(problem: &PlanningProblem, pins: &BTreeSet<SpotId>) -> Option<usize> {
    let topology = problem.target().topology();
    let positions = pins.iter().map(|&pin| problem.target().position_of(pin));
    let positions: Vec<usize> = positions.collect::<Option<_>>()?;
    let &root = positions.first().filter(|_| topology.is_tree())?;
    let mut is_needed = vec![false; topology.node_count()];
    for position in positions {
        is_needed[position] = true;
    }
    let mut order = Vec::new();
    let mut rank = vec![0; topology.node_count()];
    let mut walk = Bfs::new(topology.as_petgraph(), root);
    while let Some(spot) = walk.next(topology.as_petgraph()) {
        rank[spot] = order.len();
        order.push(spot);
    }
    // A spot is needed if it leads from the root to a pin.
    for &spot in order.iter().rev().filter(|&&spot| spot != root) {
        if is_needed[spot] {
            let mut neighbours = topology.neighbours(spot).iter();
            if let Some(&parent) = neighbours.find(|&&other| rank[other] < rank[spot]) {
                is_needed[parent] = true;
            }
        }
    }
    Some(is_needed.iter().filter(|&&is_needed| is_needed).count())
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
    // Pinned modules keep their links.
    let modules = problem.modules().iter();
    let pinned = modules
        .filter(|module| module.pin.is_some())
        .map(|module| module.id)
        .collect();
    let mut kept = kept_links_of(problem, &plan.assignments, &pinned);
    for block in &plan.blocks {
        let members: BTreeSet<ModuleId> = block.iter().copied().collect();
        let links = kept_links_of(problem, &plan.assignments, &members);
        let parts = groups(&members, links.iter().copied());
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
        // Pinned modules do not move, so their grouping does not matter.
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
