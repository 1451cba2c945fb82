//! The turn of a configuration: the paper's `blockAllocation` (Algorithm 2) with the optimal common subgraph.

use crate::model::{MicroUnits, Topology};
use crate::planner::assignment::eviction::{Allocation, ChainSearch};
use crate::planner::assignment::spot_allocation::{self, Displacement};
use crate::planner::assignment::spot_tree::{BestOfSpots, Prospect};
use crate::planner::assignment::{Holder, Instance, exact_finish};
use crate::planner::placement::{Matching, MatchingInput, common_subgraph, common_subtree};
use crate::planner::turns::turn_order::TurnQueue;

/// What came of a configuration's turn.
#[derive(Clone, Debug, Default)]
pub(crate) struct BlockOutcome {
    /// The modules that keep together and their spots; empty when the configuration dissolves.
    pub(crate) placed: Vec<(usize, usize)>,
    /// The connected components of the modules that leave; each ascending, in ascending order.
    pub(crate) remainder: Vec<Vec<usize>>,
    /// The singletons without a spot that the exact finish gave one; ascending.
    pub(crate) readmitted: Vec<usize>,
    /// Whether no larger or better match exists.
    pub(crate) proven: bool,
}

/// Finds the best place for the largest part of a configuration, commits it, and lets the singletons that it
/// displaces re-enter by chain eviction; appends all evictions in the order in which they happen.
///
/// `members` are two or more modules, ascending and connected by links, first in the queue. A configuration of which no
/// two linked modules can stay together dissolves: all its modules leave as singletons.
pub(crate) fn allocate(
    instance: &Instance,
    search: &mut ChainSearch,
    allocation: &mut Allocation,
    members: &[usize],
    evictions: &mut Vec<Displacement>,
    queue: &TurnQueue,
) -> BlockOutcome {
    let topology = topology_of(instance, members);
    let cut_price = instance.problem.parameters().cut_price.per_cut();
    let breaking: Vec<MicroUnits> = (0..members.len())
        .map(|node| cut_price.times(topology.degree(node)))
        .collect();
    // Who cuts off free spots harms only the configurations to come.
    let cutting = if queue.has_other_blocks() {
        cut_price
    } else {
        MicroUnits::ZERO
    };
    let prices = prices(instance, allocation, cutting);
    let matching = best_matching(instance.target.topology(), &topology, |node, spot| {
        let price = prices[spot]? + breaking[node];
        Some(instance.utilities.of(members[node], spot) - price)
    });
    if matching.pairs.len() < 2 {
        return BlockOutcome {
            placed: Vec::new(),
            remainder: members.iter().map(|&member| vec![member]).collect(),
            proven: matching.proven,
            ..BlockOutcome::default()
        };
    }
    let mut stays = vec![false; members.len()];
    let placed: Vec<(usize, usize)> = matching
        .pairs
        .iter()
        .map(|&(node, spot)| {
            stays[node] = true;
            (members[node], spot)
        })
        .collect();
    let displaced = take_spots(instance, allocation, &placed);
    let finishes = placed.len() == members.len() && exact_finish::is_due(instance, queue);
    let readmitted = if finishes {
        exact_finish::finish(instance, allocation, displaced, evictions)
    } else {
        reinsert(instance, search, allocation, displaced, evictions);
        Vec::new()
    };
    let remainder = topology
        .components_within(|node| !stays[node])
        .into_iter()
        .map(|component| component.into_iter().map(|node| members[node]).collect())
        .collect();
    BlockOutcome {
        placed,
        remainder,
        readmitted,
        proven: matching.proven,
    }
}

/// The links among `members`, which are ascending positions of modules.
pub(crate) fn topology_of(instance: &Instance, members: &[usize]) -> Topology {
    let edges: Vec<(usize, usize)> = members
        .iter()
        .enumerate()
        .flat_map(|(node, &member)| {
            instance
                .links
                .neighbours(member)
                .iter()
                .filter(move |&&other| other > member)
                .filter_map(move |other| Some((node, members.binary_search(other).ok()?)))
        })
        .collect();
    Topology::new(members.len(), &edges).unwrap_or_else(|_| Topology::without_edges(members.len()))
}

/// Chooses the solver: the exact programme for two trees, the search for graphs with cycles. Both graphs are connected.
pub(crate) fn best_matching(
    target: &Topology,
    configuration: &Topology,
    weight: impl Fn(usize, usize) -> Option<MicroUnits>,
) -> Matching {
    let input = MatchingInput {
        configuration,
        target,
        weight,
    };
    let is_tree = |graph: &Topology| graph.edges().len() + 1 == graph.node_count();
    if is_tree(configuration) && is_tree(target) {
        common_subtree::solve(&input)
    } else {
        common_subgraph::solve(&input)
    }
}

/// What taking each spot costs a configuration on top of its own utility; `None` where it may not.
///
/// Taking a spot from a singleton costs what the singleton loses by moving to its best free spot, or all that it
/// earns if no spot is free. Each edge to a spot that no block holds costs `cutting`: an edge within the block is charged
/// at both ends as well, but in trees equally many modules have equally many of these, so it decides nothing.
fn prices(
    instance: &Instance,
    allocation: &Allocation,
    cutting: MicroUnits,
) -> Vec<Option<MicroUnits>> {
    let table = &allocation.table;
    let is_open = |spot: usize| matches!(table.holder(spot), Holder::Nobody | Holder::Singleton(_));
    let cuts = |spot: usize| {
        let neighbours = instance.target.topology().neighbours(spot).iter();
        cutting.times(neighbours.filter(|&&neighbour| is_open(neighbour)).count())
    };
    let free = table.free_spots().map(|spot| (spot, Prospect::default()));
    let free = BestOfSpots::new(instance, free);
    table
        .holders()
        .iter()
        .enumerate()
        .map(|(spot, holder)| match *holder {
            Holder::Nobody => Some(cuts(spot)),
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

/// Lets displaced singletons re-enter by chain eviction, one after another.
fn reinsert(
    instance: &Instance,
    search: &mut ChainSearch,
    allocation: &mut Allocation,
    displaced: Vec<Displacement>,
    evictions: &mut Vec<Displacement>,
) {
    for mut displacement in displaced {
        let position = evictions.len();
        displacement.to = spot_allocation::allocate(
            instance,
            search,
            allocation,
            displacement.evicted,
            evictions,
        );
        evictions.insert(position, displacement);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::model::{
        ModuleId, PlannerParameters, PlanningModule, PlanningProblem, Pose, RawSpot, RawTarget,
        Target,
    };
    use crate::planner;

    fn path(count: usize) -> Topology {
        let edges: Vec<(usize, usize)> = (1..count).map(|node| (node - 1, node)).collect();
        Topology::new(count, &edges).unwrap()
    }

    /// Two combs of different teeth, on which the general search cannot finish.
    fn comb(count: usize, every: usize) -> Topology {
        let mut edges = path(count).edges().to_vec();
        for (tooth, node) in (0..count).step_by(every).enumerate() {
            edges.push((node, count + tooth));
        }
        Topology::new(edges.len() + 1, &edges).unwrap()
    }

    #[test]
    fn trees_are_matched_exactly_however_large() {
        let (target, configuration) = (comb(120, 3), comb(60, 2));
        let weight = |node: usize, spot: usize| {
            (!(node + spot).is_multiple_of(7))
                .then(|| MicroUnits(i64::try_from(node * spot % 101).unwrap()))
        };
        let matching = best_matching(&target, &configuration, weight);
        let input = MatchingInput {
            configuration: &configuration,
            target: &target,
            weight,
        };
        assert_eq!(matching, common_subtree::solve(&input));
        assert!(matching.proven);
        assert!(!common_subgraph::solve(&input).proven);
    }

    #[test]
    fn a_ring_with_a_tail_keeps_all_links_on_a_grid() {
        let side = 4;
        let spots = (0..side * side).map(|id| RawSpot {
            id,
            x: f64::from(id % side),
            y: f64::from(id / side),
            theta: 0.0,
        });
        let along = (0..side * side).filter(|id| id % side + 1 < side);
        let across = (0..side * side - side).map(|id| [id, id + side]);
        let target = Target::try_from(RawTarget {
            frame_id: "map".to_owned(),
            spots: spots.collect(),
            edges: along.map(|id| [id, id + 1]).chain(across).collect(),
        })
        .unwrap();
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
