//! Safe-interval path planning (Phillips and Likhachev, ICRA 2011) for units of several cells.
//!
//! A state is a node and an interval in which no other unit holds a cell of it. Of two states of one interval only the
//! earlier one counts, unless the later one took fewer steps.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::lattice::{Arena, FOREVER, Time};
use super::table::Table;
use super::units::{Node, Unit, split};

/// A step into a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    pub node: Node,
    /// When the step begins; it ends one unit of time later.
    pub begin: Time,
}

/// What is searched for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Query {
    pub unit: usize,
    /// Where the unit is, and since when.
    pub from: Node,
    pub since: Time,
    pub goal: Node,
    /// The end and the steps of a path that is known; only a better one is searched for.
    pub known: Option<(Time, u32)>,
    /// The exit, if the unit has one, begins no earlier than this.
    pub exit_from: Time,
}

impl Query {
    /// Whether a path of this end and so many steps is better than the known one.
    fn is_better(&self, end: Time, steps: u32) -> bool {
        self.known.is_none_or(|known| (end, steps) < known)
    }
}

struct Interval {
    from: Time,
    until: Time,
    /// The earliest time at which a state of this interval was expanded.
    expanded: Time,
    best: (Time, u32),
}

struct Record {
    entry: Entry,
    parent: usize,
}

/// What one search looks at.
#[derive(Clone, Copy)]
struct Scene<'a> {
    arena: &'a Arena,
    unit: &'a Unit,
    table: &'a Table,
    query: &'a Query,
    /// No path ends before, as the goal is not free for good until one step earlier.
    earliest: Time,
}

/// A state that is expanded.
#[derive(Clone, Copy)]
struct State {
    record: usize,
    time: Time,
    /// The end of its interval.
    until: Time,
    steps: u32,
}

/// Ordered by: the earliest end, the steps in all, more steps done, the node, the interval.
type Open = (Time, u32, Reverse<u32>, Node, usize, usize);

const NONE: usize = usize::MAX;

/// The memory of the search, used again by each query.
pub(super) struct Sipp {
    stamp: u32,
    stamps: Vec<u32>,
    /// The first interval of each node and the first beyond its last.
    ranges: Vec<(u32, u32)>,
    intervals: Vec<Interval>,
    records: Vec<Record>,
    open: BinaryHeap<Reverse<Open>>,
    busy: Vec<(Time, Time)>,
    /// The states expanded so far.
    pub expansions: u64,
}

impl Sipp {
    /// Memory for nodes below a number.
    pub fn new(nodes: usize) -> Self {
        Self {
            stamp: 0,
            stamps: vec![0; nodes],
            ranges: vec![(0, 0); nodes],
            intervals: Vec::new(),
            records: Vec::new(),
            open: BinaryHeap::new(),
            busy: Vec::new(),
            expansions: 0,
        }
    }

    /// The path that ends earliest, then the one of fewest steps; none if there is none that is better than a known one.
    ///
    /// Where the unit is at its goal already and may stay, the path is empty.
    pub fn path(
        &mut self,
        arena: &Arena,
        units: &[Unit],
        table: &Table,
        query: &Query,
    ) -> Option<Vec<Entry>> {
        let unit = &units[query.unit];
        let mut scene = Scene {
            arena,
            unit,
            table,
            query,
            earliest: query.since,
        };
        let stay = unit
            .cells(arena, query.from)
            .map(|cell| table.next_after(cell, query.unit, query.since))
            .min()
            .unwrap_or(FOREVER);
        if query.from == query.goal && stay == FOREVER {
            return Some(Vec::new());
        }
        self.stamp += 1;
        self.intervals.clear();
        self.records.clear();
        self.open.clear();
        let (_, end) = self.intervals_of(scene, query.goal);
        let last = self.intervals[..end as usize].last();
        let free_from = last.filter(|last| last.until == FOREVER)?.from;
        if query.known.is_some() {
            // A first path is searched for without this bound: of equal ones it finds those that make shorter plans.
            scene.earliest = free_from + 1;
        }
        let start = self.intervals.len();
        self.intervals.push(Interval {
            best: (query.since, 0),
            ..Interval::free(query.since, stay)
        });
        let first = Record {
            entry: Entry {
                node: query.from,
                begin: query.since,
            },
            parent: NONE,
        };
        self.push(scene, first, start, (query.since, 0));
        while let Some(Reverse((_, _, Reverse(steps), node, interval, record))) = self.open.pop() {
            if interval == NONE {
                return Some(self.traced(record));
            }
            let time = if self.records[record].parent == NONE {
                query.since
            } else {
                self.records[record].entry.begin + 1
            };
            if self.intervals[interval].expanded <= time {
                continue;
            }
            self.intervals[interval].expanded = time;
            self.expansions += 1;
            let until = self.intervals[interval].until;
            let state = State {
                record,
                time,
                until,
                steps,
            };
            self.expand(scene, node, state);
        }
        None
    }

    /// Adds the states in which a step from a state can end.
    fn expand(&mut self, scene: Scene, node: Node, state: State) {
        let Scene { arena, unit, .. } = scene;
        let (_, cell) = split(arena, node);
        if unit.may_step(arena, node) {
            let base = node - cell;
            for next in arena.neighbours(cell) {
                self.extend(scene, state, base + next);
            }
        }
        if let Some(next) = unit.fold(arena, node) {
            self.extend(scene, state, next);
        }
    }

    /// Adds the states of one node in which a step from a state can end.
    fn extend(&mut self, scene: Scene, state: State, node: Node) {
        let (time, until, query) = (state.time, state.until, scene.query);
        let steps = state.steps + 1;
        let (first, end) = self.intervals_of(scene, node);
        for index in first as usize..end as usize {
            let interval = &self.intervals[index];
            let begin = time.max(interval.from);
            if begin >= until {
                break;
            }
            if interval.until <= begin + 1 {
                continue;
            }
            let is_new = interval.expanded > begin + 1
                && !(interval.best.0 <= begin + 1 && interval.best.1 <= steps);
            if node == query.goal && interval.until == FOREVER {
                if query.is_better(begin + 1, steps) {
                    let record = self.records.len();
                    self.records.push(Record {
                        entry: Entry { node, begin },
                        parent: state.record,
                    });
                    let key = (begin + 1, steps, Reverse(steps), node, NONE, record);
                    self.open.push(Reverse(key));
                }
                continue;
            }
            if is_new {
                self.intervals[index].best = (begin + 1, steps);
                let record = Record {
                    entry: Entry { node, begin },
                    parent: state.record,
                };
                self.push(scene, record, index, (begin + 1, steps));
            }
        }
    }

    fn push(&mut self, scene: Scene, record: Record, interval: usize, (time, steps): (Time, u32)) {
        let (query, node) = (scene.query, record.entry.node);
        let rest = scene.unit.distance(scene.arena, node, query.goal);
        let end = scene.earliest.max(time + rest);
        if !query.is_better(end, steps + rest) {
            return;
        }
        let index = self.records.len();
        self.records.push(record);
        let key = (end, steps + rest, Reverse(steps), node, interval, index);
        self.open.push(Reverse(key));
    }

    /// The range of a node's safe intervals; empty if a cell of it is closed.
    fn intervals_of(&mut self, scene: Scene, node: Node) -> (u32, u32) {
        if self.stamps[node] == self.stamp {
            return self.ranges[node];
        }
        let Scene {
            arena,
            unit,
            table,
            query,
            ..
        } = scene;
        self.stamps[node] = self.stamp;
        let first = u32::try_from(self.intervals.len()).unwrap_or(u32::MAX);
        if unit.cells(arena, node).all(|cell| !arena.closed[cell]) {
            self.busy.clear();
            let mut from = match unit.exit_step(arena, node) {
                Some(_) => query.since.max(query.exit_from),
                None => query.since,
            };
            for cell in unit.cells(arena, node) {
                from = from.max(table.ready(cell));
                let visits = table.visits(cell);
                let begin = visits.partition_point(|visit| visit.until <= query.since);
                let others = visits[begin..]
                    .iter()
                    .filter(|visit| visit.unit != query.unit);
                self.busy
                    .extend(others.map(|visit| (visit.from, visit.until)));
            }
            if !unit.holds_one_cell() {
                self.busy.sort_unstable();
            }
            for &(begin, until) in &self.busy {
                if begin > from {
                    self.intervals.push(Interval::free(from, begin));
                }
                from = from.max(until);
            }
            if from < FOREVER {
                self.intervals.push(Interval::free(from, FOREVER));
            }
        }
        let end = u32::try_from(self.intervals.len()).unwrap_or(u32::MAX);
        self.ranges[node] = (first, end);
        (first, end)
    }

    fn traced(&self, mut record: usize) -> Vec<Entry> {
        let mut path = Vec::new();
        while self.records[record].parent != NONE {
            path.push(self.records[record].entry);
            record = self.records[record].parent;
        }
        path.reverse();
        path
    }
}

impl Interval {
    fn free(from: Time, until: Time) -> Self {
        Self {
            from,
            until,
            expanded: FOREVER,
            best: (FOREVER, u32::MAX),
        }
    }
}
