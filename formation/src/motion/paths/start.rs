//! From real start poses onto the lattice.
//!
//! Modules that are docked to each other at the start are one *group*. A group turns in place until its headings are
//! quarter turns, then shifts along x, then along y, to the cells under its modules. If the bodies do not overlap at
//! the start, and no other body reaches into the circle of a group that turns, then no two groups meet: rounding
//! keeps the order of two bodies in a row, and a group that moves to the right waits for the one on its right.

use std::fmt;

use super::lattice::{Lattice, Point, Site, Time, point};
use super::turning::{angle_of, by_quarters, off_quarter, quarters, rotated, shortest};
use crate::model::{MICRO_PER_UNIT, MicroUnits, ModuleId, PlanningProblem, Pose};

/// What keeps a module from a start without contact.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StartFault {
    /// The bodies overlap, or one reaches into the circle in which the other turns.
    NotApart(ModuleId, ModuleId),
    /// The two come to the same cell, or need each other's place on their way to it.
    SharedCell(ModuleId, ModuleId),
    /// The module is docked to others but not on a common lattice with the first of them.
    OffGroup(ModuleId, ModuleId),
    /// The module stands on an obstacle or beyond the walls.
    Covered(ModuleId),
}

impl fmt::Display for StartFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotApart(one, other) => write!(formatter, "{one} and {other} are too close"),
            Self::SharedCell(one, other) => write!(formatter, "{one} and {other} contest a cell"),
            Self::OffGroup(module, first) => {
                write!(
                    formatter,
                    "{module} is docked but off the lattice of {first}"
                )
            }
            Self::Covered(module) => {
                write!(formatter, "{module} is on an obstacle or beyond the walls")
            }
        }
    }
}

impl StartFault {
    /// The modules that the fault names.
    #[must_use]
    pub fn modules(&self) -> Vec<ModuleId> {
        match *self {
            Self::NotApart(one, other) | Self::SharedCell(one, other) => vec![one, other],
            Self::OffGroup(module, _) | Self::Covered(module) => vec![module],
        }
    }
}

/// The phases in which a group comes onto the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Phase {
    Turn,
    Column,
    Row,
}

/// One step of a group onto the lattice.
#[derive(Clone, Debug)]
pub(super) struct Alignment {
    pub phase: Phase,
    pub begin: Time,
    /// The groups that are waited for, and how many of their steps.
    pub waits: Vec<(usize, u32)>,
}

/// Modules that are docked to each other at the start, or a single one.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// Positions in the problem, ascending.
    pub modules: Vec<usize>,
    /// About this point it turns.
    pub centre: Point,
    /// How far its corners reach from the centre.
    pub radius: i64,
    /// By how much it turns.
    pub turn: i64,
    /// The modules' cells relative to the centre after the turn.
    pub offsets: Vec<Site>,
    /// From the centre to the middle of the cell under it.
    shift: Point,
    /// The cell under the centre.
    pub site: Site,
    pub steps: Vec<Alignment>,
}

type Rectangle = (Point, Point);

fn overlap(one: &Rectangle, other: &Rectangle, slack: i64) -> bool {
    one.0.0 + slack < other.1.0
        && other.0.0 + slack < one.1.0
        && one.0.1 + slack < other.1.1
        && other.0.1 + slack < one.1.1
}

fn hull(one: Rectangle, other: Rectangle) -> Rectangle {
    (
        (one.0.0.min(other.0.0), one.0.1.min(other.0.1)),
        (one.1.0.max(other.1.0), one.1.1.max(other.1.1)),
    )
}

const HALF: i64 = MICRO_PER_UNIT / 2;

fn square(middle: Point) -> Rectangle {
    (
        (middle.0 - HALF, middle.1 - HALF),
        (middle.0 + HALF, middle.1 + HALF),
    )
}

impl Group {
    /// The group of some modules; `spots` gives the pose of the spot of each module that the whole group moves to as
    /// one unit.
    fn of(
        problem: &PlanningProblem,
        modules: Vec<usize>,
        spots: Option<&[Pose]>,
        lattice: &Lattice,
        tolerance: i64,
    ) -> Result<Self, StartFault> {
        let all = problem.modules();
        let first = &all[modules[0]].pose;
        let off = off_quarter(first.theta.0);
        let mut cells = Vec::with_capacity(modules.len());
        for &module in &modules {
            let pose = &all[module].pose;
            let offset = rotated((pose.x.0 - first.x.0, pose.y.0 - first.y.0), -off);
            let cell = |along: i64| (along + HALF).div_euclid(MICRO_PER_UNIT);
            let site = (cell(offset.0), cell(offset.1));
            let is_off = |along: i64, cell: i64| (along - cell * MICRO_PER_UNIT).abs() > tolerance;
            if is_off(offset.0, site.0)
                || is_off(offset.1, site.1)
                || off_quarter(pose.theta.0 - off).abs() > tolerance
            {
                return Err(StartFault::OffGroup(all[module].id, all[modules[0]].id));
            }
            cells.push(site);
        }
        let (middle, reach) = centre_of(&cells);
        let turns = off.abs() > tolerance;
        let extra = match spots {
            Some(spots) if turns => extra_quarters(first, &cells, spots).unwrap_or_default(),
            _ => 0,
        };
        let centre = point(&all[modules[middle]].pose);
        let base = cells[middle];
        let offsets = cells
            .iter()
            .map(|cell| by_quarters((cell.0 - base.0, cell.1 - base.1), extra))
            .collect();
        let site = lattice.site(centre);
        let under = lattice.point(site);
        Ok(Self {
            centre,
            radius: reach,
            turn: if turns {
                shortest(angle_of(extra) - off)
            } else {
                0
            },
            offsets,
            shift: (under.0 - centre.0, under.1 - centre.1),
            site,
            modules,
            steps: Vec::new(),
        })
    }

    /// A pinned module on its spot.
    fn standing(module: usize, site: Site, lattice: &Lattice) -> Self {
        Self {
            modules: vec![module],
            centre: lattice.point(site),
            radius: 0,
            turn: 0,
            offsets: vec![(0, 0)],
            shift: (0, 0),
            site,
            steps: Vec::new(),
        }
    }

    /// The heading of a module after the turn.
    pub fn heading(&self, theta: i64) -> i64 {
        shortest(angle_of(quarters(theta + self.turn)))
    }

    /// Where a member is after a phase.
    pub fn position_after(&self, member: usize, phase: Phase) -> Point {
        let offset = self.offsets[member];
        let mut middle = (
            self.centre.0 + offset.0 * MICRO_PER_UNIT,
            self.centre.1 + offset.1 * MICRO_PER_UNIT,
        );
        if phase >= Phase::Column {
            middle.0 += self.shift.0;
        }
        if phase >= Phase::Row {
            middle.1 += self.shift.1;
        }
        middle
    }

    /// The cell of a member on the lattice.
    pub fn site_of(&self, member: usize) -> Site {
        (
            self.site.0 + self.offsets[member].0,
            self.site.1 + self.offsets[member].1,
        )
    }

    fn circle(&self) -> Rectangle {
        let (centre, radius) = (self.centre, self.radius);
        (
            (centre.0 - radius, centre.1 - radius),
            (centre.0 + radius, centre.1 + radius),
        )
    }

    /// Rectangles that hold the bodies throughout a phase; none if the group has no such step.
    pub fn swept(&self, phase: Phase) -> Vec<Rectangle> {
        if !self.steps.iter().any(|step| step.phase == phase) {
            return Vec::new();
        }
        let members = 0..self.offsets.len();
        match phase {
            Phase::Turn => vec![self.circle()],
            Phase::Column | Phase::Row => members
                .map(|member| {
                    let before = if phase == Phase::Row {
                        Phase::Column
                    } else {
                        Phase::Turn
                    };
                    hull(
                        square(self.position_after(member, before)),
                        square(self.position_after(member, phase)),
                    )
                })
                .collect(),
        }
    }

    /// A rectangle that holds the bodies from the start until they are on the lattice.
    fn surroundings(&self) -> Rectangle {
        let ends = (0..self.offsets.len()).flat_map(|member| {
            [Phase::Turn, Phase::Row].map(|phase| square(self.position_after(member, phase)))
        });
        let squares = ends.reduce(hull).unwrap_or_else(|| square(self.centre));
        if self.turn == 0 {
            squares
        } else {
            hull(squares, self.circle())
        }
    }

    /// When the group is on the lattice.
    pub fn ready(&self) -> Time {
        self.steps.last().map_or(0, |step| step.begin + 1)
    }
}

/// The member that is nearest to all others, and how far their corners reach from its middle, rounded up.
fn centre_of(cells: &[Site]) -> (usize, i64) {
    let reach = |&(x, y): &Site| {
        let corner = |other: &Site| {
            let (right, up) = (2 * (other.0 - x).abs() + 1, 2 * (other.1 - y).abs() + 1);
            right * right + up * up
        };
        cells.iter().map(corner).max().unwrap_or_default()
    };
    let nearest = (0..cells.len()).min_by_key(|&member| (reach(&cells[member]), member));
    let member = nearest.unwrap_or_default();
    let square = i128::from(reach(&cells[member])) * i128::from(HALF) * i128::from(HALF);
    (
        member,
        i64::try_from(square.isqrt() + 1).unwrap_or(i64::MAX),
    )
}

/// The quarter turns, beyond those to the nearest axes, that bring a group into the layout of its spots.
fn extra_quarters(first: &Pose, cells: &[Site], spots: &[Pose]) -> Option<i64> {
    if cells.len() == 1 {
        return Some(quarters(spots[0].theta.0) - quarters(first.theta.0));
    }
    let (cell, spot) = (cells[0], &spots[0]);
    [0, 1, -1, 2].into_iter().find(|&extra| {
        cells.iter().zip(spots).all(|(other, goal)| {
            let turned = by_quarters((other.0 - cell.0, other.1 - cell.1), extra);
            let units = |along: i64| (along + HALF).div_euclid(MICRO_PER_UNIT);
            turned == (units(goal.x.0 - spot.x.0), units(goal.y.0 - spot.y.0))
        })
    })
}

/// Groups the modules that are not pinned, checks that they start apart, and plans their steps onto the lattice.
///
/// `spots_of` gives the poses of the spots of a group's modules if they are one unit of the plan.
pub(super) fn align(
    problem: &PlanningProblem,
    lattice: &Lattice,
    tolerance: MicroUnits,
    spots_of: impl Fn(&[usize]) -> Option<Vec<Pose>>,
) -> Result<Vec<Group>, Vec<StartFault>> {
    let mut groups = Vec::new();
    let mut faults = Vec::new();
    let mut is_grouped = vec![false; problem.modules().len()];
    for configuration in problem.configurations() {
        let members = configuration.modules.iter();
        let modules: Vec<usize> = members.filter_map(|&id| problem.position_of(id)).collect();
        for &module in &modules {
            is_grouped[module] = true;
        }
        let spots = spots_of(&modules);
        match Group::of(problem, modules, spots.as_deref(), lattice, tolerance.0) {
            Ok(group) => groups.push(group),
            Err(fault) => faults.push(fault),
        }
    }
    for (module, member) in problem.modules().iter().enumerate() {
        if let Some(spot) = member.pin.and_then(|pin| problem.target().spot(pin)) {
            groups.push(Group::standing(
                module,
                lattice.site(point(&spot.pose)),
                lattice,
            ));
            continue;
        }
        if is_grouped[module] {
            continue;
        }
        let spots = spots_of(&[module]);
        match Group::of(
            problem,
            vec![module],
            spots.as_deref(),
            lattice,
            tolerance.0,
        ) {
            Ok(group) => groups.push(group),
            Err(fault) => faults.push(fault),
        }
    }
    groups.sort_by_key(|group| group.modules[0]);
    for group in &mut groups {
        let moves = [
            (Phase::Turn, group.turn),
            (Phase::Column, group.shift.0),
            (Phase::Row, group.shift.1),
        ];
        let needed = moves.into_iter().filter(|&(_, by)| by.abs() > tolerance.0);
        group.steps = needed
            .map(|(phase, _)| Alignment {
                phase,
                begin: 0,
                waits: Vec::new(),
            })
            .collect();
    }
    let pairs = near_pairs(&groups);
    faults.extend(
        pairs.iter().filter_map(|&(one, other)| {
            not_apart(problem, &groups[one], &groups[other], tolerance.0)
        }),
    );
    if faults.is_empty() {
        faults = schedule(problem, &mut groups, &pairs, tolerance.0);
    }
    if faults.is_empty() {
        Ok(groups)
    } else {
        Err(faults)
    }
}

/// The pairs of groups whose surroundings overlap, lower first.
fn near_pairs(groups: &[Group]) -> Vec<(usize, usize)> {
    let surroundings: Vec<Rectangle> = groups.iter().map(Group::surroundings).collect();
    let mut by_left: Vec<usize> = (0..groups.len()).collect();
    by_left.sort_unstable_by_key(|&group| (surroundings[group].0.0, group));
    let mut pairs = Vec::new();
    for (rank, &one) in by_left.iter().enumerate() {
        for &other in &by_left[rank + 1..] {
            if surroundings[other].0.0 > surroundings[one].1.0 {
                break;
            }
            if overlap(&surroundings[one], &surroundings[other], 0) {
                pairs.push((one.min(other), one.max(other)));
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

/// What is wrong with the distance of two groups, if anything.
fn not_apart(
    problem: &PlanningProblem,
    one: &Group,
    other: &Group,
    tolerance: i64,
) -> Option<StartFault> {
    let id = |group: &Group, member: usize| problem.modules()[group.modules[member]].id;
    let squared = |right: i64, up: i64| i128::from(right).pow(2) + i128::from(up).pow(2);
    let within = |square: i128, reach: i64| square < i128::from((reach - tolerance).max(0)).pow(2);
    if one.turn != 0 && other.turn != 0 {
        let (right, up) = (one.centre.0 - other.centre.0, one.centre.1 - other.centre.1);
        return within(squared(right, up), one.radius + other.radius)
            .then(|| StartFault::NotApart(id(one, 0), id(other, 0)));
    }
    if one.turn != 0 || other.turn != 0 {
        let (turning, still) = if one.turn != 0 {
            (one, other)
        } else {
            (other, one)
        };
        return (0..still.offsets.len()).find_map(|member| {
            let middle = still.position_after(member, Phase::Turn);
            let gap = |from: i64, to: i64| ((from - to).abs() - HALF).max(0);
            let (right, up) = (
                gap(middle.0, turning.centre.0),
                gap(middle.1, turning.centre.1),
            );
            within(squared(right, up), turning.radius)
                .then(|| StartFault::NotApart(id(turning, 0), id(still, member)))
        });
    }
    let all = (0..one.offsets.len())
        .flat_map(|member| (0..other.offsets.len()).map(move |beside| (member, beside)));
    all.into_iter().find_map(|(member, beside)| {
        let body = square(one.position_after(member, Phase::Turn));
        let neighbour = square(other.position_after(beside, Phase::Turn));
        if overlap(&body, &neighbour, tolerance) {
            return Some(StartFault::NotApart(id(one, member), id(other, beside)));
        }
        (one.site_of(member) == other.site_of(beside))
            .then(|| StartFault::SharedCell(id(one, member), id(other, beside)))
    })
}

/// Sets begins and waits: a step waits for the earlier phases of groups in its way and, within a phase, for the group
/// in front.
fn schedule(
    problem: &PlanningProblem,
    groups: &mut [Group],
    pairs: &[(usize, usize)],
    tolerance: i64,
) -> Vec<StartFault> {
    let mut waits: Vec<(usize, Phase, usize, Phase)> = Vec::new();
    for &(one, other) in pairs {
        for (waiting, first) in [(one, other), (other, one)] {
            for phase in [Phase::Turn, Phase::Column, Phase::Row] {
                let swept = groups[waiting].swept(phase);
                let meets = |rectangles: &[Rectangle]| {
                    let slack = tolerance;
                    swept
                        .iter()
                        .any(|body| rectangles.iter().any(|rest| overlap(body, rest, slack)))
                };
                let earlier = [Phase::Turn, Phase::Column]
                    .into_iter()
                    .filter(|&it| it < phase);
                let last = earlier.filter(|&it| meets(&groups[first].swept(it))).last();
                if let Some(last) = last {
                    waits.push((waiting, phase, first, last));
                }
                if phase != Phase::Turn && must_follow(&groups[waiting], &groups[first], phase) {
                    waits.push((waiting, phase, first, phase));
                }
            }
        }
    }
    let index = |group: &Group, phase: Phase| group.steps.iter().position(|it| it.phase == phase);
    for _ in 0..=3 * groups.len() {
        let mut changed = None;
        for group in groups.iter_mut() {
            for step in 1..group.steps.len() {
                group.steps[step].begin =
                    group.steps[step].begin.max(group.steps[step - 1].begin + 1);
            }
        }
        for &(waiting, phase, first, last) in &waits {
            let (Some(step), Some(awaited)) =
                (index(&groups[waiting], phase), index(&groups[first], last))
            else {
                continue;
            };
            let earliest = groups[first].steps[awaited].begin + 1;
            if groups[waiting].steps[step].begin < earliest {
                groups[waiting].steps[step].begin = earliest;
                changed = Some((waiting, first));
            }
        }
        if changed.is_none() {
            for &(waiting, phase, first, last) in &waits {
                let found = (index(&groups[waiting], phase), index(&groups[first], last));
                if let (Some(step), Some(awaited)) = found {
                    let count = u32::try_from(awaited + 1).unwrap_or(u32::MAX);
                    groups[waiting].steps[step].waits.push((first, count));
                }
            }
            return Vec::new();
        }
    }
    // Only groups that reach around each other can wait for each other in a circle.
    let stuck = pairs.iter().map(|&(one, other)| {
        let id = |group: usize| problem.modules()[groups[group].modules[0]].id;
        StartFault::SharedCell(id(one), id(other))
    });
    stuck.collect()
}

/// Whether a group that shifts in a phase would reach the place that another leaves in the same phase.
fn must_follow(group: &Group, ahead: &Group, phase: Phase) -> bool {
    let before = if phase == Phase::Row {
        Phase::Column
    } else {
        Phase::Turn
    };
    let along = |point: Point| {
        if phase == Phase::Row {
            point.1
        } else {
            point.0
        }
    };
    let (shift, shift_ahead) = (along(group.shift), along(ahead.shift));
    if shift.signum() * shift_ahead.signum() != 1 {
        return false;
    }
    let bodies = |of: &Group, phase: Phase| -> Vec<Rectangle> {
        (0..of.offsets.len())
            .map(|member| square(of.position_after(member, phase)))
            .collect()
    };
    let rest = bodies(ahead, before);
    bodies(group, phase)
        .iter()
        .any(|body| rest.iter().any(|other| overlap(body, other, 0)))
}
