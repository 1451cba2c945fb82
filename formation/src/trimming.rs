//! Which spots to leave out when there are fewer modules than spots.
//!
//! Filling the spots of greatest utility would leave disconnected pieces that cannot be assembled. So the target is
//! peeled from its rim, one spot at a time, until as many spots are left as there are modules; what a dry run of the
//! allocation left free or gave to singletons goes first, so that configurations keep the places that fit them.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::fixed::MicroUnits;
use crate::instance::Instance;
use crate::topology::Topology;

/// What goes first: unfilled spots, then those held by the smallest unit, then the least valuable, then the lowest.
type PeelingKey = (usize, MicroUnits, usize);

/// The spots of the instance's target that are to be formed, ascending: as many as there are modules, connected.
///
/// `holding_sizes` tells for each spot how many modules the unit has that holds it in the dry run; 0 for a free one.
/// Pinned spots always stay. If they span more spots than there are modules, more spots are kept.
pub(crate) fn kept_spots(instance: &Instance, holding_sizes: &[usize]) -> Vec<usize> {
    let target = &instance.target;
    let mut pinned = vec![false; target.spots().len()];
    for module in instance.problem.modules() {
        if let Some(position) = module.pin.and_then(|pin| target.position_of(pin)) {
            pinned[position] = true;
        }
    }
    let key =
        |spot: usize| -> PeelingKey { (holding_sizes[spot], instance.utilities.value(spot), spot) };
    let excess = target
        .spots()
        .len()
        .saturating_sub(instance.problem.modules().len());
    let mut kept = vec![true; target.spots().len()];
    if instance.target_is_tree {
        peel_leaves(target.topology(), &mut kept, &pinned, excess, key);
    } else {
        peel_general(target.topology(), &mut kept, &pinned, excess, key);
    }
    (0..kept.len()).filter(|&spot| kept[spot]).collect()
}

fn peel_leaves(
    topology: &Topology,
    kept: &mut [bool],
    pinned: &[bool],
    excess: usize,
    key: impl Fn(usize) -> PeelingKey,
) {
    let mut degrees: Vec<usize> = (0..kept.len()).map(|spot| topology.degree(spot)).collect();
    let mut leaves: BinaryHeap<Reverse<PeelingKey>> = (0..kept.len())
        .filter(|&spot| degrees[spot] <= 1 && !pinned[spot])
        .map(|spot| Reverse(key(spot)))
        .collect();
    for _ in 0..excess {
        let Some(Reverse((_, _, spot))) = leaves.pop() else {
            return;
        };
        kept[spot] = false;
        for &neighbour in topology.neighbours(spot) {
            if kept[neighbour] {
                degrees[neighbour] -= 1;
                if degrees[neighbour] == 1 && !pinned[neighbour] {
                    leaves.push(Reverse(key(neighbour)));
                }
            }
        }
    }
}

fn peel_general(
    topology: &Topology,
    kept: &mut [bool],
    pinned: &[bool],
    excess: usize,
    key: impl Fn(usize) -> PeelingKey,
) {
    for _ in 0..excess {
        let cut = cut_vertices(topology, kept);
        let next = (0..kept.len())
            .filter(|&spot| kept[spot] && !pinned[spot] && !cut[spot])
            .min_by_key(|&spot| key(spot));
        let Some(spot) = next else {
            return;
        };
        kept[spot] = false;
    }
}

/// Which of the kept nodes would disconnect the others by going (R. Tarjan, "Depth-first search and linear graph
/// algorithms", SIAM Journal on Computing 1, 1972, without recursion).
fn cut_vertices(topology: &Topology, kept: &[bool]) -> Vec<bool> {
    let node_count = kept.len();
    let mut cut = vec![false; node_count];
    let mut entered = vec![usize::MAX; node_count];
    let mut lowest = vec![usize::MAX; node_count];
    let Some(root) = (0..node_count).find(|&node| kept[node]) else {
        return cut;
    };
    let mut clock = 0;
    let mut root_children = 0;
    // Each entry: a node, the node that it was entered from, and the next neighbour to look at.
    let mut stack = vec![(root, root, 0)];
    entered[root] = clock;
    lowest[root] = clock;
    while let Some((node, parent, next)) = stack.last_mut() {
        let (node, parent) = (*node, *parent);
        if let Some(&neighbour) = topology.neighbours(node).get(*next) {
            *next += 1;
            if !kept[neighbour] || neighbour == parent {
                continue;
            }
            if entered[neighbour] == usize::MAX {
                clock += 1;
                entered[neighbour] = clock;
                lowest[neighbour] = clock;
                stack.push((neighbour, node, 0));
            } else {
                lowest[node] = lowest[node].min(entered[neighbour]);
            }
        } else {
            stack.pop();
            if node == parent {
                continue;
            }
            lowest[parent] = lowest[parent].min(lowest[node]);
            if parent == root {
                root_children += 1;
            } else if lowest[node] >= entered[parent] {
                cut[parent] = true;
            }
        }
    }
    cut[root] = root_children > 1;
    cut
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cut_vertices_are_those_whose_loss_disconnects() {
        let mut edges = vec![
            (0, 1),
            (1, 2),
            (2, 0),
            (2, 3),
            (3, 4),
            (4, 5),
            (5, 3),
            (5, 6),
        ];
        edges.extend([(6, 7), (7, 8), (8, 9), (9, 6), (0, 10)]);
        let graph = Topology::new(11, &edges).unwrap();
        for missing in [None, Some(10), Some(1)] {
            let kept: Vec<bool> = (0..11).map(|node| Some(node) != missing).collect();
            let cut = cut_vertices(&graph, &kept);
            for node in (0..11).filter(|&node| kept[node]) {
                let components = graph.components_within(|other| kept[other] && other != node);
                assert_eq!(
                    cut[node],
                    components.len() > 1,
                    "node {node} without {missing:?}"
                );
            }
        }
    }
}
