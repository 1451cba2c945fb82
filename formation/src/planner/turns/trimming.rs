//! Which spots to leave out when there are fewer modules than spots.
//!
//! Filling the spots of greatest utility would leave disconnected pieces that cannot be assembled. So the target is
//! peeled from its rim, one spot at a time, until as many spots are left as there are modules; what a dry run of the
//! allocation left free or gave to singletons goes first, so that configurations keep the places that fit them.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::model::{MicroUnits, Topology};
use crate::planner::assignment::Instance;

/// What goes first: unfilled spots, then those held by the smallest unit, then the least valuable, then the lowest.
type PeelingKey = (usize, MicroUnits, usize);

/// What is left of a target for which there are too few modules; all spots ascend.
#[derive(Clone, Debug)]
pub(crate) struct Trimmed {
    /// The connected part that is formed.
    pub(crate) kept: Vec<usize>,
    /// The spots of that part that must stay open. There are none unless settled modules stand so far apart that
    /// there are too few others to join them; then every filled spot still hangs together with a settled module.
    pub(crate) closed: Vec<usize>,
}

/// Chooses as many spots of the instance's target as there are modules.
///
/// `holding_sizes` tells for each spot how many modules the unit has that holds it in the dry run; 0 for a free one.
/// Pinned spots always stay.
pub(crate) fn trim(instance: &Instance, holding_sizes: &[usize]) -> Trimmed {
    let target = &instance.target;
    let topology = target.topology();
    let module_count = instance.problem.modules().len();
    let pins: Vec<usize> = instance
        .problem
        .modules()
        .iter()
        .filter_map(|module| target.position_of(module.pin?))
        .collect();
    let key =
        |spot: usize| -> PeelingKey { (holding_sizes[spot], instance.utilities.value(spot), spot) };
    let joined = joined_by_short_paths(topology, &pins);
    let joined_count = joined.iter().filter(|&&stays| stays).count();
    let excess = topology
        .node_count()
        .saturating_sub(module_count.max(joined_count));
    let mut kept = vec![true; topology.node_count()];
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
    let positions = |chosen: &dyn Fn(usize) -> bool| -> Vec<usize> {
        (0..kept.len()).filter(|&spot| chosen(spot)).collect()
    };
    Trimmed {
        kept: positions(&|spot| kept[spot]),
        closed: positions(&|spot| kept[spot] && !filled[spot]),
    }
}

/// The pinned spots and short paths that join them: from the first pin on, always to the pin nearest what is joined
/// already (H. Takahashi and A. Matsuyama, "An approximate solution for the Steiner problem in graphs", Mathematica
/// Japonica 24, 1980). On a tree there is only one way.
fn joined_by_short_paths(topology: &Topology, pins: &[usize]) -> Vec<bool> {
    let node_count = topology.node_count();
    let mut joined = vec![false; node_count];
    let Some(&first) = pins.first() else {
        return joined;
    };
    joined[first] = true;
    let is_pin: Vec<bool> = {
        let mut is_pin = vec![false; node_count];
        for &pin in pins {
            is_pin[pin] = true;
        }
        is_pin
    };
    loop {
        let mut reached_from: Vec<Option<usize>> = (0..node_count)
            .map(|node| joined[node].then_some(node))
            .collect();
        let mut order: Vec<usize> = (0..node_count).filter(|&node| joined[node]).collect();
        let mut next = 0;
        let mut nearest_pin = None;
        while let Some(&node) = order.get(next) {
            if is_pin[node] && !joined[node] {
                nearest_pin = Some(node);
                break;
            }
            for &neighbour in topology.neighbours(node) {
                if reached_from[neighbour].is_none() {
                    reached_from[neighbour] = Some(node);
                    order.push(neighbour);
                }
            }
            next += 1;
        }
        let Some(mut node) = nearest_pin else {
            return joined;
        };
        while !joined[node] {
            joined[node] = true;
            node = reached_from[node].unwrap_or(node);
        }
    }
}

/// That many of the kept spots: the pinned ones, and always the best spot beside those chosen already.
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
        let best = (0..kept.len())
            .filter(|&spot| kept[spot] && !chosen[spot])
            .filter(|&spot| {
                topology
                    .neighbours(spot)
                    .iter()
                    .any(|&beside| chosen[beside])
            })
            .max_by_key(|&spot| key(spot));
        let Some(spot) = best else {
            break;
        };
        chosen[spot] = true;
    }
    chosen
}

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

fn peel_general(
    topology: &Topology,
    kept: &mut [bool],
    stays: &[bool],
    excess: usize,
    key: impl Fn(usize) -> PeelingKey,
) {
    for _ in 0..excess {
        let cut = cut_vertices(topology, kept);
        let next = (0..kept.len())
            .filter(|&spot| kept[spot] && !stays[spot] && !cut[spot])
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

    fn as_positions(chosen: &[bool]) -> Vec<usize> {
        (0..chosen.len()).filter(|&node| chosen[node]).collect()
    }

    #[test]
    fn pins_are_joined_by_the_shorter_way_round_a_ring() {
        let edges: Vec<(usize, usize)> = (0..10).map(|node| (node, (node + 1) % 10)).collect();
        let ring = Topology::new(10, &edges).unwrap();
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
        let ring = Topology::new(10, &edges).unwrap();
        let path = Topology::new(10, &edges[..9]).unwrap();
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
        let path = Topology::new(10, &edges).unwrap();
        let key = |spot: usize| (0, MicroUnits::ZERO, spot);
        let chosen = grown_from(&path, &[0, 7], &[true; 10], 4, key);
        assert_eq!(as_positions(&chosen), [0, 7, 8, 9]);
    }

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
