//! Groups: modules that are docked to each other at the start and come onto the lattice as one body.

use std::collections::BTreeSet;

use super::fit::Measured;
use super::lattice::{Lattice, Site, Time, nearest_to_all, point, reach};
use super::rectangle::{HALF, Rectangle, hull, square};
use super::shape::Shape;
use formation_model::turning::{
    Point, angle_of, by_quarters, off_quarter, quarters, rotated, shortest,
};
use formation_model::{MICRO_PER_UNIT, PlanningProblem, Pose};

/// The phases in which a group comes onto the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Phase {
    /// Each module goes to its own cell.
    Regroup,
    Turn,
    Column,
    Row,
}

impl Phase {
    /// All phases, in order.
    pub const ALL: [Self; 4] = [Self::Regroup, Self::Turn, Self::Column, Self::Row];

    /// The phase before a shift.
    pub fn before_shift(self) -> Self {
        if self == Self::Row {
            Self::Column
        } else {
            Self::Turn
        }
    }
}

/// One step of a group onto the lattice.
#[derive(Clone, Debug)]
pub(super) struct Alignment {
    pub phase: Phase,
    pub begin: Time,
    /// The groups that are waited for, and how many of their steps.
    pub waits: Vec<(usize, u32)>,
}

impl Alignment {
    /// A step that waits for no other group so far.
    pub fn at_once(phase: Phase) -> Self {
        Self {
            phase,
            begin: 0,
            waits: Vec::new(),
        }
    }
}

/// How exactly modules stand at the start.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exactness {
    /// A deviation up to this needs no step.
    pub tolerance: i64,
    /// How far cells of bodies that count as apart may overlap, and how far a module may be turned without needing the
    /// circle around it; at least the tolerance.
    pub slack: i64,
}

/// Docked modules whose offsets and headings are off by no more than this, in units and radians, are one body: they were
/// halted at slightly different moments.
const ASKEW_MAX: i64 = 100_000;

/// Modules that are docked to each other at the start, or a single one.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// Positions in the problem, ascending.
    pub modules: Vec<usize>,
    /// About this point it turns.
    pub centre: Point,
    /// How far its cells reach from the centre in line, and its bodies where they are.
    pub radius: i64,
    /// By how much it turns.
    pub turn: i64,
    /// The modules' cells relative to the centre after the turn.
    pub offsets: Vec<Site>,
    /// From the centre to the middle of the cell under it.
    pub shift: Point,
    /// The cell under the centre.
    pub site: Site,
    pub steps: Vec<Alignment>,
    /// Where its modules are, if they have to come into line with each other in their first step.
    measured: Vec<Point>,
    /// If they regroup, or shift before they turn: what the body of each module sweeps.
    pub ways: Vec<Shape>,
    /// If they shift as one body before they turn: where each is then.
    entered: Vec<Point>,
    /// What a module that stays covers off the lattice.
    pub at_rest: Option<Shape>,
}

/// How far the corners of a single module's cell reach from its middle.
const RADIUS_OF_ONE: i64 = 707_107;

impl Group {
    /// The group of some modules; `spots` gives the pose of the spot of each module that the whole group moves to as
    /// one unit. None if the modules stand off a common lattice, or where they cannot be docked to each other.
    pub fn of(
        problem: &PlanningProblem,
        modules: Vec<usize>,
        spots: Option<&[Pose]>,
        lattice: &Lattice,
        Exactness { tolerance, slack }: Exactness,
    ) -> Option<Self> {
        let all = problem.modules();
        let first = &all[modules[0]].pose;
        let mut off = off_quarter(first.theta.0);
        let mut cells = Vec::with_capacity(modules.len());
        let mut offsets = Vec::with_capacity(modules.len());
        let mut is_askew = false;
        for &module in &modules {
            let pose = &all[module].pose;
            let offset = rotated((pose.x.0 - first.x.0, pose.y.0 - first.y.0), -off);
            let cell = |along: i64| (along + HALF).div_euclid(MICRO_PER_UNIT);
            let site = (cell(offset.0), cell(offset.1));
            let right = offset.0 - site.0 * MICRO_PER_UNIT;
            let up = offset.1 - site.1 * MICRO_PER_UNIT;
            let turned = off_quarter(pose.theta.0 - off);
            is_askew |= [right, up, turned].iter().any(|by| by.abs() > tolerance);
            if cells.contains(&site) {
                // Half-way through a fold, two modules may be above each other.
                return None;
            }
            cells.push(site);
            offsets.push(offset);
        }
        if !is_in_one_piece(&cells) {
            return None;
        }
        let (middle, reach) = centre_of(&cells);
        let mut centre = point(&all[modules[middle]].pose);
        let mut radius = reach;
        if is_askew {
            let headings = modules.iter().map(|&module| all[module].pose.theta.0);
            let headings: Vec<i64> = headings.collect();
            let is_straight = headings.iter().all(|&it| off_quarter(it).abs() <= slack);
            let measured = Measured {
                cells: &cells,
                offsets: &offsets,
                headings: &headings,
                off,
            };
            // Modules that were halted at different moments of a shift have not turned, wherever they are.
            let straight = is_straight.then(|| (measured.fit(middle, Some(-off)), ASKEW_MAX));
            let most = if is_straight { slack } else { ASKEW_MAX };
            let turned = (measured.fit(middle, None), most);
            let mut fits = straight.into_iter().chain([turned]);
            let (fit, _) = fits.find(|(fit, most)| measured.farthest(fit) <= *most)?;
            let (right, up) = rotated(fit.offset, off);
            centre = (first.x.0 + right, first.y.0 + up);
            radius = reach.max(reach_of_bodies(problem, &modules, centre));
            off += fit.turned;
        }
        // The farthest corner of a group moves no farther than that of a single module that is turned by the slack.
        let turns = off.abs() > tolerance.max(slack * RADIUS_OF_ONE / reach);
        is_askew |= off.abs() > tolerance && !turns;
        let extra = match spots {
            Some(spots) if turns => extra_quarters(first, &cells, spots).unwrap_or_default(),
            _ => 0,
        };
        let base = cells[middle];
        let offsets = cells
            .iter()
            .map(|cell| by_quarters((cell.0 - base.0, cell.1 - base.1), extra))
            .collect();
        let site = lattice.site(centre);
        let under = lattice.point(site);
        Some(Self {
            centre,
            radius,
            turn: if turns {
                shortest(angle_of(extra) - off)
            } else {
                0
            },
            offsets,
            shift: (under.0 - centre.0, under.1 - centre.1),
            site,
            measured: match is_askew {
                true => modules.iter().map(|&it| point(&all[it].pose)).collect(),
                false => Vec::new(),
            },
            modules,
            steps: Vec::new(),
            ways: Vec::new(),
            entered: Vec::new(),
            at_rest: None,
        })
    }

    /// A pinned module on its spot.
    pub fn standing(module: usize, site: Site, lattice: &Lattice) -> Self {
        Self {
            modules: vec![module],
            centre: lattice.point(site),
            radius: 0,
            turn: 0,
            offsets: vec![(0, 0)],
            shift: (0, 0),
            site,
            steps: Vec::new(),
            measured: Vec::new(),
            ways: Vec::new(),
            entered: Vec::new(),
            at_rest: None,
        }
    }

    /// Modules that go to these cells.
    pub fn regrouped(
        modules: Vec<usize>,
        sites: &[Site],
        ways: Vec<Shape>,
        lattice: &Lattice,
    ) -> Self {
        let site = sites[0];
        let offset = |other: &Site| (other.0 - site.0, other.1 - site.1);
        Self {
            offsets: sites.iter().map(offset).collect(),
            ways,
            modules,
            ..Self::standing(0, site, lattice)
        }
    }

    /// The group turns by an angle when it has regrouped.
    pub fn turning(self, turn: i64, radius: i64) -> Self {
        Self {
            turn,
            radius,
            ..self
        }
    }

    /// The same group, which shifts as it is until its centre is in the middle of a cell, sweeping these ways, and turns there.
    pub fn entering(&self, site: Site, centre: Point, ends: Vec<Point>, ways: Vec<Shape>) -> Self {
        Self {
            site,
            centre,
            shift: (0, 0),
            measured: Vec::new(),
            entered: ends,
            ways,
            ..self.clone()
        }
    }

    /// Whether its modules shift as one body in their first step.
    pub fn enters(&self) -> bool {
        !self.entered.is_empty()
    }

    /// Whether its modules have to come into line with each other in their first step.
    pub fn is_askew(&self) -> bool {
        !self.measured.is_empty()
    }

    /// The heading of a module after a phase.
    pub fn heading_after(&self, theta: i64, phase: Phase) -> i64 {
        if phase == Phase::Regroup && self.turn != 0 {
            theta
        } else {
            self.heading(theta)
        }
    }

    /// The heading of a module after the turn.
    pub fn heading(&self, theta: i64) -> i64 {
        shortest(angle_of(quarters(theta + self.turn)))
    }

    /// Where a member is after a phase.
    pub fn position_after(&self, member: usize, phase: Phase) -> Point {
        if phase == Phase::Regroup
            && let Some(&end) = self.entered.get(member)
        {
            return end;
        }
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

    /// Where a member is before it shifts in a phase.
    pub fn position_before(&self, member: usize, phase: Phase) -> Point {
        let is_first = self.steps.first().is_none_or(|step| step.phase == phase);
        let measured = self.measured.get(member).filter(|_| is_first);
        measured.map_or_else(
            || self.position_after(member, phase.before_shift()),
            |it| *it,
        )
    }

    /// The cell of a member on the lattice.
    pub fn site_of(&self, member: usize) -> Site {
        (
            self.site.0 + self.offsets[member].0,
            self.site.1 + self.offsets[member].1,
        )
    }

    fn circle(&self) -> Shape {
        Shape::circle(self.centre, self.radius)
    }

    /// What holds the bodies throughout a phase; nothing if the group has no such step.
    pub fn swept(&self, phase: Phase) -> Vec<Shape> {
        if !self.steps.iter().any(|step| step.phase == phase) {
            return Vec::new();
        }
        let members = 0..self.offsets.len();
        match phase {
            Phase::Regroup => self.ways.clone(),
            Phase::Turn => vec![self.circle()],
            Phase::Column | Phase::Row => members
                .map(|member| {
                    let from = self.position_before(member, phase);
                    Shape::square(from, HALF).moved((from, self.position_after(member, phase)))
                })
                .collect(),
        }
    }

    /// What the group covers before it shifts: the circle in which it turns, what its modules sweep while they regroup, or
    /// their cells, from where they are to where they are in line.
    pub fn bodies(&self) -> Vec<Shape> {
        if !self.ways.is_empty() {
            return self.ways.clone();
        }
        if let Some(shape) = &self.at_rest {
            return vec![shape.clone()];
        }
        if self.turn != 0 {
            return vec![self.circle()];
        }
        let members = 0..self.offsets.len();
        members
            .map(|member| {
                let in_line = self.position_after(member, Phase::Turn);
                let from = self.measured.get(member).map_or(in_line, |it| *it);
                Shape::square(from, HALF).moved((from, in_line))
            })
            .collect()
    }

    /// What the group covers until it is on the lattice.
    pub fn on_the_way(&self) -> Vec<Shape> {
        let mut all = self.bodies();
        if self.ways.is_empty() {
            for member in 0..self.offsets.len() {
                let ends = [Phase::Turn, Phase::Column, Phase::Row]
                    .map(|phase| self.position_after(member, phase));
                let shifts = ends.windows(2).map(|ends| (ends[0], ends[1]));
                all.extend(shifts.map(|line| Shape::square(line.0, HALF).moved(line)));
            }
        }
        all
    }

    /// A rectangle that holds the bodies from the start until they are on the lattice.
    pub fn surroundings(&self) -> Rectangle {
        let ends = (0..self.offsets.len()).flat_map(|member| {
            [Phase::Turn, Phase::Row].map(|phase| square(self.position_after(member, phase)))
        });
        let bodies = self.bodies().into_iter().map(|body| body.bounds());
        let all = ends.chain(bodies).reduce(hull);
        all.unwrap_or_else(|| square(self.centre))
    }

    /// When the group is on the lattice.
    pub fn ready(&self) -> Time {
        self.steps.last().map_or(0, |step| step.begin + 1)
    }
}

/// How far the corners of bodies reach from a point, rounded up.
fn reach_of_bodies(problem: &PlanningProblem, modules: &[usize], from: Point) -> i64 {
    let half = problem.target().surroundings().body_width().0 / 2;
    let corners = modules.iter().flat_map(|&module| {
        let pose = &problem.modules()[module].pose;
        let middle = (pose.x.0 - from.0, pose.y.0 - from.1);
        Shape::turned_square(middle, half, off_quarter(pose.theta.0)).into_points()
    });
    let squared = |(x, y): Point| i128::from(x).pow(2) + i128::from(y).pow(2);
    let farthest = corners.map(squared).max().unwrap_or_default();
    i64::try_from(farthest.isqrt() + 1).unwrap_or(i64::MAX)
}

/// The member that is nearest to all others, and how far their corners reach from its middle, rounded up.
fn centre_of(cells: &[Site]) -> (usize, i64) {
    let (member, reach) = nearest_to_all(cells.len(), |member| reach(cells, member));
    let square = i128::from(reach) * i128::from(HALF) * i128::from(HALF);
    let radius = i64::try_from(square.isqrt() + 1).unwrap_or(i64::MAX);
    (member, radius)
}

/// Whether each of some cells is reached from the first by neighbours.
fn is_in_one_piece(cells: &[Site]) -> bool {
    let mut left: BTreeSet<Site> = cells.iter().copied().collect();
    let mut found: Vec<Site> = cells.first().copied().into_iter().collect();
    while let Some(site) = found.pop() {
        if left.remove(&site) {
            let neighbours = [(1, 0), (0, 1), (-1, 0), (0, -1)];
            found.extend(neighbours.map(|(right, up)| (site.0 + right, site.1 + up)));
        }
    }
    left.is_empty()
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
