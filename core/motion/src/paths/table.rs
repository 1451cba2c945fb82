//! The reservation table: which unit holds which cell from when until when.

use super::lattice::{FOREVER, Time};

/// A unit's hold of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Visit {
    pub from: Time,
    pub until: Time,
    pub unit: usize,
}

/// The visits of each cell in order of time; no two overlap.
#[derive(Clone, Debug)]
pub(super) struct Table {
    visits: Vec<Vec<Visit>>,
    /// When the modules that come onto the lattice near a cell are out of the way.
    ready: Vec<Time>,
}

impl Table {
    pub fn new(ready: Vec<Time>) -> Self {
        Self {
            visits: vec![Vec::new(); ready.len()],
            ready,
        }
    }

    /// The visits of a cell, in order.
    pub fn visits(&self, cell: usize) -> &[Visit] {
        &self.visits[cell]
    }

    /// Before this time no unit may begin a step into the cell.
    pub fn ready(&self, cell: usize) -> Time {
        self.ready[cell]
    }

    /// Adds a hold; joins it with an earlier one of the same unit that it touches.
    pub fn hold(&mut self, cell: usize, visit: Visit) {
        let visits = &mut self.visits[cell];
        let index = visits.partition_point(|other| other.from <= visit.from);
        match index.checked_sub(1).map(|before| &mut visits[before]) {
            Some(before) if before.unit == visit.unit && before.until >= visit.from => {
                before.until = before.until.max(visit.until);
            }
            _ => visits.insert(index, visit),
        }
    }

    /// Ends the endless hold of a cell.
    pub fn leave(&mut self, cell: usize, until: Time) {
        if let Some(last) = self.visits[cell].last_mut()
            && last.until == FOREVER
        {
            last.until = until;
        }
    }

    /// Removes all holds of a cell by a unit.
    pub fn clear(&mut self, cell: usize, unit: usize) {
        self.visits[cell].retain(|visit| visit.unit != unit);
    }

    /// When the first hold by another unit begins after a time.
    pub fn next_after(&self, cell: usize, unit: usize, time: Time) -> Time {
        let visits = &self.visits[cell];
        let first = visits.partition_point(|visit| visit.until <= time);
        let mut others = visits[first..].iter().filter(|visit| visit.unit != unit);
        others.next().map_or(FOREVER, |visit| visit.from)
    }

    /// When the last hold by another unit ends, and the cell is ready.
    pub fn free_from(&self, cell: usize, unit: usize) -> Time {
        let others = self.visits[cell].iter().rev();
        let last = others
            .filter(|visit| visit.unit != unit)
            .map(|visit| visit.until);
        last.max().unwrap_or_default().max(self.ready[cell])
    }
}
