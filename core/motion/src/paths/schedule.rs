//! The plan so far: where all units are, the table of their holds, and one unit's move through it.

use super::lattice::{Arena, FOREVER, Time};
use super::route::{Errand, Routes, STEP};
use super::sipp::{Entry, Query, Sipp};
use super::table::{Table, Visit};
use super::units::{Node, Unit, node_count};

/// No unit.
pub(super) const NO_UNIT: usize = usize::MAX;

/// Why planning stops.
#[derive(Clone, Debug)]
pub(super) enum Stop {
    /// The budget is spent.
    Budget,
    /// A unit cannot get to its spots.
    Failure(Failure),
}

/// Which unit cannot get to its spots, and why.
#[derive(Clone, Debug)]
pub(super) struct Failure {
    pub unit: usize,
    /// The unit that cannot make way; none if there is no route at all.
    pub in_the_way: Option<usize>,
}

/// How the times of a move are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scheduling {
    /// Between the holds of other units.
    SafeIntervals,
    /// After all holds of other units.
    Serial,
}

pub(super) struct Schedule<'a> {
    pub arena: &'a Arena,
    pub units: &'a [Unit],
    pub table: Table,
    /// The steps of each unit.
    pub paths: Vec<Vec<Entry>>,
    /// Which unit's last place each cell belongs to.
    pub standing: Vec<usize>,
    /// Cells of units that rest for good, and closed ones.
    pub solid: Vec<bool>,
    pub sipp: Sipp,
    pub routes: Routes,
    timing: Scheduling,
    expansions_max: u64,
}

impl<'a> Schedule<'a> {
    /// All units on their starts, the pinned ones docked. `ready` gives for each cell when a step into it may begin.
    pub fn new(
        arena: &'a Arena,
        units: &'a [Unit],
        ready: &[Time],
        timing: Scheduling,
        expansions_max: u64,
    ) -> Self {
        let nodes = node_count(units, arena);
        let mut schedule = Self {
            arena,
            units,
            table: Table::new(ready.to_vec()),
            paths: vec![Vec::new(); units.len()],
            standing: vec![NO_UNIT; arena.area()],
            solid: arena.closed.clone(),
            sipp: Sipp::new(nodes),
            routes: Routes::new(nodes),
            timing,
            expansions_max,
        };
        for (index, unit) in units.iter().enumerate() {
            for cell in unit.cells(arena, unit.start) {
                schedule.standing[cell] = index;
                let visit = Visit {
                    from: 0,
                    until: FOREVER,
                    unit: index,
                };
                schedule.table.hold(cell, visit);
            }
            if unit.stays {
                schedule.settle(index);
            }
        }
        schedule
    }

    /// How many search nodes were expanded.
    pub fn expansions(&self) -> u64 {
        self.sipp.expansions + self.routes.expansions
    }

    pub fn check_budget(&self) -> Result<(), Stop> {
        // The serial variant is the last resort and cheap; it has no budget of its own.
        if self.timing == Scheduling::SafeIntervals && self.expansions() > self.expansions_max {
            return Err(Stop::Budget);
        }
        Ok(())
    }

    /// Where a unit is at the end of the plan so far.
    pub fn place(&self, unit: usize) -> Node {
        self.paths[unit]
            .last()
            .map_or(self.units[unit].start, |entry| entry.node)
    }

    /// Since when it is there.
    pub fn since(&self, unit: usize) -> Time {
        self.paths[unit]
            .last()
            .map_or(self.units[unit].ready, |entry| entry.begin + 1)
    }

    /// When the bodies rest past which the exit of a unit leads.
    pub fn exit_from(&self, unit: usize) -> Time {
        let exit = self.units[unit].exit.iter();
        let others = exit.flat_map(|exit| &exit.after);
        let rest = others.map(|&other| self.since(other));
        rest.max().unwrap_or_default()
    }

    /// The cells of a unit at the end of the plan so far.
    pub fn cells(&self, unit: usize) -> Vec<usize> {
        self.units[unit]
            .cells(self.arena, self.place(unit))
            .collect()
    }

    /// The cells of a unit along a route.
    pub fn way(&self, unit: usize, route: &[Node]) -> Vec<usize> {
        let body = &self.units[unit];
        let nodes = route.iter();
        nodes
            .flat_map(|&node| body.cells(self.arena, node))
            .collect()
    }

    /// The first other unit that stands on some cells.
    pub fn first_other(&self, unit: usize, cells: &[usize]) -> Option<usize> {
        let mut standing = cells.iter().map(|&cell| self.standing[cell]);
        standing.find(|&other| other != NO_UNIT && other != unit)
    }

    /// A unit rests where it stands for good.
    pub fn settle(&mut self, unit: usize) {
        for cell in self.cells(unit) {
            self.solid[cell] = true;
        }
    }

    /// Moves a unit to a node where it can stay; `false` if it cannot get there.
    pub fn move_to(&mut self, unit: usize, goal: Node) -> Result<bool, Stop> {
        let path = match self.timing {
            Scheduling::SafeIntervals => {
                let query = Query {
                    unit,
                    from: self.place(unit),
                    since: self.since(unit),
                    goal,
                    known: None,
                    exit_from: self.exit_from(unit),
                };
                self.sipp.path(self.arena, self.units, &self.table, &query)
            }
            Scheduling::Serial => self.serial_path(unit, goal),
        };
        self.check_budget()?;
        let Some(path) = path else { return Ok(false) };
        self.append(unit, &path);
        Ok(true)
    }

    /// A search for a route from the last place of a unit, which may fold if `folds`.
    pub fn errand(&self, unit: usize, folds: bool) -> Errand<'a> {
        Errand {
            arena: self.arena,
            unit: &self.units[unit],
            from: self.place(unit),
            folds,
        }
    }

    /// The shortest route past all last places, each step after all holds of its cells by others.
    fn serial_path(&mut self, unit: usize, goal: Node) -> Option<Vec<Entry>> {
        let (arena, body) = (self.arena, &self.units[unit]);
        let errand = self.errand(unit, true);
        let mut time = self.since(unit);
        let (standing, solid) = (&self.standing, &self.solid);
        let is_free = |cell: usize| {
            let other = standing[cell];
            (!solid[cell] && (other == NO_UNIT || other == unit)).then_some(0)
        };
        let rest = |node: Node| body.distance(arena, node, goal) * STEP;
        let route = self
            .routes
            .find(&errand, is_free, rest, |node| node == goal)?;
        let mut path = Vec::with_capacity(route.len());
        for &node in &route[1..] {
            let free = body
                .cells(arena, node)
                .map(|cell| self.table.free_from(cell, unit));
            let exit_from = body.exit_step(arena, node).map(|_| self.exit_from(unit));
            let begin = free.max().max(exit_from).unwrap_or_default().max(time);
            path.push(Entry { node, begin });
            time = begin + 1;
        }
        Some(path)
    }

    pub fn append(&mut self, unit: usize, path: &[Entry]) {
        if path.is_empty() {
            return;
        }
        for cell in self.cells(unit) {
            self.standing[cell] = NO_UNIT;
        }
        for cell in self.cells(unit) {
            self.table.leave(cell, path[0].begin + 1);
        }
        self.hold_along(unit, path);
        self.paths[unit].extend(path);
        for cell in self.cells(unit) {
            self.standing[cell] = unit;
        }
    }

    /// Takes all holds of a unit out of the table; returns its path.
    pub fn take_out(&mut self, unit: usize) -> Vec<Entry> {
        let path = std::mem::take(&mut self.paths[unit]);
        let body = &self.units[unit];
        let nodes = std::iter::once(body.start).chain(path.iter().map(|entry| entry.node));
        for node in nodes {
            for cell in body.cells(self.arena, node) {
                self.table.clear(cell, unit);
            }
        }
        path
    }

    /// Puts a unit with a path from its start into the table.
    pub fn put_in(&mut self, unit: usize, path: Vec<Entry>) {
        let body = &self.units[unit];
        let start = Entry {
            node: body.start,
            begin: 0,
        };
        let entries: Vec<Entry> = std::iter::once(start).chain(path.iter().copied()).collect();
        self.hold_along(unit, &entries);
        self.paths[unit] = path;
    }

    /// Enters the holds of a unit along its steps, the last without an end.
    fn hold_along(&mut self, unit: usize, entries: &[Entry]) {
        for (index, entry) in entries.iter().enumerate() {
            let until = entries
                .get(index + 1)
                .map_or(FOREVER, |next| next.begin + 1);
            for cell in self.units[unit].cells(self.arena, entry.node) {
                let visit = Visit {
                    from: entry.begin,
                    until,
                    unit,
                };
                self.table.hold(cell, visit);
            }
        }
    }

    /// The end of the last step, and the steps of all units.
    pub fn cost(&self) -> (Time, usize) {
        let ends = (0..self.units.len()).map(|unit| self.since(unit));
        (
            ends.max().unwrap_or_default(),
            self.paths.iter().map(Vec::len).sum(),
        )
    }
}
