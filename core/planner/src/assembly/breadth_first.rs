//! Breadth-first layers over the units, the base of every acting order.

use std::cmp::Reverse;
use std::collections::VecDeque;

use super::ground::Ground;

/// A breadth-first order of the filled spots, and its spanning forest.
pub(super) struct BreadthFirst {
    /// The filled spots, pinned ones first, the spots of a unit one after another.
    pub(super) sequence: Vec<usize>,
    /// The position of each filled spot in the sequence.
    pub(super) rank_of: Vec<usize>,
    /// The earlier neighbour from which each spot was reached; `None` for pinned spots and roots.
    pub(super) parent_of: Vec<Option<usize>>,
    /// The spots at which the order starts and restarts: those without an earlier neighbour.
    pub(super) roots: Vec<usize>,
    /// Whether the forest holds every edge between filled spots, except those between two pinned ones. If so, and with all
    /// pinned spots as one root, there is no cycle.
    pub(super) spans_every_edge: bool,
}

/// The order of the spots within a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Within {
    /// As the layer before reaches them, its neighbours in ascending order.
    Reached,
    /// Greater values first, then lower spots.
    Value,
}

impl BreadthFirst {
    /// Starts at the pinned spots; without any, or where they do not reach, at the spot of greatest value among those
    /// left (the lowest of equals). Layers are counted in units; within a unit the spots are in breadth-first order too.
    pub(super) fn of(ground: &Ground, within: Within) -> Self {
        let count = ground.unit_of.len();
        let mut walk = Walk {
            ground,
            frontier: VecDeque::new(),
            result: Self {
                sequence: Vec::with_capacity(count),
                rank_of: vec![usize::MAX; count],
                parent_of: vec![None; count],
                roots: Vec::new(),
                spans_every_edge: false,
            },
        };
        let mut by_value: Vec<usize> = (0..count).filter(|&spot| ground.is_filled(spot)).collect();
        by_value.sort_by_key(|&spot| (Reverse(ground.values[spot]), spot));
        for &spot in by_value.iter().filter(|&&spot| ground.pinned[spot]) {
            walk.place_group(spot, None, |other| ground.pinned[other]);
        }
        walk.spread(within);
        for &spot in &by_value {
            if !walk.is_placed(spot) {
                walk.result.roots.push(spot);
                walk.place_unit(spot, None);
                walk.spread(within);
            }
        }
        let mut result = walk.result;
        let edges = ground.topology.edges().iter().filter(|&&(first, second)| {
            ground.is_filled(first)
                && ground.is_filled(second)
                && !(ground.pinned[first] && ground.pinned[second])
        });
        result.spans_every_edge = edges.count() == result.parent_of.iter().flatten().count();
        result
    }
}

struct Walk<'a> {
    ground: &'a Ground<'a>,
    /// Placed spots whose neighbours have not been looked at.
    frontier: VecDeque<usize>,
    result: BreadthFirst,
}

impl Walk<'_> {
    fn is_placed(&self, spot: usize) -> bool {
        self.result.rank_of[spot] != usize::MAX
    }

    /// Lists a spot, unless it is listed already, and breadth-first all spots of its group that it reaches within the group.
    fn place_group(
        &mut self,
        start: usize,
        parent: Option<usize>,
        is_in_group: impl Fn(usize) -> bool,
    ) {
        let ground = self.ground;
        let mut next = self.result.sequence.len();
        self.place(start, parent);
        while let Some(&spot) = self.result.sequence.get(next) {
            for neighbour in ground.neighbours(spot) {
                if is_in_group(neighbour) {
                    self.place(neighbour, Some(spot));
                }
            }
            next += 1;
        }
    }

    fn place(&mut self, spot: usize, parent: Option<usize>) {
        if self.is_placed(spot) {
            return;
        }
        let result = &mut self.result;
        result.rank_of[spot] = result.sequence.len();
        result.parent_of[spot] = parent.filter(|_| !self.ground.pinned[spot]);
        result.sequence.push(spot);
        self.frontier.push_back(spot);
    }

    /// Lists the units adjacent to the frontier, layer by layer.
    fn spread(&mut self, within: Within) {
        let ground = self.ground;
        while within == Within::Value && !self.frontier.is_empty() {
            self.spread_one_layer_by_value();
        }
        while let Some(spot) = self.frontier.pop_front() {
            for neighbour in ground.neighbours(spot) {
                if !self.is_placed(neighbour) {
                    self.place_unit(neighbour, Some(spot));
                }
            }
        }
    }

    /// Lists the units adjacent to all spots of the frontier, by value of the spots at which they are reached.
    fn spread_one_layer_by_value(&mut self) {
        let ground = self.ground;
        let layer = std::mem::take(&mut self.frontier);
        let mut reached: Vec<(usize, usize)> = Vec::new();
        for spot in layer {
            let neighbours = ground.neighbours(spot);
            reached.extend(neighbours.map(|neighbour| (neighbour, spot)));
        }
        reached.sort_by_key(|&(spot, _)| (Reverse(ground.values[spot]), spot));
        for (spot, from) in reached {
            if !self.is_placed(spot) {
                self.place_unit(spot, Some(from));
            }
        }
    }

    /// Lists a unit from the spot at which it was reached. The spots of a block are connected.
    fn place_unit(&mut self, entry: usize, parent: Option<usize>) {
        let unit_of = &self.ground.unit_of;
        let unit = unit_of[entry];
        self.place_group(entry, parent, |spot| unit_of[spot] == unit);
        debug_assert!(
            unit.is_none_or(|unit| self.ground.units[unit]
                .iter()
                .all(|&one| self.is_placed(one))),
            "a block is not connected"
        );
    }
}
