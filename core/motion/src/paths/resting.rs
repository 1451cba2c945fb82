//! Bodies at rest off the lattice: what they cover, and whether they have room next to each other.

use std::collections::BTreeSet;

use super::lattice::{Arena, Lattice, Site, point};
use super::rectangle::HALF;
use super::result::MotionError;
use super::shape::Shape;
use formation_model::turning::{Point, off_quarter, rotated, shortest};
use formation_model::{MICRO_PER_UNIT, MicroUnits, PlanningProblem, Pose, Target};

/// How far the members of a block may be off a common lattice.
pub(super) const RIGID: i64 = 5_000;

/// What bodies look like from above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    pub is_round: bool,
    /// Bodies that overlap by no more than this touch.
    pub tolerance: i64,
}

impl Form {
    /// The form of a target's bodies.
    pub fn of(target: &Target, tolerance: MicroUnits) -> Self {
        Self {
            is_round: target.surroundings().body().is_round(),
            tolerance: tolerance.0,
        }
    }

    /// What a body of half this width covers.
    pub fn shape(self, middle: Point, heading: i64, half: i64) -> Shape {
        if self.is_round {
            Shape::circle(middle, half)
        } else {
            Shape::turned_square(middle, half, off_quarter(heading))
        }
    }

    /// What a body as wide as a cell covers at a pose.
    pub fn cell_at(self, pose: &Pose) -> Shape {
        self.shape(point(pose), pose.theta.0, HALF)
    }

    /// How far such a body reaches from its middle.
    pub fn reach(self, half: i64) -> i64 {
        if self.is_round {
            half
        } else {
            (2 * half * half).isqrt() + 1
        }
    }
}

/// The open cells that a shape reaches into by more than the tolerance.
pub(super) fn cells_under(
    shape: &Shape,
    lattice: &Lattice,
    arena: &Arena,
    tolerance: i64,
) -> Vec<usize> {
    let (low, high) = shape.bounds();
    let mut cells = arena.cells_between(lattice.covered(low, high));
    cells.retain(|&cell| {
        let square = Shape::square(lattice.point(arena.site(cell)), HALF);
        !arena.closed[cell] && shape.overlaps(&square, tolerance)
    });
    cells
}

/// The spots of a target as bodies rest on them.
#[derive(Clone, Debug)]
pub(super) struct RestingBodies {
    pub form: Form,
    /// Which spots are reached by an exit: those off the lattice, and those whose cells such bodies reach into.
    pub is_off: Vec<bool>,
    /// Half the width with which bodies are kept apart: that of a cell, or less where spots are nearer to each other.
    pub half: i64,
}

impl RestingBodies {
    /// The bodies on some spots, of which `is_off` says which are off the lattice.
    ///
    /// # Errors
    /// Names two spots whose bodies overlap.
    pub fn of(
        target: &Target,
        lattice: &Lattice,
        sites: &[Site],
        mut is_off: Vec<bool>,
        form: Form,
    ) -> Result<Self, MotionError> {
        let spots = target.spots();
        let real = target.surroundings().body_width().0 / 2;
        let mut halves = [HALF, HALF.midpoint(real), real].into_iter();
        let mut half = halves.next().unwrap_or(real);
        let pairs = if is_off.contains(&true) {
            near_pairs(target)
        } else {
            Vec::new()
        };
        for &(one, other) in &pairs {
            let body = |spot: usize, half: i64| {
                let pose = &spots[spot].pose;
                form.shape(point(pose), pose.theta.0, half)
            };
            while body(one, half).overlaps(&body(other, half), form.tolerance) {
                half = halves
                    .next()
                    .ok_or(MotionError::BodiesOverlap(spots[one].id, spots[other].id))?;
            }
        }
        let lies_off = is_off.clone();
        for &(one, other) in &pairs {
            for (off, on) in [(one, other), (other, one)] {
                if lies_off[off] && !lies_off[on] {
                    let cell = Shape::square(lattice.point(sites[on]), HALF);
                    let body = form.cell_at(&spots[off].pose);
                    is_off[on] |= body.overlaps(&cell, form.tolerance);
                }
            }
        }
        Ok(Self { form, is_off, half })
    }

    /// Which modules that are not pinned stand on their spots off the lattice, with all that are docked to them.
    pub fn standing(&self, problem: &PlanningProblem, spot_of: &[Option<usize>]) -> Vec<bool> {
        let spots = problem.target().spots();
        let slack = slack(problem, self.form.tolerance);
        let modules = problem.modules().iter().zip(spot_of);
        let mut stands: Vec<bool> = modules
            .map(|(module, &spot)| {
                spot.is_some_and(|spot| {
                    let (goal, pose) = (&spots[spot].pose, &module.pose);
                    self.is_off[spot]
                        && module.pin.is_none()
                        && goal.distance_to(pose).0 <= slack
                        && shortest(goal.theta.0 - pose.theta.0).abs() <= slack
                })
            })
            .collect();
        for configuration in problem.configurations() {
            let members = configuration.modules.iter();
            let members: Vec<usize> = members.filter_map(|&id| problem.position_of(id)).collect();
            if !members.iter().all(|&member| stands[member]) {
                for member in members {
                    stands[member] = false;
                }
            }
        }
        stands
    }

    /// What a body on a spot covers.
    pub fn at(&self, target: &Target, spot: usize) -> Shape {
        let pose = &target.spots()[spot].pose;
        self.form.shape(point(pose), pose.theta.0, self.half)
    }

    /// What a body on a spot would cover if it were as wide as a cell.
    pub fn cell_at(&self, target: &Target, spot: usize) -> Shape {
        self.form.cell_at(&target.spots()[spot].pose)
    }
}

/// The pairs of spots whose bodies could touch, lower first.
fn near_pairs(target: &Target) -> Vec<(usize, usize)> {
    const FAR: i64 = 3 * HALF;
    let spots = target.spots();
    let at = |spot: usize| point(&spots[spot].pose);
    let mut by_column: Vec<usize> = (0..spots.len()).collect();
    by_column.sort_unstable_by_key(|&spot| (at(spot), spot));
    let mut pairs = Vec::new();
    for (rank, &one) in by_column.iter().enumerate() {
        let next = by_column[rank + 1..].iter();
        let near = next.take_while(|&&other| at(other).0 - at(one).0 < FAR);
        pairs.extend(
            near.filter(|&&other| (at(other).1 - at(one).1).abs() < FAR)
                .map(|&other| (one.min(other), one.max(other))),
        );
    }
    pairs.sort_unstable();
    pairs
}

/// How far cells of bodies that count as apart may overlap, as poses are measured: a third of what bodies leave of a cell.
pub(super) fn slack(problem: &PlanningProblem, tolerance: i64) -> i64 {
    let body_width = problem.target().surroundings().body_width().0;
    ((MICRO_PER_UNIT - body_width) / 3).max(tolerance)
}

/// The bodies on spots, and which modules stand there and are not pinned.
#[derive(Clone, Copy)]
pub(super) struct AtRest<'a> {
    pub bodies: &'a RestingBodies,
    pub stands: &'a [bool],
}

/// The cells of spots that lie on a lattice of their own, seen from the first.
pub(super) fn rigid_cells(goals: &[Pose]) -> Option<Vec<Site>> {
    let first = goals.first()?;
    let turned = off_quarter(first.theta.0);
    let sites = goals.iter().map(|goal| {
        let offset = rotated(minus(point(goal), point(first)), -turned);
        let cell = |along: i64| (along + HALF).div_euclid(MICRO_PER_UNIT);
        let site = (cell(offset.0), cell(offset.1));
        let off = minus(offset, in_cells(site));
        let is_on = off.0.abs().max(off.1.abs()) <= RIGID
            && off_quarter(goal.theta.0 - turned).abs() <= RIGID;
        is_on.then_some(site)
    });
    let sites: Vec<Site> = sites.collect::<Option<_>>()?;
    let distinct: BTreeSet<Site> = sites.iter().copied().collect();
    (distinct.len() == sites.len()).then_some(sites)
}

/// The middle of a cell, seen from that of the first.
pub(super) fn in_cells((x, y): Site) -> Point {
    (x * MICRO_PER_UNIT, y * MICRO_PER_UNIT)
}

pub(super) fn minus(one: Point, other: Point) -> Point {
    (one.0 - other.0, one.1 - other.1)
}
