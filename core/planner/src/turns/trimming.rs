//! The spots to leave out when there are fewer modules than spots.
//!
//! Filling the spots of greatest utility would leave disconnected pieces that cannot be assembled. So the target is peeled
//! from its rim, one spot at a time, until as many spots are left as there are modules. Spots that a dry run of the
//! allocation leaves free or gives to singletons go first, so that configurations keep the places that fit them.
//! Enforces P2.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::separators::Separators;
use crate::assignment::Instance;
use formation_model::{MicroUnits, Topology};

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
    let module_count = instance.problem.candidate_count();
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
    let mut is_pin = vec![false; node_count];
    for &pin in pins {
        is_pin[pin] = true;
    }
    // Pins next to joined ones are nearest, and join them without a path.
    let join = |start: usize, joined: &mut [bool]| {
        let mut waiting = vec![start];
        while let Some(node) = waiting.pop() {
            if !std::mem::replace(&mut joined[node], true) {
                let neighbours = topology.neighbours(node).iter().copied();
                waiting.extend(neighbours.filter(|&neighbour| is_pin[neighbour]));
            }
        }
    };
    join(first, &mut joined);
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
            path = reached_from[node];
            join(node, &mut joined);
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
    let mut is_listed = chosen.clone();
    let mut adjacent: BinaryHeap<PeelingKey> = BinaryHeap::new();
    let mut list_around = |spot: usize, adjacent: &mut BinaryHeap<PeelingKey>| {
        for &neighbour in topology.neighbours(spot) {
            if kept[neighbour] && !std::mem::replace(&mut is_listed[neighbour], true) {
                adjacent.push(key(neighbour));
            }
        }
    };
    for &pin in pins {
        list_around(pin, &mut adjacent);
    }
    for _ in pins.len()..count {
        let Some((_, _, spot)) = adjacent.pop() else {
            break;
        };
        chosen[spot] = true;
        list_around(spot, &mut adjacent);
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
    let mut separators = Separators::new(topology);
    // The spots that may go, except those that are known to separate others.
    let mut waiting: BinaryHeap<Reverse<PeelingKey>> = (0..kept.len())
        .filter(|&spot| !stays[spot])
        .map(|spot| Reverse(key(spot)))
        .collect();
    let mut left = excess;
    while left > 0 {
        let Some(Reverse((_, _, spot))) = waiting.pop() else {
            return;
        };
        if separators.is_separator(spot, kept) {
            continue;
        }
        kept[spot] = false;
        left -= 1;
        for freed in separators.remove(spot) {
            waiting.push(Reverse(key(freed)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_generate::Random;
    use formation_model::cut_nodes;

    fn as_positions(chosen: &[bool]) -> Vec<usize> {
        (0..chosen.len()).filter(|&node| chosen[node]).collect()
    }

    /// [`peel_general`] by its definition: all separators after each removal.
    fn peel_by_definition(
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

    /// [`grown_from`] by its definition: all spots are looked at for each that is chosen.
    fn grown_by_definition(
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
            let is_adjacent =
                |spot: usize| topology.neighbours(spot).iter().any(|&one| chosen[one]);
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

    /// [`joined_by_short_paths`] by its definition: a search for each pin.
    fn joined_by_definition(topology: &Topology, pins: &[usize]) -> Vec<bool> {
        let node_count = topology.node_count();
        let mut joined = vec![false; node_count];
        let Some(&first) = pins.first() else {
            return joined;
        };
        joined[first] = true;
        loop {
            let mut order = as_positions(&joined);
            let mut reached_from: Vec<Option<usize>> = (0..node_count)
                .map(|node| joined[node].then_some(node))
                .collect();
            let mut next = 0;
            let nearest_pin = loop {
                let Some(&node) = order.get(next) else {
                    return joined;
                };
                if pins.contains(&node) && !joined[node] {
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

    /// A grid with holes, and paths that hang on it.
    fn drawn(random: &mut Random) -> Topology {
        let below = |random: &mut Random, bound: u64| usize::try_from(random.below(bound)).unwrap();
        let (width, height) = (2 + below(random, 7), 2 + below(random, 7));
        let spot = |x: usize, y: usize| y * width + x;
        let mut edges = Vec::new();
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            if x + 1 < width && random.below(5) > 0 {
                edges.push((spot(x, y), spot(x + 1, y)));
            }
            if y + 1 < height && random.below(5) > 0 {
                edges.push((spot(x, y), spot(x, y + 1)));
            }
        }
        let whole = Topology::new(width * height, &edges);
        let largest = whole.components().into_iter().max_by_key(Vec::len).unwrap();
        let mut edges = whole.induced_by(&largest).edges().to_vec();
        let mut count = largest.len();
        for _ in 0..below(random, 12) {
            edges.push((below(random, count as u64), count));
            count += 1;
        }
        Topology::new(count, &edges)
    }

    #[test]
    fn the_results_are_those_of_the_definitions() {
        let mut random = Random::from_seed(9);
        for round in 0..600 {
            let graph = drawn(&mut random);
            let count = graph.node_count();
            let sizes: Vec<usize> = (0..count)
                .map(|_| usize::try_from(random.below(4)).unwrap())
                .collect();
            let values: Vec<i64> = (0..count)
                .map(|_| i64::try_from(random.below(20)).unwrap())
                .collect();
            let key = |spot: usize| (sizes[spot], MicroUnits(values[spot]), spot);
            let rarity = 1 + random.below(10);
            let pins: Vec<usize> = (0..count).filter(|_| random.below(rarity) == 0).collect();
            let joined = joined_by_short_paths(&graph, &pins);
            assert_eq!(joined, joined_by_definition(&graph, &pins), "round {round}");
            for part in [1, 2, 4] {
                let excess = count - count / part;
                let (mut fast, mut slow) = (vec![true; count], vec![true; count]);
                peel_general(&graph, &mut fast, &joined, excess, key);
                peel_by_definition(&graph, &mut slow, &joined, excess, key);
                assert_eq!(fast, slow, "round {round}");
                let grown = grown_from(&graph, &pins, &fast, count / part, key);
                let definition = grown_by_definition(&graph, &pins, &fast, count / part, key);
                assert_eq!(grown, definition, "round {round}");
            }
        }
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
