//! The exact finish: the last turn makes up for what a bounded `d_max` left undone.
//!
//! Chains that are cut short leave the singletons below their optimum. What then separates the two assignments is a set
//! of cycles and paths that share no module and no spot: modules that change places in a ring, or one after another up
//! to a free spot, or up to one that is dropped for one that had no spot. Carrying out those that raise the total utility
//! reaches the optimum (M. Klein, "A primal method for minimal cost flows", Management Science 14, 1967; a free spot and
//! being without a spot are the extra nodes that close the paths). All of it belongs to the last unit's one decision, so
//! it is claimed, checked and applied like any other turn.

use crate::planner::assignment::eviction::{Allocation, ChainSearch, Step};
use crate::planner::assignment::spot_allocation::{self, Displacement};
use crate::planner::assignment::{Holder, Instance, SpotTable};
use crate::planner::turns::turn_order::TurnQueue;

/// Whether the unit whose turn it is, first in the queue, has to finish the allocation once it has its spots.
pub(crate) fn is_due(instance: &Instance, queue: &TurnQueue) -> bool {
    let parameters = instance.problem.parameters();
    parameters.exact_finish && parameters.d_max.is_some() && queue.has_one_unit()
}

/// Moves all modules that are not in blocks to an assignment of greatest utility, those without a spot included.
///
/// `displaced` are the singletons from which a block has just taken their spots. Appends all evictions, and returns the
/// modules that had no spot, were not displaced, and have one now; ascending.
pub(crate) fn finish(
    instance: &Instance,
    allocation: &mut Allocation,
    displaced: Vec<Displacement>,
    evictions: &mut Vec<Displacement>,
) -> Vec<usize> {
    let table = &mut allocation.table;
    let wanted = optimum(instance, table);
    let mut chains = improving_chains(instance, table, &wanted);
    let moving = || chains.iter().flat_map(|chain| &chain.steps);
    for step in moving() {
        table.release(step.module);
    }
    for step in moving() {
        if let Some(spot) = step.to {
            table.give(spot, Holder::Singleton(step.module));
        }
    }
    for mut displacement in displaced {
        displacement.to = table.spot_of(displacement.evicted);
        evictions.push(displacement);
        let onward = chains
            .iter()
            .position(|chain| chain.entering == Some(displacement.evicted));
        if let Some(position) = onward {
            let chain = chains.remove(position);
            evictions.extend(spot_allocation::displacements_of(&chain.steps));
        }
    }
    for chain in &chains {
        evictions.extend(spot_allocation::displacements_of(&chain.steps));
    }
    chains.iter().filter_map(|chain| chain.entering).collect()
}

/// Moves that belong together.
struct Chain {
    /// The module that it begins with, if that one had no spot.
    entering: Option<usize>,
    steps: Vec<Step>,
}

/// An optimal assignment of the modules that are not in blocks to the spots that no block holds.
fn optimum(instance: &Instance, table: &SpotTable) -> SpotTable {
    let mut best = Allocation::new(instance.utilities.module_count(), table.holders().len());
    let mut is_fixed = vec![false; instance.utilities.module_count()];
    for (spot, &holder) in table.holders().iter().enumerate() {
        match holder {
            Holder::Fixed(module) => {
                is_fixed[module] = true;
                best.table.give(spot, holder);
            }
            Holder::Closed => best.table.close(spot),
            Holder::Nobody | Holder::Singleton(_) => (),
        }
    }
    // Its bounds belong to other potentials, so a search of its own is needed.
    let mut search = ChainSearch::default();
    for module in (0..is_fixed.len()).filter(|&module| !is_fixed[module]) {
        search.insert_unbounded(instance, &mut best, module);
    }
    best.table
}

/// The chains that lead from one assignment towards another and raise the total utility or the number of spots filled,
/// those of modules without a spot first.
fn improving_chains(instance: &Instance, now: &SpotTable, wanted: &SpotTable) -> Vec<Chain> {
    let module_count = instance.utilities.module_count();
    let moves = |module: usize| now.spot_of(module) != wanted.spot_of(module);
    let holder_of = |table: &SpotTable, spot: usize| match table.holder(spot) {
        Holder::Singleton(module) => Some(module),
        Holder::Nobody | Holder::Fixed(_) | Holder::Closed => None,
    };
    let worth = |module: usize, spot: Option<usize>| {
        spot.map_or(0, |spot| instance.utilities.of(module, spot).0)
    };
    // A path begins with a module that nobody follows to its spot; what no path visits lies on a ring.
    let enters = (0..module_count).filter(|&module| now.spot_of(module).is_none());
    let leaves_a_hole = (0..module_count).filter(|&module| {
        now.spot_of(module)
            .is_some_and(|spot| holder_of(wanted, spot).is_none())
    });
    let mut visited = vec![false; module_count];
    let mut chains = Vec::new();
    for start in enters.chain(leaves_a_hole).chain(0..module_count) {
        let mut steps: Vec<Step> = Vec::new();
        let mut next = Some(start).filter(|&module| moves(module));
        while let Some(module) = next.filter(|&module| !visited[module]) {
            visited[module] = true;
            let to = wanted.spot_of(module);
            steps.push(Step { module, to });
            next = to.and_then(|spot| holder_of(now, spot));
        }
        let gain: i64 = steps
            .iter()
            .map(|step| worth(step.module, step.to) - worth(step.module, now.spot_of(step.module)))
            .sum();
        let entering = Some(start).filter(|&module| now.spot_of(module).is_none());
        let fills_a_spot = entering.is_some() && steps.last().is_some_and(|last| last.to.is_some());
        if gain > 0 || fills_a_spot {
            chains.push(Chain { entering, steps });
        }
    }
    chains
}
