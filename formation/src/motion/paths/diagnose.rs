//! Why a unit cannot get to its spots, for people.

use super::field::{Failure, Field, NO_UNIT};
use super::lattice::Arena;
use super::result::Obstruction;
use super::units::Node;
use crate::model::{ModuleId, SpotId};

/// What the message names.
pub(super) struct Names<'a> {
    pub module_of: &'a dyn Fn(usize) -> ModuleId,
    /// The spot on a cell, if there is one.
    pub spot_at: &'a dyn Fn(usize) -> Option<SpotId>,
}

/// The reason for a failure at the time of the failure.
pub(super) fn obstruction(field: &Field, failure: &Failure, names: &Names) -> Obstruction {
    let unit = &field.units[failure.unit];
    let start = field.cells(failure.unit);
    let goal: Vec<usize> = unit.goal.map_or_else(Vec::new, |goal: Node| {
        unit.cells(field.arena, goal).collect()
    });
    let Some(other) = failure.in_the_way else {
        let near_start = region(field.arena, &field.solid, &start);
        let near_goal = region(field.arena, &field.solid, &goal);
        let smaller = if near_start.len() < near_goal.len() {
            near_start
        } else {
            near_goal
        };
        let mut walls: Vec<SpotId> = smaller
            .iter()
            .flat_map(|&cell| field.arena.neighbours(cell))
            .filter(|&cell| field.solid[cell] && !field.arena.closed[cell])
            .filter_map(|cell| (names.spot_at)(cell))
            .collect();
        walls.sort_unstable();
        walls.dedup();
        return if walls.is_empty() {
            Obstruction::Obstacles
        } else {
            Obstruction::WalledIn(walls)
        };
    };
    let around = region(field.arena, &field.solid, &field.cells(other));
    let free = around
        .iter()
        .filter(|&&cell| field.standing[cell] == NO_UNIT)
        .count();
    let needed = field.cells(other).len() + goal.len();
    let modules = field.units[other].modules.iter();
    Obstruction::NoRoom {
        modules: modules.map(|&module| (names.module_of)(module)).collect(),
        missing: needed.saturating_sub(free).max(1),
    }
}

/// The cells that are connected to some cells past solid ones, those cells included.
pub(super) fn region(arena: &Arena, solid: &[bool], cells: &[usize]) -> Vec<usize> {
    let mut seen = vec![false; arena.area()];
    let mut found = cells.to_vec();
    for &cell in cells {
        seen[cell] = true;
    }
    let mut next = 0;
    while let Some(&cell) = found.get(next) {
        next += 1;
        for next_cell in arena.neighbours(cell) {
            if !seen[next_cell] && !solid[next_cell] {
                seen[next_cell] = true;
                found.push(next_cell);
            }
        }
    }
    found
}
