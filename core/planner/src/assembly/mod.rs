//! The acting order: the order in which the units take their spots.
//!
//! The paper (section "Acting Phase") lets modules move by the betweenness of their spots, centre first, and its Theorem 1
//! concludes that no module is walled in. In fact, sorted by betweenness alone, almost every target has a spot that is
//! filled while no adjacent one is, and even breadth-first layers wall a spot in on most lattice trees. So this order takes
//! corridors into account:
//!
//! - Breadth-first layers from the spot of greatest value are the base.
//! - On a unit lattice the order is found in reverse, by taking the finished formation apart. A spot can be vacated if the
//!   rest stays connected and a unit module has a path out through free cells; of these spots, the one latest in
//!   breadth-first order goes first (`peeling`). The root goes last; if that fails, any spot can. On trees this finds an
//!   order whenever there is one, because a spot that can be vacated once can still be vacated later. On cyclic targets
//!   it may fail, and a search under a budget follows (`search`).
//! - Where no such order exists, or off the lattice, the order is breadth-first, with a warning.
//!
//! The policy `paper` takes the paper's own order instead: the spot of greatest value, then the spots next to it, and so on,
//! each layer by value. A spot that it walls in is warned of.
//!
//! **Units.** A block is contracted to one node: its spots follow one another, the first adjacent to a filled spot. Each
//! of them must have a corridor for a unit module at its turn. How a block reshapes while it moves is not modelled: each of
//! its modules has a path, but the block need not fit through in one piece. Pinned modules stand already: they come first,
//! each as a unit of its own, and are obstacles from the start. Modules without a spot, and those still on the move, are no
//! obstacles.

mod breadth_first;
mod corridor;
mod ground;
mod peeling;
mod search;
#[cfg(test)]
mod tests;

use formation_model::{
    ActingOrder, Assembly, AssemblyWarning, MicroUnits, Plan, PlanningProblem, Policy,
};

use breadth_first::{BreadthFirst, Within};
use corridor::Corridors;
use ground::{Ground, Root};
use search::SEARCH_STEPS_MAX;

/// Orders the units of a plan. `values` has the value of each spot of the problem's target, by position.
///
/// Deterministic: ties of value go to the lower spot, neighbours are in ascending order. Takes about O(n log n) for n spots
/// on trees with single modules; a block of k modules can be tried once for each cell of its outline, in O(k) each time.
pub(super) fn order(problem: &PlanningProblem, plan: &Plan, values: &[MicroUnits]) -> Assembly {
    order_within(problem, plan, values, SEARCH_STEPS_MAX)
}

/// The same with less of a search: for a look at many orders of which one is to be used.
pub(super) fn try_order(problem: &PlanningProblem, plan: &Plan, values: &[MicroUnits]) -> Assembly {
    order_within(problem, plan, values, SEARCH_STEPS_MAX / 8)
}

fn order_within(
    problem: &PlanningProblem,
    plan: &Plan,
    values: &[MicroUnits],
    steps_max: u64,
) -> Assembly {
    let id_of = |spot: usize| problem.target().spots()[spot].id;
    let ground = Ground::new(problem, plan, values);
    let follows_paper = problem.parameters().policy == Policy::Paper
        && problem.parameters().paper.acting == ActingOrder::Layers;
    let within = if follows_paper {
        Within::Value
    } else {
        Within::Reached
    };
    let base = BreadthFirst::of(&ground, within);
    let mut warnings = Vec::new();
    let mut sequence = None;
    if let Some(corridors) = Corridors::of(problem.target(), &ground) {
        let budget_is_spent;
        (sequence, budget_is_spent) = if follows_paper {
            (None, false)
        } else {
            with_corridors(&ground, &base, &corridors, steps_max)
        };
        if sequence.is_none() {
            let walled_in = first_walled_in(&ground, &base.sequence, corridors);
            warnings.extend(walled_in.map(|spot| AssemblyWarning::WalledIn(id_of(spot))));
            warnings.extend(budget_is_spent.then_some(AssemblyWarning::BudgetSpent));
        }
    } else {
        warnings.push(AssemblyWarning::OffLattice);
    }
    let sequence = sequence.unwrap_or(base.sequence);
    let restarts = ground.restarts_along(&sequence).into_iter();
    warnings.extend(restarts.map(|spot| AssemblyWarning::Disconnected(id_of(spot))));
    Assembly {
        units: ground.units_along(problem, &sequence),
        warnings,
    }
}

/// Looks for an order with corridors: with the root at the centre before a free one, by peeling before the search.
/// Also returns whether a search ended at its budget.
fn with_corridors(
    ground: &Ground,
    base: &BreadthFirst,
    corridors: &Corridors,
    steps_max: u64,
) -> (Option<Vec<usize>>, bool) {
    let standing = base.sequence.iter().filter(|&&spot| ground.pinned[spot]);
    let mut budget_is_spent = false;
    for root in [Root::Centre, Root::Free] {
        let mut removed = peeling::peel(ground, base, corridors.clone(), root);
        if removed.is_none() && !base.spans_every_edge {
            let found = search::search(ground, base, corridors.clone(), root, steps_max / 2);
            budget_is_spent |= found.is_err();
            removed = found.ok().flatten();
        }
        if let Some(removed) = removed {
            let sequence = standing.chain(removed.iter().rev()).copied().collect();
            return (Some(sequence), budget_is_spent);
        }
    }
    (None, budget_is_spent)
}

/// The first spot of an order that has no corridor at its turn.
fn first_walled_in(ground: &Ground, sequence: &[usize], mut corridors: Corridors) -> Option<usize> {
    let mut first = None;
    for &spot in sequence.iter().rev().filter(|&&spot| !ground.pinned[spot]) {
        if !corridors.reaches(spot) {
            first = Some(spot);
        }
        corridors.vacate(spot);
    }
    first
}
