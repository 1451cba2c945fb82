//! Taking a formation apart where it has cycles: which spots may go depends on which went before, so this searches.

use std::collections::BTreeSet;

use super::breadth_first::BreadthFirst;
use super::corridor::Corridors;
use super::{Ground, Root};

/// How many spots the search may look at in all. A time limit would let replicas differ.
pub(super) const SEARCH_STEPS_MAX: u64 = 20_000_000;

pub(super) enum Outcome {
    /// The spots that are not pinned, in the order in which they can be vacated.
    Found(Vec<usize>),
    /// There is no such order.
    None,
    /// The search was cut before it was sure.
    BudgetSpent,
}

/// Looks for an order in which every spot that is not pinned can be vacated, each with a corridor, with the rest of
/// its component connected (or each part of it to a pinned spot), and each unit's spots one after another.
///
/// Depth first with backtracking; the spot latest in breadth-first order is tried first. Sets of spots that failed
/// are not entered again. A spot with at most one neighbour left that can go without opening a block goes without
/// an alternative: whatever order exists, it may as well begin with that spot.
pub(super) fn search(
    ground: &Ground,
    base: &BreadthFirst,
    corridors: Corridors,
    root: Root,
    steps_max: u64,
) -> Outcome {
    let mut search = Search::new(ground, base, corridors, root);
    let mut frames: Vec<Frame> = Vec::new();
    let mut seen: BTreeSet<Vec<u64>> = BTreeSet::new();
    let mut steps: u64 = 0;
    // Only spots ranked below are tried at the top frame; the others have been.
    let mut below = usize::MAX;
    while search.count_left > 0 {
        steps += search.step_cost;
        if steps > steps_max {
            return Outcome::BudgetSpent;
        }
        let candidates = search.candidates();
        let is_new = |spot: &usize| !seen.contains(&search.left_without(*spot));
        let forced = candidates
            .iter()
            .copied()
            .find(|&spot| search.is_pendant(spot));
        let choice = match forced {
            Some(spot) => (below == usize::MAX).then_some(spot).filter(is_new),
            None => candidates
                .into_iter()
                .filter(|&spot| base.rank_of[spot] < below)
                .find(is_new),
        };
        if let Some(spot) = choice {
            frames.push(Frame {
                spot,
                mark: search.corridors.mark(),
                unit_before: search.open_unit,
            });
            search.remove(spot);
            seen.insert(search.left.clone());
            below = usize::MAX;
        } else if let Some(frame) = frames.pop() {
            search.restore(&frame);
            below = base.rank_of[frame.spot];
        } else {
            return Outcome::None;
        }
    }
    Outcome::Found(frames.into_iter().map(|frame| frame.spot).collect())
}

/// One spot that was vacated, and what is needed to undo it.
struct Frame {
    spot: usize,
    mark: usize,
    unit_before: Option<usize>,
}

struct Search<'a> {
    ground: &'a Ground<'a>,
    base: &'a BreadthFirst,
    corridors: Corridors,
    /// Stands for all pinned spots and for the roots that stay to the last: it is joined to them and never goes.
    is_anchored: Vec<bool>,
    anchored: Vec<usize>,
    /// A bit for each spot that is still filled.
    left: Vec<u64>,
    /// How many spots are left of each unit, and in all; pinned ones are not counted.
    left_of_unit: Vec<usize>,
    count_left: usize,
    /// The block of which some spots, but not all, went: it has to go on.
    open_unit: Option<usize>,
    /// What one look at all spots costs.
    step_cost: u64,
}

impl<'a> Search<'a> {
    fn new(ground: &'a Ground, base: &'a BreadthFirst, corridors: Corridors, root: Root) -> Self {
        let count = ground.unit_of.len();
        let mut left = vec![0; count.div_ceil(64)];
        let mut is_anchored = ground.pinned.clone();
        if root == Root::Centre {
            for &spot in &base.roots {
                is_anchored[spot] = true;
            }
        }
        for &spot in &base.sequence {
            left[spot / 64] |= 1 << (spot % 64);
        }
        let is_free = |spots: &&Vec<usize>| !ground.pinned[spots[0]];
        Self {
            ground,
            base,
            corridors,
            anchored: (0..count).filter(|&spot| is_anchored[spot]).collect(),
            is_anchored,
            left,
            left_of_unit: ground.units.iter().map(Vec::len).collect(),
            count_left: ground.units.iter().filter(is_free).map(Vec::len).sum(),
            open_unit: None,
            step_cost: base.sequence.len() as u64,
        }
    }

    fn is_left(&self, spot: usize) -> bool {
        self.left[spot / 64] & (1 << (spot % 64)) != 0
    }

    fn left_without(&self, spot: usize) -> Vec<u64> {
        let mut left = self.left.clone();
        left[spot / 64] &= !(1 << (spot % 64));
        left
    }

    fn remove(&mut self, spot: usize) {
        self.left[spot / 64] &= !(1 << (spot % 64));
        self.count_left -= 1;
        self.corridors.vacate(spot);
        if let Some(unit) = self.ground.unit_of[spot] {
            self.left_of_unit[unit] -= 1;
            self.open_unit = (self.left_of_unit[unit] > 0).then_some(unit);
        }
    }

    fn restore(&mut self, frame: &Frame) {
        self.left[frame.spot / 64] |= 1 << (frame.spot % 64);
        self.count_left += 1;
        self.corridors.undo(frame.spot, frame.mark);
        if let Some(unit) = self.ground.unit_of[frame.spot] {
            self.left_of_unit[unit] += 1;
        }
        self.open_unit = frame.unit_before;
    }

    /// Whether a spot that can go has at most one neighbour left and is alone in its unit, or in the open one.
    fn is_pendant(&self, spot: usize) -> bool {
        let unit = self.ground.unit_of[spot];
        let single = unit.is_some_and(|unit| self.ground.units[unit].len() == 1);
        let neighbours = self
            .ground
            .neighbours(spot)
            .filter(|&other| self.is_left(other));
        (single || (unit.is_some() && unit == self.open_unit))
            && neighbours.count() + usize::from(self.is_anchored[spot]) <= 1
    }

    /// The spots that can go now, latest in breadth-first order first.
    fn candidates(&self) -> Vec<usize> {
        let parting = self.cut_spots();
        self.base
            .sequence
            .iter()
            .rev()
            .copied()
            .filter(|&spot| {
                self.is_left(spot)
                    && !self.ground.pinned[spot]
                    && (self.open_unit.is_none() || self.open_unit == self.ground.unit_of[spot])
                    && !parting[spot]
                    && self.corridors.reaches(spot)
            })
            .collect()
    }

    /// Which spots would part the rest if they went: the articulation points (Tarjan 1972) of what is left,
    /// with the anchor as one more node. Without recursion, for the depth grows with the target.
    fn cut_spots(&self) -> Vec<bool> {
        let anchor = self.ground.unit_of.len();
        let mut cut = vec![false; anchor + 1];
        // 0 is "not seen"; numbers begin at 1.
        let mut number = vec![0_usize; anchor + 1];
        let mut lowest = vec![0_usize; anchor + 1];
        let mut next_number = 1;
        let starts = std::iter::once(anchor).chain(self.base.sequence.iter().copied());
        for start in starts {
            if number[start] != 0 || (start != anchor && !self.is_left(start)) {
                continue;
            }
            number[start] = next_number;
            lowest[start] = next_number;
            next_number += 1;
            let mut children_of_start = 0;
            // Node, its parent, and how many of its neighbours have been looked at.
            let mut stack = vec![(start, usize::MAX, 0_usize)];
            while let Some(&mut (node, parent, ref mut looked_at)) = stack.last_mut() {
                let neighbour = self.neighbour_at(node, *looked_at);
                *looked_at += 1;
                match neighbour {
                    Some(other) if other == parent => {}
                    Some(other) if other != anchor && !self.is_left(other) => {}
                    Some(other) if number[other] != 0 => {
                        lowest[node] = lowest[node].min(number[other]);
                    }
                    Some(other) => {
                        number[other] = next_number;
                        lowest[other] = next_number;
                        next_number += 1;
                        stack.push((other, node, 0));
                    }
                    None => {
                        stack.pop();
                        if parent == usize::MAX {
                            continue;
                        }
                        lowest[parent] = lowest[parent].min(lowest[node]);
                        if parent == start {
                            children_of_start += 1;
                        } else if lowest[node] >= number[parent] {
                            cut[parent] = true;
                        }
                    }
                }
            }
            cut[start] = children_of_start > 1;
        }
        cut
    }

    /// The neighbours of a node one by one, left or not: the anchored spots of the anchor, else those in the target
    /// and the anchor last.
    fn neighbour_at(&self, node: usize, index: usize) -> Option<usize> {
        let anchor = self.ground.unit_of.len();
        if node == anchor {
            return self.anchored.get(index).copied();
        }
        let neighbours = self.ground.topology.neighbours(node);
        match neighbours.get(index) {
            Some(&neighbour) => Some(neighbour),
            None if index == neighbours.len() && self.is_anchored[node] => Some(anchor),
            None => None,
        }
    }
}
