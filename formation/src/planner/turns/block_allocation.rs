//! The turn of a configuration: the paper's `blockAllocation` (Algorithm 2) with the optimal common subgraph.

use super::turn_order::TurnQueue;
use super::turn_result::TurnResult;
use crate::model::MicroUnits;
use crate::planner::assignment::{
    self, Allocation, BestOfSpots, ChainSearch, Displacement, Holder, Instance,
};
use crate::planner::placement::best_matching;

/// Finds the best place for the largest part of a configuration, takes the spots, and inserts the displaced singletons by
/// chain eviction.
///
/// `members` are two or more modules, ascending and connected by links, first in the queue. A configuration of which no
/// two linked modules can stay together dissolves: all its modules leave as singletons.
pub(super) fn allocate(
    instance: &Instance,
    search: &mut ChainSearch,
    members: &[usize],
    queue: &TurnQueue,
    result: &mut TurnResult,
) {
    let (allocation, evictions) = (&mut result.allocation, &mut result.evictions);
    let links = instance.links.induced_by(members);
    let cut_price = instance.problem.parameters().cut_price.per_cut();
    // A cut of the free target harms only later configurations.
    let edge_price = if queue.has_other_blocks() {
        cut_price
    } else {
        MicroUnits::ZERO
    };
    let prices = prices(instance, allocation, edge_price);
    let broken_links: Vec<MicroUnits> = (0..members.len())
        .map(|node| cut_price.times(links.degree(node)))
        .collect();
    let matching = best_matching(instance.target.topology(), &links, |node, spot| {
        let price = prices[spot]? + broken_links[node];
        Some(instance.utilities.of(members[node], spot) - price)
    });
    result.proven = matching.proven;
    if matching.pairs.len() < 2 {
        result.remainder = members.iter().map(|&member| vec![member]).collect();
        result.detached = members.to_vec();
        return;
    }
    let mut stays = vec![false; members.len()];
    let mut placed = matching.pairs;
    for (module, _) in &mut placed {
        stays[*module] = true;
        *module = members[*module];
    }
    let displaced = take_spots(instance, allocation, &placed);
    let components = links.components_within(|node| !stays[node]).into_iter();
    result.remainder = components
        .map(|component| component.into_iter().map(|node| members[node]).collect())
        .collect();
    result.detached = result.remainder.concat();
    if placed.len() == members.len() && queue.exact_finish_is_due(instance) {
        let entered = assignment::finish(instance, allocation, displaced, evictions);
        result.detached.extend(instance.linked(entered));
    } else {
        reinsert(instance, search, allocation, displaced, evictions);
    }
    let block = placed.into_iter().map(|(member, _)| member);
    result.blocks.push(block.collect());
}

/// The cost of each spot for a configuration on top of its own utility; `None` where the spot is fixed or closed.
///
/// Taking a spot from a singleton costs the singleton's loss from moving to its best free spot, or its whole utility if no
/// spot is free. Each edge to a spot that no block holds costs `edge_price`. An edge within the block is charged at both
/// ends as well, but in trees equally many modules have equally many of these, so it decides nothing.
fn prices(
    instance: &Instance,
    allocation: &Allocation,
    edge_price: MicroUnits,
) -> Vec<Option<MicroUnits>> {
    let table = &allocation.table;
    let is_open = |spot: usize| matches!(table.holder(spot), Holder::Free | Holder::Singleton(_));
    let cuts = |spot: usize| {
        let neighbours = instance.target.topology().neighbours(spot).iter();
        edge_price.times(neighbours.filter(|&&neighbour| is_open(neighbour)).count())
    };
    let free = BestOfSpots::free(instance, table);
    let holders = table.holders().iter().enumerate();
    holders
        .map(|(spot, holder)| match *holder {
            Holder::Free => Some(cuts(spot)),
            Holder::Fixed(_) | Holder::Closed => None,
            Holder::Singleton(module) => {
                let elsewhere = free.best_for(module).map_or(0, |(best, _)| best.gain());
                Some(instance.utilities.of(module, spot) - MicroUnits(elsewhere) + cuts(spot))
            }
        })
        .collect()
}

/// Gives the block its spots; returns the singletons that held them, in the order of their rank.
fn take_spots(
    instance: &Instance,
    allocation: &mut Allocation,
    placed: &[(usize, usize)],
) -> Vec<Displacement> {
    let mut displaced = Vec::new();
    for &(member, spot) in placed {
        if let Holder::Singleton(evicted) = allocation.table.holder(spot) {
            allocation.table.release(evicted);
            displaced.push(Displacement {
                evicted,
                by: member,
                from: spot,
                to: None,
            });
        }
        allocation.table.give(spot, Holder::Fixed(member));
    }
    displaced.sort_unstable_by_key(|displacement| instance.ranks[displacement.evicted]);
    displaced
}

/// Inserts displaced singletons by chain eviction, one after another.
fn reinsert(
    instance: &Instance,
    search: &mut ChainSearch,
    allocation: &mut Allocation,
    displaced: Vec<Displacement>,
    evictions: &mut Vec<Displacement>,
) {
    for mut displacement in displaced {
        let position = evictions.len();
        displacement.to = search.allocate(instance, allocation, displacement.evicted, evictions);
        evictions.insert(position, displacement);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::model::{
        ModuleId, PlannerParameters, PlanningModule, PlanningProblem, Pose, Target,
    };
    use crate::planner;

    #[test]
    fn a_ring_with_a_tail_keeps_all_links_on_a_grid() {
        let target = Target::grid(4);
        // A ring of six, a tail of two, and eight modules alone.
        let links = [
            [0, 1],
            [1, 2],
            [2, 3],
            [3, 4],
            [4, 5],
            [0, 5],
            [2, 6],
            [6, 7],
        ];
        let modules = (0..16)
            .map(|id| PlanningModule {
                id: ModuleId(id),
                pose: Pose::from_units(f64::from(id) * 0.7, f64::from(id % 3), 0.0).unwrap(),
                links: links
                    .iter()
                    .filter(|link| link.contains(&id))
                    .map(|link| ModuleId(link[0] + link[1] - id))
                    .collect(),
                configuration: None,
                leader: None,
                pin: None,
            })
            .collect();
        let problem =
            PlanningProblem::new(Arc::new(target), PlannerParameters::default(), modules).unwrap();
        let outcome = planner::plan(Arc::new(problem));
        assert_eq!(outcome.plan.kept_links.len(), links.len());
        assert_eq!(
            outcome.plan.blocks,
            [(0..8).map(ModuleId).collect::<Vec<_>>()]
        );
        assert!(outcome.proven);
    }
}
