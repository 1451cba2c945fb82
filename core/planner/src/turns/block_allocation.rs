//! The turn of a configuration: the paper's `blockAllocation` (Algorithm 2) with the optimal common subgraph.

use super::turn_order::TurnQueue;
use super::turn_result::TurnResult;
use crate::assignment::{
    self, Allocation, BestOfSpots, ChainSearch, Displacement, Holder, Instance,
};
use crate::placement::best_matching;
use formation_model::MicroUnits;

/// Finds the best place for the largest part of a configuration, takes the spots, and inserts the displaced singletons by
/// chain eviction.
///
/// `members` are two or more modules, ascending and connected by links, first in the queue. A configuration of which no
/// two linked modules can stay together dissolves: all its modules leave as singletons. The search for the place ends after
/// `nodes_max` search nodes.
pub(super) fn allocate(
    instance: &Instance,
    search: &mut ChainSearch,
    members: &[usize],
    queue: &TurnQueue,
    nodes_max: u64,
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
    let weight = |node: usize, spot: usize| {
        let price = prices[spot]? + broken_links[node];
        Some(instance.utilities.of(members[node], spot) - price)
    };
    let matching = best_matching(instance.target.topology(), &links, weight, nodes_max);
    result.proven = matching.proven;
    result.nodes = matching.nodes;
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

    use crate::Planning;
    use crate::placement::SearchBudget;
    use formation_model::{ModuleId, PlannerParameters, PlanningModule, PlanningProblem, Pose};

    #[test]
    fn a_ring_with_a_tail_keeps_all_links_on_a_grid() {
        let target = crate::grid::grid(4);
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
        let outcome = crate::plan(Arc::new(problem));
        assert_eq!(outcome.plan.kept_links.len(), links.len());
        assert_eq!(
            outcome.plan.blocks,
            [(0..8).map(ModuleId).collect::<Vec<_>>()]
        );
        assert!(outcome.proven);
    }

    /// Squares with a diagonal and modules alone, which together fill a grid.
    fn squares(count: u32, side: u32) -> Arc<PlanningProblem> {
        let links = [[0, 1], [1, 2], [2, 3], [0, 3], [0, 2]];
        let modules = (0..side * side).map(|id| {
            let (square, corner) = (id / 4, id % 4);
            let of_corner = links.iter().filter(|link| link.contains(&corner));
            let neighbours =
                of_corner.map(|link| ModuleId(4 * square + link[0] + link[1] - corner));
            let (x, y) = (f64::from(square % 9) * 3.0, f64::from(square / 9) * 3.0);
            let (right, up) = ([0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]);
            let corner = usize::try_from(corner).unwrap();
            PlanningModule {
                id: ModuleId(id),
                pose: Pose::from_units(x + right[corner], up[corner] - y - 3.0, 0.0).unwrap(),
                links: if square < count {
                    neighbours.collect()
                } else {
                    [].into()
                },
                configuration: None,
                leader: None,
                pin: None,
            }
        });
        let target = Arc::new(crate::grid::grid(side));
        Arc::new(
            PlanningProblem::new(target, PlannerParameters::default(), modules.collect()).unwrap(),
        )
    }

    /// Each block gets its share of what is left, so that the last one is placed as well as the first.
    #[test]
    fn all_blocks_share_one_budget_and_each_is_placed_without_it() {
        let problem = squares(20, 10);
        let planned = |nodes: u64| {
            let mut planning = Planning::with_budget(Arc::clone(&problem), nodes);
            let decisions = planning.take_all_turns();
            (planning.outcome(decisions), planning.budget)
        };
        let (plenty, left) = planned(5_000_000);
        assert!(plenty.proven);
        assert!(left != SearchBudget::of(0));
        let mut kept = 0;
        for nodes in [0, 2_000, 50_000] {
            let (scarce, left) = planned(nodes);
            assert!(!scarce.proven, "{nodes}");
            assert!(scarce.open_spots.is_empty());
            assert_eq!(scarce.decisions, planned(nodes).0.decisions);
            assert!(nodes > 0 || left == SearchBudget::of(0));
            let links = scarce.plan.kept_links.len();
            assert!(links >= kept, "{links} after {kept}");
            kept = links;
        }
        assert!(plenty.plan.kept_links.len() >= kept);
    }
}
