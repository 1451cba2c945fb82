//! Why a unit cannot get to its spots, for people.

use std::collections::BTreeSet;

use super::field::{Failure, Field, NO_UNIT};
use super::result::{MotionError, Obstruction};
use super::units::{Node, Unit};
use super::workshop::Workshop;
use formation_model::{ModuleId, SpotId};

impl Workshop<'_> {
    /// The error for a failure, from the plan at the time of the failure.
    pub fn unreachable(&self, field: &Field, failure: &Failure) -> MotionError {
        let unit = &field.units[failure.unit];
        let reason = match failure.in_the_way {
            Some(other) => self.no_room(field, unit, other),
            None => self.no_route(field, failure.unit),
        };
        self.unreachable_for(unit, reason)
    }

    /// The error for a unit that no order leaves a corridor.
    pub fn walled_in(&self, unit: &Unit) -> MotionError {
        let own = self.cells_at(unit, unit.goal);
        let reachable = self
            .arena
            .flood(own.clone(), &mut self.arena.closed.clone());
        let mut starts = unit.cells(&self.arena, unit.start);
        let reason = if starts.all(|cell| reachable.contains(&cell)) {
            Obstruction::WalledIn(self.spots_around(&own, |cell| !own.contains(&cell)))
        } else {
            Obstruction::Obstacles
        };
        self.unreachable_for(unit, reason)
    }

    /// There is no route: docked units or obstacles surround the unit, or its spots.
    fn no_route(&self, field: &Field, unit: usize) -> Obstruction {
        let goal = self.cells_at(&field.units[unit], field.units[unit].goal);
        let regions = [field.cells(unit), goal]
            .map(|cells| self.arena.flood(cells, &mut field.solid.clone()));
        let [near_start, near_goal] = &regions;
        let smaller = if near_start.len() < near_goal.len() {
            near_start
        } else {
            near_goal
        };
        let is_docked = |cell: usize| field.solid[cell] && !self.arena.closed[cell];
        let walls = self.spots_around(smaller, is_docked);
        if walls.is_empty() {
            Obstruction::Obstacles
        } else {
            Obstruction::WalledIn(walls)
        }
    }

    /// There is a route, but another unit cannot make way.
    fn no_room(&self, field: &Field, unit: &Unit, other: usize) -> Obstruction {
        let cells = field.cells(other);
        let needed = cells.len() + self.cells_at(unit, unit.goal).len();
        let around = self.arena.flood(cells, &mut field.solid.clone());
        let free = around
            .iter()
            .filter(|&&cell| field.standing[cell] == NO_UNIT);
        Obstruction::NoRoom {
            modules: self.ids_of(&field.units[other]),
            missing: needed.saturating_sub(free.count()).max(1),
        }
    }

    fn unreachable_for(&self, unit: &Unit, reason: Obstruction) -> MotionError {
        let spots = self.request.problem.target().spots();
        MotionError::Unreachable {
            modules: self.ids_of(unit),
            spots: self.spots_of(unit).map(|spot| spots[spot].id).collect(),
            reason,
        }
    }

    fn ids_of(&self, unit: &Unit) -> Vec<ModuleId> {
        let modules = self.request.problem.modules();
        unit.modules
            .iter()
            .map(|&module| modules[module].id)
            .collect()
    }

    fn cells_at(&self, unit: &Unit, node: Option<Node>) -> Vec<usize> {
        node.map_or_else(Vec::new, |node| unit.cells(&self.arena, node).collect())
    }

    /// The spots on those neighbours of some cells that are walls, ascending.
    fn spots_around(&self, cells: &[usize], is_wall: impl Fn(usize) -> bool) -> Vec<SpotId> {
        let around = cells.iter().flat_map(|&cell| self.arena.neighbours(cell));
        let walls: BTreeSet<usize> = around.filter(|&cell| is_wall(cell)).collect();
        let sites: BTreeSet<_> = walls
            .into_iter()
            .map(|cell| self.arena.site(cell))
            .collect();
        let spots = self
            .request
            .problem
            .target()
            .spots()
            .iter()
            .zip(&self.spots);
        let mut ids: Vec<SpotId> = spots
            .filter(|(_, site)| sites.contains(site))
            .map(|(spot, _)| spot.id)
            .collect();
        ids.sort_unstable();
        ids
    }
}
