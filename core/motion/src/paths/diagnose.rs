//! Why a unit cannot get to its spots, for people.

use std::collections::BTreeSet;

use super::lattice_request::LatticeRequest;
use super::regions::Regions;
use super::result::{MotionError, Obstruction};
use super::schedule::{Failure, Schedule};
use super::units::Unit;
use formation_model::{ModuleId, SpotId};

impl LatticeRequest<'_> {
    /// The error for a failure, from the plan at the time of the failure.
    pub fn unreachable(&self, schedule: &Schedule, failure: &Failure) -> MotionError {
        let unit = &schedule.units[failure.unit];
        let reason = match failure.in_the_way {
            Some(other) => Obstruction::NoPassing(self.ids_of(&schedule.units[other])),
            // By `check_ways` there is a way; only a unit that turns needs more than that.
            None if unit.exit.is_some() => Obstruction::NoExit,
            None => Obstruction::NoTurn,
        };
        self.unreachable_for(unit, reason)
    }

    /// Each module can get to its spot past obstacles and pinned modules, if nothing else is in the way.
    pub fn check_ways(&self) -> Result<(), MotionError> {
        let modules = self.request.problem.modules();
        let mut taken = self.arena.closed.clone();
        let open = Regions::new(&self.arena, &taken);
        let pinned = (0..modules.len()).filter(|&module| modules[module].pin.is_some());
        for cell in pinned.flat_map(|module| self.cells_taken_by(module)) {
            taken[cell] = true;
        }
        let past_pinned = Regions::new(&self.arena, &taken);
        for (module, member) in modules.iter().enumerate() {
            let on_lattice = self.spot_of[module].filter(|&spot| !self.resting.is_off[spot]);
            let ends = [
                Some(self.starts[module]),
                on_lattice.map(|spot| self.spots[spot]),
            ];
            let [Some(start), Some(goal)] = ends.map(|site| self.arena.cell(site?)) else {
                continue;
            };
            if member.pin.is_some() || past_pinned.joins(start, goal) {
                continue;
            }
            let reason = if open.joins(start, goal) {
                Obstruction::WalledIn(self.walls_between(&past_pinned, start, goal))
            } else {
                Obstruction::Obstacles
            };
            let spots = self.request.problem.target().spots();
            return Err(MotionError::Unreachable {
                modules: vec![member.id],
                spots: self.spot_of[module]
                    .map(|spot| spots[spot].id)
                    .into_iter()
                    .collect(),
                reason,
            });
        }
        Ok(())
    }

    /// The spots of pinned modules around the smaller one of the regions of two cells.
    fn walls_between(&self, past_pinned: &Regions, start: usize, goal: usize) -> Vec<SpotId> {
        let regions =
            [start, goal].map(|cell| self.arena.flood(vec![cell], &mut past_pinned.taken.clone()));
        let [near_start, near_goal] = &regions;
        let smaller = if near_start.len() < near_goal.len() {
            near_start
        } else {
            near_goal
        };
        self.spots_around(smaller, |cell| {
            past_pinned.taken[cell] && !self.arena.closed[cell]
        })
    }

    /// The error for a unit.
    pub fn unreachable_for(&self, unit: &Unit, reason: Obstruction) -> MotionError {
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
