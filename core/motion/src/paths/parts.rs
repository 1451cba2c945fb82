//! The parts into which a unit on its spots divides what is free.

use super::lattice::Site;
use super::schedule::{NO_UNIT, Schedule};
use super::units::Node;

/// No part.
const NONE: usize = 0;

/// The parts of the free cells around a unit that rests on its spots. There are none unless it divides them.
pub(super) struct Parts {
    /// The number of the part of each cell, from 1.
    of_cell: Vec<usize>,
    /// For each part whether it is a pocket within some area, such that units without a spot leave it.
    is_pocket: Vec<bool>,
    /// The cells of all parts, ascending.
    cells: Vec<usize>,
}

impl Parts {
    /// The parts when a unit rests at its goal. Pockets are those within `area` if there are parts that reach beyond it.
    pub fn of(schedule: &Schedule, unit: usize, goal: Node, area: (Site, Site)) -> Self {
        let arena = schedule.arena;
        let mut parts = Self {
            of_cell: vec![NONE; arena.area()],
            is_pocket: vec![false],
            cells: Vec::new(),
        };
        let own: Vec<usize> = schedule.units[unit].cells(arena, goal).collect();
        if let [cell] = own[..]
            && !may_divide(schedule, cell)
        {
            return parts;
        }
        let mut is_shut = schedule.solid.clone();
        for &cell in &own {
            is_shut[cell] = true;
        }
        let (low, high) = area;
        let is_within = |&cell: &usize| {
            let (x, y) = arena.site(cell);
            x >= low.0 && x <= high.0 && y >= low.1 && y <= high.1
        };
        for next in own.iter().flat_map(|&cell| arena.neighbours(cell)) {
            if is_shut[next] {
                continue;
            }
            let part = arena.flood(vec![next], &mut is_shut);
            for &cell in &part {
                parts.of_cell[cell] = parts.is_pocket.len();
            }
            parts.is_pocket.push(part.iter().all(is_within));
            parts.cells.extend(part);
        }
        if parts.is_pocket.len() <= 2 {
            parts.cells.clear();
        }
        if parts.is_pocket[1..].iter().all(|&is_pocket| is_pocket) {
            parts.is_pocket.fill(false);
        }
        parts.cells.sort_unstable();
        parts
    }

    /// The part in which a unit has to be: that of its spots. None if it has none, or they are elsewhere.
    fn side_of(&self, schedule: &Schedule, unit: usize) -> Option<usize> {
        let body = &schedule.units[unit];
        let mut cells = body.cells(schedule.arena, body.goal?);
        cells
            .next()
            .map(|cell| self.of_cell[cell])
            .filter(|&part| part != NONE)
    }

    /// Whether a unit may rest on a cell.
    fn may_rest(&self, side: Option<usize>, cell: usize) -> bool {
        let part = self.of_cell[cell];
        match side {
            Some(side) => part == side || part == NONE,
            None => !self.is_pocket[part],
        }
    }

    /// The first other unit, by cell, that is cut off from its spots.
    pub fn first_cut_off(&self, schedule: &Schedule, unit: usize) -> Option<usize> {
        let is_cut_off = |&(cell, other): &(usize, usize)| {
            other != NO_UNIT
                && other != unit
                && !schedule.solid[cell]
                && !self.may_rest(self.side_of(schedule, other), cell)
        };
        let standing = self
            .cells
            .iter()
            .map(|&cell| (cell, schedule.standing[cell]));
        let mut cut_off = standing.filter(is_cut_off);
        cut_off.next().map(|(_, other)| other)
    }

    /// Bans the cells on which a unit would be cut off from its spots.
    pub fn ban_other_sides(&self, schedule: &Schedule, unit: usize, bans: &mut [bool]) {
        let side = self.side_of(schedule, unit);
        for &cell in &self.cells {
            bans[cell] |= !self.may_rest(side, cell);
        }
    }
}

/// Whether the free ones of a cell's neighbours are not connected by the eight cells around it.
fn may_divide(schedule: &Schedule, cell: usize) -> bool {
    let [right, up, left, down] = schedule.arena.steps;
    let around = [
        right,
        right + up,
        up,
        up + left,
        left,
        left + down,
        down,
        down + right,
    ];
    let is_free = |index: usize| !schedule.solid[cell.wrapping_add_signed(around[index % 8])];
    // A neighbour begins a run of free cells if the next one anticlockwise, or the corner between the two, is not free.
    let begins = |index: &usize| is_free(*index) && !(is_free(index + 1) && is_free(index + 2));
    (0..8).step_by(2).filter(begins).count() > 1
}
