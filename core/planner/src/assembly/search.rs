//! Taking a formation with cycles apart: the spots that can be vacated depend on those vacated before, so this searches.

use std::collections::BTreeSet;

use fixedbitset::FixedBitSet;

use super::breadth_first::BreadthFirst;
use super::corridor::Corridors;
use super::ground::{Ground, Root};
use formation_model::cut_nodes;

/// The greatest number of spots that a search looks at, repetitions counted. With a time limit, replicas could differ.
pub(super) const SEARCH_STEPS_MAX: u64 = 20_000_000;

/// The search ended at its budget.
pub(super) struct BudgetSpent;

/// Looks for an order in which every spot that is not pinned can be vacated: each with a corridor, with the rest of its
/// component connected (or each part of the rest to a pinned spot), and each unit's spots one after another.
///
/// Depth first with backtracking; the spot latest in breadth-first order is tried first. A set of spots that failed is not
/// entered again. A spot with at most one neighbour left that can be vacated without opening a block has no alternatives: if
/// there is an order, there is one that starts with this spot.
///
/// Returns the spots that are not pinned, in the order in which they are vacated, or `None` if there is no such order.
pub(super) fn search(
    ground: &Ground,
    base: &BreadthFirst,
    corridors: Corridors,
    root: Root,
    steps_max: u64,
) -> Result<Option<Vec<usize>>, BudgetSpent> {
    let mut search = Search::new(ground, base, corridors, root);
    let mut frames: Vec<Frame> = Vec::new();
    // As words, because slices are compared faster than sets.
    let mut seen: BTreeSet<Vec<usize>> = BTreeSet::new();
    let mut steps: u64 = 0;
    // At the top frame, the spots of this rank and above have been tried.
    let mut below = usize::MAX;
    while search.count_left > 0 {
        steps += search.step_cost;
        if steps > steps_max {
            return Err(BudgetSpent);
        }
        let candidates = search.candidates();
        let is_new = |spot: &usize| !seen.contains(search.left_without(*spot).as_slice());
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
            seen.insert(search.left.as_slice().to_vec());
            below = usize::MAX;
        } else if let Some(frame) = frames.pop() {
            search.restore(&frame);
            below = base.rank_of[frame.spot];
        } else {
            return Ok(None);
        }
    }
    Ok(Some(frames.iter().map(|frame| frame.spot).collect()))
}

/// One spot that was vacated, with the data to undo it.
struct Frame {
    spot: usize,
    mark: usize,
    unit_before: Option<usize>,
}

struct Search<'a> {
    ground: &'a Ground<'a>,
    base: &'a BreadthFirst,
    corridors: Corridors,
    /// The pinned spots and the roots that are vacated last. An extra node, the anchor, is joined to them and never removed.
    is_anchored: Vec<bool>,
    anchored: Vec<usize>,
    /// The spots that are still filled.
    left: FixedBitSet,
    /// The number of spots of each unit that are still filled.
    left_of_unit: Vec<usize>,
    /// The number of spots that are still filled and not pinned.
    count_left: usize,
    /// The block of which some spots, but not all, are vacated: it has to be completed next.
    open_unit: Option<usize>,
    /// The number of spots that one step looks at.
    step_cost: u64,
}

impl<'a> Search<'a> {
    fn new(ground: &'a Ground, base: &'a BreadthFirst, corridors: Corridors, root: Root) -> Self {
        let count = ground.unit_of.len();
        let mut is_anchored = ground.pinned.clone();
        if root == Root::Centre {
            for &spot in &base.roots {
                is_anchored[spot] = true;
            }
        }
        let mut left = FixedBitSet::with_capacity(count);
        left.extend(base.sequence.iter().copied());
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

    fn left_without(&self, spot: usize) -> FixedBitSet {
        let mut left = self.left.clone();
        left.remove(spot);
        left
    }

    fn remove(&mut self, spot: usize) {
        self.left.remove(spot);
        self.count_left -= 1;
        self.corridors.vacate(spot);
        if let Some(unit) = self.ground.unit_of[spot] {
            self.left_of_unit[unit] -= 1;
            self.open_unit = (self.left_of_unit[unit] > 0).then_some(unit);
        }
    }

    fn restore(&mut self, frame: &Frame) {
        self.left.insert(frame.spot);
        self.count_left += 1;
        self.corridors.undo(frame.spot, frame.mark);
        if let Some(unit) = self.ground.unit_of[frame.spot] {
            self.left_of_unit[unit] += 1;
        }
        self.open_unit = frame.unit_before;
    }

    /// Whether a spot has at most one neighbour left and is alone in its unit, or in the open one.
    fn is_pendant(&self, spot: usize) -> bool {
        let unit = self.ground.unit_of[spot];
        let single = unit.is_some_and(|unit| self.ground.units[unit].len() == 1);
        let neighbours = self
            .ground
            .neighbours(spot)
            .filter(|&other| self.left.contains(other));
        (single || (unit.is_some() && unit == self.open_unit))
            && neighbours.count() + usize::from(self.is_anchored[spot]) <= 1
    }

    /// The spots that can be vacated now, latest in breadth-first order first.
    fn candidates(&self) -> Vec<usize> {
        let is_cut = self.cut_spots();
        self.base
            .sequence
            .iter()
            .rev()
            .copied()
            .filter(|&spot| {
                self.left.contains(spot)
                    && !self.ground.pinned[spot]
                    && (self.open_unit.is_none() || self.open_unit == self.ground.unit_of[spot])
                    && !is_cut[spot]
                    && self.corridors.reaches(spot)
            })
            .collect()
    }

    /// For each spot, whether the rest would fall apart without it. The anchor is one more node.
    fn cut_spots(&self) -> Vec<bool> {
        let anchor = self.ground.unit_of.len();
        cut_nodes(
            anchor + 1,
            |node| node == anchor || self.left.contains(node),
            |node, index| self.neighbour_at(node, index),
        )
    }

    /// The neighbours of a node by index, vacated or not: for the anchor the anchored spots, for a spot its neighbours in the
    /// target and then, if it is anchored, the anchor.
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
