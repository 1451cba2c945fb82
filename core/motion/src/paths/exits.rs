//! Exits: how units get from a cell of the lattice to spots off it.
//!
//! An exit is the way onto the lattice run backwards. The unit turns in place and shifts, straight or along one axis after the
//! other, as a rigid body; a block whose spots are on no lattice of their own folds in a disc instead. Bodies that rest already
//! are avoided as they are, and all cells that the exit reaches into are held while it lasts, so that nothing else is near.

use std::collections::BTreeSet;

use super::exit::{Exit, ExitStep};
use super::lattice::{Site, point};
use super::lattice_request::LatticeRequest;
use super::rectangle::{HALF, hull};
use super::resting::{RIGID, cells_under, in_cells, minus};
use super::shape::Shape;
use super::units::{Layout, Unit};
use formation_model::turning::{Point, angle_of, off_quarter, quarters, rotated, shortest};
use formation_model::{MICRO_PER_UNIT, MicroUnits, Pose, StepKind};

/// An exit begins at most this many columns and rows from the spot.
const FAR: i64 = 3;
/// What exits are searched among.
#[derive(Clone, Copy)]
pub(super) struct ExitSearch<'a> {
    pub on_lattice: &'a LatticeRequest<'a>,
    pub units: &'a [Unit],
}

/// One leg of an exit, seen from the middle of the unit.
#[derive(Clone, Copy, Debug)]
enum Leg {
    Turn { at: Point, by: i64 },
    Shift { from: Point, to: Point, turned: i64 },
}

/// A part of what an exit sweeps.
struct Sweep {
    shape: Shape,
    /// The line along which the middle of one body moves.
    line: (Point, Point),
    /// How far the body reaches from that line everywhere.
    inner: i64,
}

/// How a unit stands where an exit begins, and where it goes.
struct Course {
    /// The offset of each member's cell from the middle, and its heading.
    members: Vec<(Site, i64)>,
    goals: Vec<Pose>,
    /// Where the middle goes, and by how much the unit turns; none if its spots are on no lattice.
    rigid: Option<(Point, i64)>,
}

fn pose((x, y): Point, theta: i64) -> Pose {
    Pose {
        x: MicroUnits(x),
        y: MicroUnits(y),
        theta: MicroUnits(theta),
    }
}

fn plus(one: Point, other: Point) -> Point {
    (one.0 + other.0, one.1 + other.1)
}

fn length((x, y): Point) -> i64 {
    let squared = i128::from(x).pow(2) + i128::from(y).pow(2);
    i64::try_from(squared.isqrt()).unwrap_or(i64::MAX)
}

/// The distance of a point from the line between two others.
fn distance(point: Point, (from, to): (Point, Point)) -> i64 {
    let (line, offset) = (minus(to, from), minus(point, from));
    let product = |one: Point, other: Point| {
        i128::from(one.0) * i128::from(other.0) + i128::from(one.1) * i128::from(other.1)
    };
    let (along, whole) = (product(line, offset), product(line, line));
    if along <= 0 || whole == 0 {
        return length(offset);
    }
    if along >= whole {
        return length(minus(point, to));
    }
    let across =
        i128::from(line.0) * i128::from(offset.1) - i128::from(line.1) * i128::from(offset.0);
    i64::try_from(across.abs() / whole.isqrt()).unwrap_or(i64::MAX)
}

impl ExitSearch<'_> {
    /// The nearest exit of a unit past the bodies that rest on some cells; from a cell from which a way leads on.
    pub fn find(
        &self,
        unit: usize,
        holders: &[Vec<usize>],
        mut leads_on: impl FnMut(usize) -> bool,
    ) -> Option<Exit> {
        let course = self.course(unit)?;
        let body = &self.units[unit];
        let layout = body.layouts.last()?;
        let goal = course
            .rigid
            .map_or_else(|| middle_of(&course.goals), |rigid| rigid.0);
        for cell in self.near(goal) {
            let arena = &self.on_lattice.arena;
            let is_free =
                |held: usize| !arena.closed[held] && holders[held].iter().all(|&it| it == unit);
            if !fits(layout, arena.site(cell), |site| {
                arena.cell(site).is_some_and(is_free)
            }) {
                continue;
            }
            let is_block = body.is_block();
            if !is_block && !leads_on(cell) {
                continue;
            }
            let found = self.exit_from(unit, &course, cell, holders);
            if let Some(exit) = found
                && (!is_block || leads_on(cell))
            {
                return Some(exit);
            }
        }
        None
    }

    /// The cells around a point, the nearest first.
    fn near(&self, goal: Point) -> Vec<usize> {
        let (lattice, arena) = (&self.on_lattice.lattice, &self.on_lattice.arena);
        let under = lattice.site(goal);
        let low = (under.0 - FAR, under.1 - FAR);
        let high = (under.0 + FAR, under.1 + FAR);
        let mut cells: Vec<(i64, usize)> = arena
            .cells_between((low, high))
            .into_iter()
            .map(|cell| (length(minus(lattice.point(arena.site(cell)), goal)), cell))
            .collect();
        cells.sort_unstable();
        cells.into_iter().map(|(_, cell)| cell).collect()
    }

    /// The poses of the spots of a unit.
    fn goals(&self, unit: usize) -> Vec<Pose> {
        let spots = self.on_lattice.request.problem.target().spots();
        self.on_lattice
            .spots_of(&self.units[unit])
            .map(|spot| spots[spot].pose)
            .collect()
    }

    fn course(&self, unit: usize) -> Option<Course> {
        let body = &self.units[unit];
        let goals = self.goals(unit);
        let sites = &body.layouts.last()?.sites;
        if goals.len() != sites.len() {
            return None;
        }
        let heading = |member: usize| {
            if body.layouts.len() > 1 {
                return angle_of(quarters(goals[member].theta.0));
            }
            self.on_lattice.heading(body.modules[member])
        };
        let members: Vec<(Site, i64)> = (0..sites.len())
            .map(|member| (sites[member], shortest(heading(member))))
            .collect();
        let by = if body.is_block() {
            off_quarter(goals[0].theta.0)
        } else {
            shortest(goals[0].theta.0 - members[0].1)
        };
        let by = if by.abs() <= self.tolerance() { 0 } else { by };
        let middle = members.iter().position(|member| member.0 == (0, 0))?;
        let target = point(&goals[middle]);
        let is_rigid = members.iter().zip(&goals).all(|(&(site, heading), goal)| {
            let off = minus(minus(point(goal), target), rotated(in_cells(site), by));
            let turned = shortest(goal.theta.0 - heading - by);
            off.0.abs().max(off.1.abs()).max(turned.abs()) <= RIGID
        });
        Some(Course {
            members,
            goals,
            rigid: is_rigid.then_some((target, by)),
        })
    }

    fn tolerance(&self) -> i64 {
        self.on_lattice.resting.form.tolerance
    }

    fn exit_from(
        &self,
        unit: usize,
        course: &Course,
        cell: usize,
        holders: &[Vec<usize>],
    ) -> Option<Exit> {
        let start = self
            .on_lattice
            .lattice
            .point(self.on_lattice.arena.site(cell));
        let Some((target, by)) = course.rigid else {
            return self.folding(unit, course, (cell, start), holders);
        };
        let mut ways = ways(start, target, by, self.tolerance()).into_iter();
        ways.find_map(|legs| {
            let half = self.on_lattice.resting.half;
            let sweeps = |half| {
                legs.iter()
                    .flat_map(move |leg| self.sweeps(course, *leg, half))
            };
            let near = self.near_bodies(unit, sweeps(HALF), holders);
            if !self.is_clear(&sweeps(half).collect::<Vec<_>>(), &near) {
                return None;
            }
            let steps = self.steps(course, &legs);
            Some(self.exit(unit, cell, steps, sweeps(HALF).map(|it| it.shape), holders))
        })
    }

    /// An exit of a block that changes its shape.
    fn folding(
        &self,
        unit: usize,
        course: &Course,
        (cell, start): (usize, Point),
        holders: &[Vec<usize>],
    ) -> Option<Exit> {
        let form = self.on_lattice.resting.form;
        let disc = |half: i64| {
            let reach = form.reach(half);
            let from = course
                .members
                .iter()
                .map(|member| length(in_cells(member.0)));
            let to = course
                .goals
                .iter()
                .map(|goal| length(minus(point(goal), start)));
            from.chain(to).max().unwrap_or_default() + reach
        };
        let sweep = |half: i64| Sweep {
            shape: Shape::circle(start, disc(half)),
            line: (start, start),
            inner: 0,
        };
        let near = self.near_bodies(unit, std::iter::once(sweep(HALF)), holders);
        if !self.is_clear(&[sweep(self.on_lattice.resting.half)], &near) {
            return None;
        }
        let kind = StepKind::Fold {
            centre: pose(start, 0),
            radius: MicroUnits(disc(HALF)),
        };
        let half_way = course
            .members
            .iter()
            .zip(&course.goals)
            .map(|(&(site, heading), goal)| {
                let (from, to) = (plus(start, in_cells(site)), point(goal));
                let turned = shortest(goal.theta.0 - heading);
                let middle = (from.0.midpoint(to.0), from.1.midpoint(to.1));
                pose(middle, shortest(heading + turned / 2))
            });
        let steps = [half_way.collect(), course.goals.clone()];
        let steps = steps.map(|poses| ExitStep { kind, poses }).into();
        Some(self.exit(
            unit,
            cell,
            steps,
            std::iter::once(sweep(HALF).shape),
            holders,
        ))
    }

    /// The units whose bodies rest near what an exit sweeps.
    fn near_bodies(
        &self,
        unit: usize,
        sweeps: impl Iterator<Item = Sweep>,
        holders: &[Vec<usize>],
    ) -> Vec<usize> {
        let bounds = sweeps.map(|sweep| sweep.shape.bounds()).reduce(hull);
        let (lattice, arena) = (&self.on_lattice.lattice, &self.on_lattice.arena);
        let cells = bounds.map(|(low, high)| arena.cells_between(lattice.covered(low, high)));
        let cells = cells.into_iter().flatten();
        let near: BTreeSet<usize> = cells.flat_map(|cell| &holders[cell]).copied().collect();
        near.into_iter().filter(|&other| other != unit).collect()
    }

    /// Whether sweeps meet neither bodies of some units at rest, nor obstacles or walls.
    fn is_clear(&self, sweeps: &[Sweep], near: &[usize]) -> bool {
        let (half, form) = (self.on_lattice.resting.half, self.on_lattice.resting.form);
        let mut bodies = near.iter().flat_map(|&other| self.goals(other));
        let meets = |sweep: &Sweep, goal: &Pose| {
            let between = distance(point(goal), sweep.line);
            if between < sweep.inner + half - form.tolerance {
                return true;
            }
            let body = form.shape(point(goal), goal.theta.0, half);
            sweep.shape.overlaps(&body, form.tolerance)
        };
        let is_open = |sweep: &Sweep| self.on_lattice.is_clear_of_obstacles(&sweep.shape);
        !bodies.any(|goal| sweeps.iter().any(|sweep| meets(sweep, &goal)))
            && sweeps.iter().all(is_open)
    }

    /// What the bodies of a unit sweep on a leg.
    fn sweeps(&self, course: &Course, leg: Leg, half: i64) -> Vec<Sweep> {
        let form = self.on_lattice.resting.form;
        match leg {
            Leg::Turn { at, .. } => vec![Sweep {
                shape: Shape::circle(at, self.radius(course, half)),
                line: (at, at),
                inner: half,
            }],
            Leg::Shift { from, to, turned } => {
                let members = course.members.iter().map(|&(site, heading)| {
                    let offset = rotated(in_cells(site), turned);
                    let line = (plus(from, offset), plus(to, offset));
                    Sweep {
                        shape: form.shape(line.0, heading + turned, half).moved(line),
                        line,
                        inner: half,
                    }
                });
                members.collect()
            }
        }
    }

    /// How far a unit that turns about its middle reaches.
    fn radius(&self, course: &Course, half: i64) -> i64 {
        let form = self.on_lattice.resting.form;
        let reach = |&((x, y), _): &(Site, i64)| {
            let (right, up) = in_cells((x.abs(), y.abs()));
            if form.is_round {
                length((right, up)) + half
            } else {
                length((right + half, up + half)) + 1
            }
        };
        course.members.iter().map(reach).max().unwrap_or_default()
    }

    fn steps(&self, course: &Course, legs: &[Leg]) -> Vec<ExitStep> {
        let parts_of = |leg: &Leg| match *leg {
            Leg::Turn { .. } => 1,
            Leg::Shift { from, to, .. } => {
                (length(minus(to, from)) - self.tolerance() - 1).max(0) / MICRO_PER_UNIT + 1
            }
        };
        let count: i64 = legs.iter().map(parts_of).sum();
        let mut steps = Vec::new();
        for leg in legs {
            let parts = if count == 1 { 2 } else { parts_of(leg) };
            for part in 1..=parts {
                let share = |whole: i64| whole * part / parts;
                let (middle, turned, kind) = match *leg {
                    Leg::Turn { at, by } => {
                        let part = share(by) - by * (part - 1) / parts;
                        let kind = StepKind::Turn {
                            centre: pose(at, part),
                            radius: MicroUnits(self.radius(course, HALF)),
                        };
                        (at, share(by), kind)
                    }
                    Leg::Shift { from, to, turned } => {
                        let by = minus(to, from);
                        let middle = plus(from, (share(by.0), share(by.1)));
                        (middle, turned, StepKind::Shift)
                    }
                };
                let at = course.members.iter().map(|&(site, heading)| {
                    let offset = rotated(in_cells(site), turned);
                    pose(plus(middle, offset), shortest(heading + turned))
                });
                let poses = at.collect();
                steps.push(ExitStep { kind, poses });
            }
        }
        if let Some(last) = steps.last_mut() {
            last.poses.clone_from(&course.goals);
        }
        steps
    }

    fn exit(
        &self,
        unit: usize,
        cell: usize,
        steps: Vec<ExitStep>,
        sweeps: impl Iterator<Item = Shape>,
        holders: &[Vec<usize>],
    ) -> Exit {
        let (lattice, arena) = (&self.on_lattice.lattice, &self.on_lattice.arena);
        let under = |shape: Shape| cells_under(&shape, lattice, arena, self.tolerance());
        let swept: BTreeSet<usize> = sweeps.flat_map(under).collect();
        let is_free = |cell: &usize| holders[*cell].iter().all(|&it| it == unit);
        let others = swept.iter().flat_map(|&cell| &holders[cell]);
        let after: BTreeSet<usize> = others
            .copied()
            .filter(|&other| other != unit && !self.units[other].stays)
            .collect();
        let rest = self.on_lattice.cells_at_rest(&self.units[unit]);
        Exit {
            cell,
            steps,
            rest: rest.into_iter().filter(is_free).collect(),
            swept: swept.into_iter().filter(is_free).collect(),
            after: after.into_iter().collect(),
        }
    }
}

/// Whether all cells of a layout around a cell are free.
fn fits(layout: &Layout, (x, y): Site, is_free: impl Fn(Site) -> bool) -> bool {
    let mut sites = layout.sites.iter();
    sites.all(|site| is_free((x + site.0, y + site.1)))
}

fn middle_of(goals: &[Pose]) -> Point {
    let count = i64::try_from(goals.len()).unwrap_or(i64::MAX).max(1);
    let sum = goals.iter().map(point).fold((0, 0), plus);
    (sum.0 / count, sum.1 / count)
}

/// The ways from one point to another, turning by some angle before or after: straight, or along one axis after the other.
fn ways(start: Point, target: Point, by: i64, tolerance: i64) -> Vec<Vec<Leg>> {
    let mut ways = Vec::new();
    // Turned before it shifts, or turned after.
    let turns: &[bool] = if by == 0 { &[true] } else { &[true, false] };
    for &is_first in turns {
        let turned = if is_first { by } else { 0 };
        let turn = |at| (by != 0).then_some(Leg::Turn { at, by });
        let way = |corners: &[Point]| -> Vec<Leg> {
            let shifts = corners.windows(2).map(|ends| Leg::Shift {
                from: ends[0],
                to: ends[1],
                turned,
            });
            let before = turn(start).filter(|_| is_first);
            let after = turn(target).filter(|_| !is_first);
            before.into_iter().chain(shifts).chain(after).collect()
        };
        let whole = minus(target, start);
        let (ahead, aside) = rotated(whole, -turned);
        if length(whole) <= tolerance && by != 0 {
            ways.push(way(&[start]));
            continue;
        }
        ways.push(way(&[start, target]));
        if ahead.abs().min(aside.abs()) > tolerance {
            for part in [(ahead, 0), (0, aside)] {
                ways.push(way(&[start, plus(start, rotated(part, turned)), target]));
            }
        }
    }
    ways
}
