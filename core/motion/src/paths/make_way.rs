//! Making way: a unit that stands where another has to pass is shifted or moved off.

use super::schedule::{NO_UNIT, Schedule, Stop};
use super::units::Node;

/// What standing singles add to the cost of a chain through their cells.
const SHIFTED: u32 = 6;
/// What each cell that another unit holds adds to the cost of a move.
const IN_THE_WAY: u32 = 60;
/// How deep moves that make way for moves may nest.
const DEPTH_MAX: usize = 4;
/// How many units may make way for one move.
const ROUNDS_MAX: usize = 40;

/// What must not be done to make way.
#[derive(Clone, Debug)]
pub(super) struct Bans {
    /// Cells on which no unit may come to rest.
    pub cells: Vec<bool>,
    /// Units that must not move.
    pub units: Vec<usize>,
}

impl Schedule<'_> {
    /// Gets a unit off the banned cells, or nearer to it; `false` if it cannot.
    ///
    /// `pushed` is the banned unit that may be shifted too if there is no other way.
    pub fn make_way(
        &mut self,
        unit: usize,
        bans: &Bans,
        pushed: Option<usize>,
    ) -> Result<bool, Stop> {
        let is_single = self.units[unit].is_simple();
        if is_single && self.shift_chain(unit, bans)? {
            return Ok(true);
        }
        if self.relocate(unit, bans)? {
            return Ok(true);
        }
        let Some(pushed) = pushed.filter(|_| is_single) else {
            return Ok(false);
        };
        let mut bans = bans.clone();
        bans.units.retain(|&other| other != pushed);
        self.shift_chain(unit, &bans)
    }

    /// Moves a hole to a single: from it to the nearest free cell, each single moves to where the next one stood.
    fn shift_chain(&mut self, unit: usize, bans: &Bans) -> Result<bool, Stop> {
        let errand = self.errand(unit, false);
        let (standing, solid, units) = (&self.standing, &self.solid, self.units);
        let cost = |cell: usize| match standing[cell] {
            _ if solid[cell] => None,
            NO_UNIT => Some(0),
            other if !units[other].is_simple() || bans.units.contains(&other) => None,
            _ => Some(SHIFTED),
        };
        let is_goal = |node: Node| standing[node] == NO_UNIT && !bans.cells[node];
        let route = self.routes.find(&errand, cost, |_| 0, is_goal);
        self.check_budget()?;
        let Some(route) = route else { return Ok(false) };
        let mut hole = route[route.len() - 1];
        for &cell in route.iter().rev() {
            let single = self.standing[cell];
            if single != NO_UNIT && cell != hole {
                if !self.move_to(single, hole)? {
                    return Ok(false);
                }
                hole = cell;
            }
        }
        Ok(true)
    }

    /// Moves a unit in its present layout to free cells that are not banned, after those in its way made way; `false` if it
    /// cannot.
    pub fn relocate(&mut self, unit: usize, bans: &Bans) -> Result<bool, Stop> {
        self.relocate_within(unit, bans, 0)
    }

    fn relocate_within(&mut self, unit: usize, bans: &Bans, depth: usize) -> Result<bool, Stop> {
        let (arena, body, from) = (self.arena, &self.units[unit], self.place(unit));
        let errand = self.errand(unit, false);
        let (standing, solid) = (&self.standing, &self.solid);
        let cost = |cell: usize| match standing[cell] {
            _ if solid[cell] => None,
            other if other == NO_UNIT || other == unit => Some(0),
            other if bans.units.contains(&other) => None,
            _ => Some(IN_THE_WAY),
        };
        let is_free = |cell: usize| {
            (standing[cell] == NO_UNIT || standing[cell] == unit) && !bans.cells[cell]
        };
        let is_goal = |node: Node| node != from && body.cells(arena, node).all(is_free);
        let route = self.routes.find(&errand, cost, |_| 0, is_goal);
        self.check_budget()?;
        let Some(route) = route else { return Ok(false) };
        let goal = route[route.len() - 1];
        let way = self.way(unit, &route);
        let mut bans = bans.clone();
        bans.units.push(unit);
        for &cell in &way {
            bans.cells[cell] = true;
        }
        for _ in 0..ROUNDS_MAX {
            let Some(other) = self.first_other(unit, &way) else {
                return self.move_to(unit, goal);
            };
            let is_single = self.units[other].is_simple();
            let makes_way = (is_single && self.shift_chain(other, &bans)?)
                || (depth + 1 < DEPTH_MAX && self.relocate_within(other, &bans, depth + 1)?);
            if !makes_way {
                return Ok(false);
            }
        }
        Ok(false)
    }
}
