//! The exact finish: the last turn restores the optimum that a bounded `d_max` has missed.
//!
//! Chains that were cut short leave the singletons below their optimum. The difference to an optimal assignment is a set
//! of rings and paths that share no module and no spot: modules that change places in a ring, or one after another up to
//! a free spot, or up to a module that loses its spot to one that had none. Carrying out those that raise the total
//! utility reaches the optimum (M. Klein, "A primal method for minimal cost flows", Management Science 14, 1967; a free
//! spot and the lack of a spot are the extra nodes that close the paths). All of them belong to the last unit's one
//! decision, which is claimed, checked and applied like any other.

use crate::assignment::allocation::{
    Allocation, Displacement, Holder, Reassignment, SpotTable, displacements_of,
};
use crate::assignment::eviction::ChainSearch;
use crate::assignment::instance::Instance;

/// Moves all modules that are not in blocks to an assignment of greatest utility, those without a spot included.
///
/// `displaced` are the singletons whose spots a block has just taken. Appends all evictions, and returns the modules that
/// had no spot, were not displaced, and now have a spot; ascending.
pub(crate) fn finish(
    instance: &Instance,
    allocation: &mut Allocation,
    displaced: Vec<Displacement>,
    evictions: &mut Vec<Displacement>,
) -> Vec<usize> {
    let table = &mut allocation.table;
    let wanted = optimum(instance, table);
    let mut chains = improving_chains(instance, table, &wanted);
    table.carry_out(chains.iter().flat_map(|chain| &chain.steps));
    for mut displacement in displaced {
        displacement.to = table.spot_of(displacement.evicted);
        evictions.push(displacement);
        let onward = chains
            .iter()
            .position(|chain| chain.entering == Some(displacement.evicted));
        if let Some(position) = onward {
            evictions.extend(displacements_of(&chains.remove(position).steps));
        }
    }
    for chain in &chains {
        evictions.extend(displacements_of(&chain.steps));
    }
    chains.iter().filter_map(|chain| chain.entering).collect()
}

/// A path or ring of moves, one module to the spot of the next.
struct Chain {
    /// The module that it begins with, if that module had no spot.
    entering: Option<usize>,
    steps: Vec<Reassignment>,
}

/// An optimal assignment of the modules that are not in blocks to the spots that no block holds.
fn optimum(instance: &Instance, table: &SpotTable) -> SpotTable {
    let mut best = Allocation::new(instance.module_count(), table.holders().len());
    let modules = 0..instance.module_count();
    let mut is_fixed: Vec<bool> = modules
        .map(|one| instance.problem.is_cut_off(one))
        .collect();
    for (spot, &holder) in table.holders().iter().enumerate() {
        match holder {
            Holder::Fixed(module) => {
                is_fixed[module] = true;
                best.table.give(spot, holder);
            }
            Holder::Closed => best.table.close(spot),
            Holder::Free | Holder::Singleton(_) => {}
        }
    }
    // The bounds of the turns' own search hold for other potentials.
    let mut search = ChainSearch::default();
    for module in (0..is_fixed.len()).filter(|&module| !is_fixed[module]) {
        search.insert(instance, &mut best, module, u32::MAX);
    }
    best.table
}

/// The chains that lead from one assignment towards another and raise the total utility or the number of filled spots;
/// those of modules without a spot come first.
fn improving_chains(instance: &Instance, now: &SpotTable, wanted: &SpotTable) -> Vec<Chain> {
    let modules = 0..instance.module_count();
    let moves = |module: usize| now.spot_of(module) != wanted.spot_of(module);
    let singleton_on = |table: &SpotTable, spot: usize| match table.holder(spot) {
        Holder::Singleton(module) => Some(module),
        Holder::Free | Holder::Fixed(_) | Holder::Closed => None,
    };
    let worth = |module: usize, spot: Option<usize>| {
        spot.map_or(0, |spot| instance.utilities.of(module, spot).0)
    };
    // A path begins with a module that has no spot, or whose spot no singleton takes. What no path visits lies on a ring.
    let enters = modules
        .clone()
        .filter(|&module| now.spot_of(module).is_none());
    let leaves_a_hole = modules.clone().filter(|&module| {
        let spot = now.spot_of(module);
        spot.is_some_and(|spot| singleton_on(wanted, spot).is_none())
    });
    let mut visited = vec![false; instance.module_count()];
    let mut chains = Vec::new();
    for start in enters.chain(leaves_a_hole).chain(modules.clone()) {
        let mut steps: Vec<Reassignment> = Vec::new();
        let mut next = Some(start).filter(|&module| moves(module));
        while let Some(module) = next.filter(|&module| !visited[module]) {
            visited[module] = true;
            let to = wanted.spot_of(module);
            steps.push(Reassignment { module, to });
            next = to.and_then(|spot| singleton_on(now, spot));
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
