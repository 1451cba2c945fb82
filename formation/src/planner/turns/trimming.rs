//! The spots to leave out when there are fewer modules than spots.
//!
//! Filling the spots of greatest utility would leave disconnected pieces that cannot be assembled. So the target is peeled
//! from its rim, one spot at a time, until as many spots are left as there are modules. Spots that a dry run of the
//! allocation leaves free or gives to singletons go first, so that configurations keep the places that fit them.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::model::{MicroUnits, Topology};
use crate::planner::assignment::Instance;
use crate::planner::cut_nodes::cut_nodes;

/// The key by which spots are left out, lowest first: the size of the unit that holds the spot, its value, its position.
type PeelingKey = (usize, MicroUnits, usize);

/// The rest of a target for which there are too few modules; all spots ascend.
#[derive(Clone, Debug)]
pub(super) struct Trimmed {
    /// The connected part that is formed.
    pub(super) kept: Vec<usize>,
    /// The spots of that part that stay empty. There are none unless the modules are too few to join the pinned ones; then
    /// every filled spot is still connected to a pinned one by filled spots.
    pub(super) closed: Vec<usize>,
}

/// Chooses as many spots of the instance's target as there are modules. Pinned spots always stay.
///
/// `holding_sizes` has, for each spot, the number of modules of the unit that holds it in the dry run; 0 for a free spot.
pub(super) fn trim(instance: &Instance, holding_sizes: &[usize]) -> Trimmed {
    let target = &instance.target;
    let topology = target.topology();
    let module_count = instance.module_count();
    let modules = instance.problem.modules().iter();
    let pins: Vec<usize> = modules
        .filter_map(|module| target.position_of(module.pin?))
        .collect();
    let key =
        |spot: usize| -> PeelingKey { (holding_sizes[spot], instance.utilities.value(spot), spot) };
    let joined = joined_by_short_paths(topology, &pins);
    let joined_count = joined.iter().filter(|&&stays| stays).count();
    let spot_count = topology.node_count();
    let excess = spot_count.saturating_sub(module_count.max(joined_count));
    let mut kept = vec![true; spot_count];
    if instance.target_is_tree {
        peel_leaves(topology, &mut kept, &joined, excess, key);
    } else {
        peel_general(topology, &mut kept, &joined, excess, key);
    }
    let filled = if joined_count > module_count {
        grown_from(topology, &pins, &kept, module_count, key)
    } else {
        kept.clone()
    };
    let kept: Vec<usize> = (0..spot_count).filter(|&spot| kept[spot]).collect();
    let closed = kept.iter().copied().filter(|&spot| !filled[spot]);
    Trimmed {
        closed: closed.collect(),
        kept,
    }
}

/// The pinned spots and short paths that join them: from the first pin on, always to the pin nearest to those joined so far
/// (H. Takahashi and A. Matsuyama, "An approximate solution for the Steiner problem in graphs", Mathematica Japonica 24,
/// 1980). On a tree the paths are unique.
fn joined_by_short_paths(topology: &Topology, pins: &[usize]) -> Vec<bool> {
    let node_count = topology.node_count();
    let mut joined = vec![false; node_count];
    let Some(&first) = pins.first() else {
        return joined;
    };
    joined[first] = true;
    let mut is_pin = vec![false; node_count];
    for &pin in pins {
        is_pin[pin] = true;
    }
    loop {
        // Breadth-first from all joined nodes.
        let mut order: Vec<usize> = (0..node_count).filter(|&node| joined[node]).collect();
        let mut reached_from: Vec<Option<usize>> = (0..node_count)
            .map(|node| joined[node].then_some(node))
            .collect();
        let mut next = 0;
        let nearest_pin = loop {
            let Some(&node) = order.get(next) else {
                return joined;
            };
            if is_pin[node] && !joined[node] {
                break node;
            }
            for &neighbour in topology.neighbours(node) {
                if reached_from[neighbour].is_none() {
                    reached_from[neighbour] = Some(node);
                    order.push(neighbour);
                }
            }
            next += 1;
        };
        let mut path = Some(nearest_pin);
        while let Some(node) = path.filter(|&node| !joined[node]) {
            joined[node] = true;
            path = reached_from[node];
        }
    }
}

/// Chooses `count` of the kept spots: the pinned ones, then always the last spot by `key` that is adjacent to a chosen one.
fn grown_from(
    topology: &Topology,
    pins: &[usize],
    kept: &[bool],
    count: usize,
    key: impl Fn(usize) -> PeelingKey,
) -> Vec<bool> {
    let mut chosen = vec![false; kept.len()];
    for &pin in pins {
        chosen[pin] = true;
    }
    for _ in pins.len()..count {
        let is_adjacent = |spot: usize| topology.neighbours(spot).iter().any(|&one| chosen[one]);
        let best = (0..kept.len())
            .filter(|&spot| kept[spot] && !chosen[spot] && is_adjacent(spot))
            .max_by_key(|&spot| key(spot));
        let Some(spot) = best else {
            break;
        };
        chosen[spot] = true;
    }
    chosen
}

/// Leaves out `excess` spots of a tree, always the first leaf by `key` that need not stay.
fn peel_leaves(
    topology: &Topology,
    kept: &mut [bool],
    stays: &[bool],
    excess: usize,
    key: impl Fn(usize) -> PeelingKey,
) {
    let mut degrees: Vec<usize> = (0..kept.len()).map(|spot| topology.degree(spot)).collect();
    let mut leaves: BinaryHeap<Reverse<PeelingKey>> = (0..kept.len())
        .filter(|&spot| degrees[spot] <= 1 && !stays[spot])
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
                if degrees[neighbour] == 1 && !stays[neighbour] {
                    leaves.push(Reverse(key(neighbour)));
                }
            }
        }
    }
}

/// Leaves out `excess` spots of any graph, always the first by `key` that need not stay and whose removal keeps the rest
/// connected.
fn peel_general(
    topology: &Topology,
    kept: &mut [bool],
    stays: &[bool],
    excess: usize,
    key: impl Fn(usize) -> PeelingKey,
) {
    for _ in 0..excess {
        let neighbour_at =
            |spot: usize, index: usize| topology.neighbours(spot).get(index).copied();
        let is_cut = cut_nodes(kept.len(), |spot| kept[spot], neighbour_at);
        let next = (0..kept.len())
            .filter(|&spot| kept[spot] && !stays[spot] && !is_cut[spot])
            .min_by_key(|&spot| key(spot));
        let Some(spot) = next else {
            return;
        };
        kept[spot] = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn as_positions(chosen: &[bool]) -> Vec<usize> {
        (0..chosen.len()).filter(|&node| chosen[node]).collect()
    }

    #[test]
    fn pins_are_joined_by_the_shorter_path_round_a_ring() {
        let edges: Vec<(usize, usize)> = (0..10).map(|node| (node, (node + 1) % 10)).collect();
        let ring = Topology::new(10, &edges);
        assert_eq!(
            as_positions(&joined_by_short_paths(&ring, &[])),
            Vec::<usize>::new()
        );
        assert_eq!(
            as_positions(&joined_by_short_paths(&ring, &[1, 8])),
            [0, 1, 8, 9]
        );
        assert_eq!(
            as_positions(&joined_by_short_paths(&ring, &[3, 0, 6])),
            [0, 1, 2, 3, 4, 5, 6]
        );
    }

    #[test]
    fn what_must_stay_is_never_peeled() {
        let edges: Vec<(usize, usize)> = (0..10).map(|node| (node, (node + 1) % 10)).collect();
        let ring = Topology::new(10, &edges);
        let path = Topology::new(10, &edges[..9]);
        let stays: Vec<bool> = (0..10).map(|node| (3..6).contains(&node)).collect();
        let key = |spot: usize| (0, MicroUnits::ZERO, spot);
        for excess in 0..8 {
            for (graph, is_tree) in [(&ring, false), (&path, true), (&path, false)] {
                let mut kept = vec![true; 10];
                if is_tree {
                    peel_leaves(graph, &mut kept, &stays, excess, key);
                } else {
                    peel_general(graph, &mut kept, &stays, excess, key);
                }
                assert_eq!(as_positions(&kept).len(), 10 - excess);
                assert!(kept[3] && kept[4] && kept[5]);
                assert_eq!(graph.components_within(|node| kept[node]).len(), 1);
            }
        }
    }

    #[test]
    fn what_grows_from_pins_hangs_on_them() {
        let edges: Vec<(usize, usize)> = (0..9).map(|node| (node, node + 1)).collect();
        let path = Topology::new(10, &edges);
        let key = |spot: usize| (0, MicroUnits::ZERO, spot);
        let chosen = grown_from(&path, &[0, 7], &[true; 10], 4, key);
        assert_eq!(as_positions(&chosen), [0, 7, 8, 9]);
    }
}
