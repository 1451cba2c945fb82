//! Breadth-first layers over the units, the base of every acting order.

use std::cmp::Reverse;
use std::collections::VecDeque;

use super::Ground;

/// A breadth-first order of the filled spots and the spanning forest that it leaves.
pub(super) struct BreadthFirst {
    /// The filled spots, pinned ones first, the spots of a unit one after another.
    pub sequence: Vec<usize>,
    /// Where each filled spot stands in the sequence.
    pub rank_of: Vec<usize>,
    /// The placed neighbour beside which each spot is filled; none for pinned spots and roots.
    pub parent_of: Vec<Option<usize>>,
    /// Where the order begins, and begins anew: spots that stand beside no placed one.
    pub roots: Vec<usize>,
    /// Whether the forest holds every edge between filled spots, those between two pinned ones aside. If so, with the
    /// pinned ones taken together as one root, there is no cycle.
    pub spans_every_edge: bool,
}

impl BreadthFirst {
    /// Begins at the pinned spots; without any, or where they do not reach, at the spot of greatest value among those
    /// left (the lower one of equals). Layers are counted in units; within one, spots go breadth-first too.
    pub fn of(ground: &Ground) -> Self {
        let count = ground.unit_of.len();
        let mut walk = Walk {
            ground,
            placed: vec![false; count],
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
        by_value.sort_by_key(|&spot| (Reverse(ground.value(spot)), spot));
        walk.place_pinned(&by_value);
        walk.spread();
        for &spot in &by_value {
            if !walk.placed[spot] {
                walk.place_unit(spot, None);
                walk.spread();
            }
        }
        let mut result = walk.result;
        for (rank, &spot) in result.sequence.iter().enumerate() {
            result.rank_of[spot] = rank;
        }
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
    placed: Vec<bool>,
    /// Placed spots whose neighbours have not been looked at.
    frontier: VecDeque<usize>,
    result: BreadthFirst,
}

impl Walk<'_> {
    fn place(&mut self, spot: usize, parent: Option<usize>) {
        self.placed[spot] = true;
        self.result.parent_of[spot] = parent;
        self.result.sequence.push(spot);
        self.frontier.push_back(spot);
    }

    /// Lists the pinned spots, breadth-first among themselves.
    fn place_pinned(&mut self, by_value: &[usize]) {
        let ground = self.ground;
        for &start in by_value {
            if !ground.pinned[start] || self.placed[start] {
                continue;
            }
            let mut next = self.result.sequence.len();
            self.place(start, None);
            while let Some(&spot) = self.result.sequence.get(next) {
                for neighbour in ground.neighbours(spot) {
                    if ground.pinned[neighbour] && !self.placed[neighbour] {
                        self.place(neighbour, None);
                    }
                }
                next += 1;
            }
        }
    }

    fn spread(&mut self) {
        let ground = self.ground;
        while let Some(spot) = self.frontier.pop_front() {
            for neighbour in ground.neighbours(spot) {
                if !self.placed[neighbour] {
                    self.place_unit(neighbour, Some(spot));
                }
            }
        }
    }

    /// Lists a whole unit from the spot by which it was reached.
    fn place_unit(&mut self, entry: usize, parent: Option<usize>) {
        let ground = self.ground;
        let Some(unit) = ground.unit_of[entry] else {
            return;
        };
        let (mut entry, mut parent) = (entry, parent);
        loop {
            if parent.is_none() {
                self.result.roots.push(entry);
            }
            let mut next = self.result.sequence.len();
            self.place(entry, parent);
            while let Some(&spot) = self.result.sequence.get(next) {
                for neighbour in ground.neighbours(spot) {
                    if !self.placed[neighbour] && ground.unit_of[neighbour] == Some(unit) {
                        self.place(neighbour, Some(spot));
                    }
                }
                next += 1;
            }
            // The spots of a block are connected, so this finds none unless a plan came from elsewhere.
            let mut rest = ground.units[unit]
                .iter()
                .copied()
                .filter(|&spot| !self.placed[spot])
                .map(|spot| {
                    let beside = ground.neighbours(spot).find(|&other| self.placed[other]);
                    (beside.is_none(), spot, beside)
                });
            let Some(first) = rest.next() else { return };
            let (_, spot, beside) = rest.fold(first, |best, other| best.min(other));
            (entry, parent) = (spot, beside);
        }
    }
}
