//! Taking a formation apart along its breadth-first spanning forest, unit by unit.

use std::collections::BinaryHeap;

use super::breadth_first::BreadthFirst;
use super::corridor::Corridors;
use super::ground::{Ground, Root};

/// An order in which the spots that are not pinned can be vacated, each with a corridor and with the rest of the spanning
/// forest connected; `None` if some spots remain that cannot be vacated.
///
/// Of the units that can be vacated, the one latest in breadth-first order goes first, and within a block the spot latest in
/// that order. A unit that can be vacated now can still be vacated after others: a leaf stays a leaf, and corridors only
/// widen. So any maximal sequence ends with the same spots, and where the forest holds every edge
/// ([`BreadthFirst::spans_every_edge`]), `None` means that there is no order with this kind of root.
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
            // It is tried again when the state next to it changes.
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
    adjacent: Vec<Vec<usize>>,
    /// The number of them that are left; one more for a root that goes last.
    degree: Vec<usize>,
    is_left: Vec<bool>,
    /// The vacated spots, in this order.
    removed: Vec<usize>,
}

impl<'a> Peeling<'a> {
    fn new(ground: &'a Ground, base: &'a BreadthFirst, corridors: Corridors, root: Root) -> Self {
        let count = ground.unit_of.len();
        let mut adjacent = vec![Vec::new(); count];
        for (spot, parent) in base.parent_of.iter().enumerate() {
            if let Some(parent) = *parent {
                adjacent[spot].push(parent);
                adjacent[parent].push(spot);
            }
        }
        let mut degree: Vec<usize> = adjacent.iter().map(Vec::len).collect();
        if root == Root::Centre {
            for &spot in &base.roots {
                degree[spot] += 1;
            }
        }
        Self {
            ground,
            base,
            corridors,
            adjacent,
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

    fn can_be_vacated(&self, spot: usize) -> bool {
        self.is_left[spot] && self.degree[spot] <= 1 && self.corridors.reaches(spot)
    }

    fn remove(&mut self, spot: usize) {
        self.is_left[spot] = false;
        self.corridors.vacate(spot);
        for &neighbour in &self.adjacent[spot] {
            self.degree[neighbour] -= 1;
        }
        self.removed.push(spot);
    }

    /// The spots whose degree or corridor changed since a time, given by the corridors' mark and the number of spots removed.
    fn changed_since(&self, mark: usize, removed: usize) -> Vec<usize> {
        let mut changed: Vec<usize> = self.removed[removed..]
            .iter()
            .flat_map(|&spot| self.adjacent[spot].iter().copied())
            .chain(self.corridors.spots_next_to_opened_since(mark))
            .filter(|&spot| self.is_left[spot])
            .collect();
        changed.sort_unstable();
        changed.dedup();
        changed
    }

    /// Removes a whole unit, or nothing. Returns whether it was removed.
    fn try_unit(&mut self, unit: usize) -> bool {
        let ground = self.ground;
        let spots = &ground.units[unit];
        let before = self.removed.len();
        let mut marks = Vec::new();
        let mut waiting: BinaryHeap<(usize, usize)> = spots
            .iter()
            .filter(|&&spot| self.can_be_vacated(spot))
            .map(|&spot| (self.base.rank_of[spot], spot))
            .collect();
        while let Some((_, spot)) = waiting.pop() {
            if !self.can_be_vacated(spot) {
                continue;
            }
            let mark = self.corridors.mark();
            marks.push(mark);
            self.remove(spot);
            if spots.len() > 1 {
                for other in self.changed_since(mark, self.removed.len() - 1) {
                    if ground.unit_of[other] == Some(unit) && self.can_be_vacated(other) {
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
            for &neighbour in &self.adjacent[spot] {
                self.degree[neighbour] += 1;
            }
            self.corridors.undo(spot, mark);
        }
        false
    }
}
