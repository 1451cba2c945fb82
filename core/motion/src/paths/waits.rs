//! The dependency graph: which step of a unit waits for how many steps of another.

use std::collections::BTreeMap;

use super::group::{Group, Phase};
use super::lattice::{Arena, Lattice, Time};
use super::schedule::Schedule;
use super::units::Unit;

/// A wait between units by position: the step that waits, the other unit, and how many steps it must have done.
pub(super) type UnitWait = (u32, usize, u32);

/// The groups that sweep each cell on their way onto the lattice.
pub(super) fn aligners(groups: &[Group], lattice: &Lattice, arena: &Arena) -> Vec<Vec<usize>> {
    let mut sweeping = vec![Vec::new(); arena.area()];
    for (index, group) in groups.iter().enumerate() {
        for phase in Phase::ALL {
            for shape in group.swept(phase) {
                let (low, high) = shape.bounds();
                for cell in arena.cells_between(lattice.covered(low, high)) {
                    if sweeping[cell].last() != Some(&index) {
                        sweeping[cell].push(index);
                    }
                }
            }
        }
    }
    sweeping
}

/// What the waits are drawn from.
pub(super) struct Graph<'a> {
    pub schedule: &'a Schedule<'a>,
    pub groups: &'a [Group],
    /// The group of each unit.
    pub group_of: &'a [usize],
    pub aligners: &'a [Vec<usize>],
}

impl Graph<'_> {
    /// The waits of each unit, ascending by step, without those that earlier ones imply.
    pub fn waits(&self) -> Vec<Vec<UnitWait>> {
        let count = self.schedule.units.len();
        let mut waits: Vec<Vec<UnitWait>> = vec![Vec::new(); count];
        let mut speaker = vec![None; self.groups.len()];
        for unit in (0..count).rev() {
            speaker[self.group_of[unit]] = Some(unit);
        }
        for (unit, waits) in waits.iter_mut().enumerate() {
            for (step, alignment) in (1..).zip(&self.groups[self.group_of[unit]].steps) {
                let awaited = alignment.waits.iter();
                waits.extend(
                    awaited.filter_map(|&(group, done)| Some((step, speaker[group]?, done))),
                );
            }
        }
        for unit in 0..count {
            self.exit_waits(unit, &mut waits);
        }
        for cell in 0..self.schedule.arena.area() {
            self.cell_waits(cell, &speaker, &mut waits);
        }
        waits.into_iter().map(without_implied).collect()
    }

    fn joint(&self, unit: usize) -> u32 {
        let steps = self.groups[self.group_of[unit]].steps.len();
        u32::try_from(steps).unwrap_or(u32::MAX)
    }

    /// The number of the step that begins at a time.
    fn step_at(&self, unit: usize, begin: Time) -> Option<u32> {
        let path = &self.schedule.paths[unit];
        let index = path
            .binary_search_by_key(&begin, |entry| entry.begin)
            .ok()?;
        Some(self.joint(unit) + u32::try_from(index + 1).unwrap_or(u32::MAX))
    }

    /// An exit begins when the bodies rest past which it leads.
    fn exit_waits(&self, unit: usize, waits: &mut [Vec<UnitWait>]) {
        let steps = |unit: usize| {
            let moved = u32::try_from(self.schedule.paths[unit].len()).unwrap_or(u32::MAX);
            self.joint(unit).saturating_add(moved)
        };
        let Some(exit) = &self.schedule.units[unit].exit else {
            return;
        };
        let first = (steps(unit) + 1).saturating_sub(u32::try_from(exit.steps.len()).unwrap_or(0));
        let others = exit.after.iter().map(|&other| (first, other, steps(other)));
        waits[unit].extend(others.filter(|&(.., done)| done > 0));
    }

    fn cell_waits(&self, cell: usize, speaker: &[Option<usize>], waits: &mut [Vec<UnitWait>]) {
        let visits = self.schedule.table.visits(cell);
        for pair in visits.windows(2) {
            let (before, after) = (&pair[0], &pair[1]);
            if before.unit == after.unit {
                continue;
            }
            let out = before
                .until
                .checked_sub(1)
                .and_then(|begin| self.step_at(before.unit, begin));
            if let (Some(out), Some(step)) = (out, self.step_at(after.unit, after.from)) {
                waits[after.unit].push((step, before.unit, out));
            }
        }
        let starts_here = |unit: &Unit| {
            unit.cells(self.schedule.arena, unit.start)
                .any(|at| at == cell)
        };
        let entering = visits
            .iter()
            .enumerate()
            .find(|(index, visit)| *index > 0 || !starts_here(&self.schedule.units[visit.unit]));
        let Some((_, visit)) = entering else { return };
        let Some(step) = self.step_at(visit.unit, visit.from) else {
            return;
        };
        for &group in &self.aligners[cell] {
            if let Some(unit) = speaker[group]
                && group != self.group_of[visit.unit]
            {
                waits[visit.unit].push((step, unit, self.joint(unit)));
            }
        }
    }
}

/// Sorts waits and drops those for a unit that was waited for at an equal or later step before.
fn without_implied(mut waits: Vec<UnitWait>) -> Vec<UnitWait> {
    waits.sort_unstable_by_key(|&(step, unit, done)| (step, unit, std::cmp::Reverse(done)));
    let mut known: BTreeMap<usize, u32> = BTreeMap::new();
    waits.retain(|&(_, unit, done)| {
        let latest = known.entry(unit).or_default();
        let is_new = *latest < done;
        *latest = (*latest).max(done);
        is_new
    });
    waits
}
