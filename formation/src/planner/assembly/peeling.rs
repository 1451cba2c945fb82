//! Taking a formation apart along its breadth-first spanning forest, unit by unit.

use std::collections::BinaryHeap;

use super::breadth_first::BreadthFirst;
use super::corridor::Corridors;
use super::{Ground, Root};

/// The order in which the spots that are not pinned can be vacated, each with a corridor and without parting what is
/// left of the spanning forest; none if this ends with spots that cannot go.
///
/// The unit latest in breadth-first order that can go goes first, and within a block the spot latest in that order.
/// What can go now can still go after others went: a leaf stays a leaf and corridors only widen. So any maximal
/// taking apart ends with the same spots, and where the forest holds every edge ([`BreadthFirst::spans_every_edge`])
/// none means that there is no order with this kind of root.
pub(super) fn peel(
    ground: &Ground,
    base: &BreadthFirst,
    corridors: Corridors,
    root: Root,
) -> Option<Vec<usize>> {
    let mut peeling = Peeling::new(ground, base, corridors, root);
    // Units by their latest spot in breadth-first order.
    let mut waiting = BinaryHeap::new();
    let mut is_waiting = vec![false; ground.units.len()];
    let mut left = 0;
    for (unit, spots) in ground.units.iter().enumerate() {
        if !ground.pinned[spots[0]] {
            left += spots.len();
            is_waiting[unit] = true;
            waiting.push((peeling.rank_of_unit(unit), unit));
        }
    }
    while let Some((_, unit)) = waiting.pop() {
        is_waiting[unit] = false;
        let (mark, vacated) = (peeling.corridors.mark(), peeling.removed.len());
        if !peeling.try_unit(unit) {
            // It waits again as soon as something beside it changes.
            continue;
        }
        left -= ground.units[unit].len();
        for spot in peeling.changed_since(mark, vacated) {
            if let Some(unit) = ground.unit_of[spot]
                && !ground.pinned[spot]
                && !is_waiting[unit]
            {
                is_waiting[unit] = true;
                waiting.push((peeling.rank_of_unit(unit), unit));
            }
        }
    }
    (left == 0).then_some(peeling.removed)
}

struct Peeling<'a> {
    ground: &'a Ground<'a>,
    base: &'a BreadthFirst,
    corridors: Corridors,
    /// The neighbours of each spot in the spanning forest.
    beside: Vec<Vec<usize>>,
    /// How many of them are left; a root that has to stay to the last counts one more.
    degree: Vec<usize>,
    is_left: Vec<bool>,
    /// The spots that went, in that order.
    removed: Vec<usize>,
}

impl<'a> Peeling<'a> {
    fn new(ground: &'a Ground, base: &'a BreadthFirst, corridors: Corridors, root: Root) -> Self {
        let count = ground.unit_of.len();
        let mut beside = vec![Vec::new(); count];
        for (spot, parent) in base.parent_of.iter().enumerate() {
            if let Some(parent) = *parent {
                beside[spot].push(parent);
                beside[parent].push(spot);
            }
        }
        let mut degree: Vec<usize> = beside.iter().map(Vec::len).collect();
        if root == Root::Centre {
            for &spot in &base.roots {
                degree[spot] += 1;
            }
        }
        Self {
            ground,
            base,
            corridors,
            beside,
            degree,
            is_left: (0..count).map(|spot| ground.is_filled(spot)).collect(),
            removed: Vec::new(),
        }
    }

    fn rank_of_unit(&self, unit: usize) -> usize {
        let spots = &self.ground.units[unit];
        spots
            .iter()
            .map(|&spot| self.base.rank_of[spot])
            .max()
            .unwrap_or_default()
    }

    fn can_go(&self, spot: usize) -> bool {
        self.is_left[spot] && self.degree[spot] <= 1 && self.corridors.reaches(spot)
    }

    fn remove(&mut self, spot: usize) {
        self.is_left[spot] = false;
        self.corridors.vacate(spot);
        for &neighbour in &self.beside[spot] {
            self.degree[neighbour] -= 1;
        }
        self.removed.push(spot);
    }

    /// The spots for which something changed since a time given by the corridors' mark and the spots removed.
    fn changed_since(&self, mark: usize, removed: usize) -> Vec<usize> {
        let mut changed: Vec<usize> = self.removed[removed..]
            .iter()
            .flat_map(|&spot| self.beside[spot].iter().copied())
            .chain(self.corridors.spots_beside_opened_since(mark))
            .filter(|&spot| self.is_left[spot])
            .collect();
        changed.sort_unstable();
        changed.dedup();
        changed
    }

    /// Removes a unit as a whole, or leaves everything as it was.
    fn try_unit(&mut self, unit: usize) -> bool {
        let ground = self.ground;
        let spots = &ground.units[unit];
        let before = self.removed.len();
        let mut marks = Vec::new();
        let mut waiting: BinaryHeap<(usize, usize)> = spots
            .iter()
            .filter(|&&spot| self.can_go(spot))
            .map(|&spot| (self.base.rank_of[spot], spot))
            .collect();
        while let Some((_, spot)) = waiting.pop() {
            if !self.can_go(spot) {
                continue;
            }
            let mark = self.corridors.mark();
            marks.push(mark);
            self.remove(spot);
            if spots.len() > 1 {
                for other in self.changed_since(mark, self.removed.len() - 1) {
                    if ground.unit_of[other] == Some(unit) && self.can_go(other) {
                        waiting.push((self.base.rank_of[other], other));
                    }
                }
            }
        }
        if self.removed.len() - before == spots.len() {
            return true;
        }
        while let Some(mark) = marks.pop() {
            let Some(spot) = self.removed.pop() else {
                break;
            };
            self.is_left[spot] = true;
            for &neighbour in &self.beside[spot] {
                self.degree[neighbour] += 1;
            }
            self.corridors.undo(spot, mark);
        }
        false
    }
}
