//! What the path planner takes and returns.

use std::collections::BTreeSet;
use std::fmt::Display;

use thiserror::Error;

use super::group::{Rectangle, overlap};
use super::turning::rotated;
pub use crate::model::Area;
use crate::model::text::{counted, enumerated};
use crate::model::{
    MicroUnits, ModuleId, POLYLINE_POSES_MAX, Plan, PlanningProblem, Pose, SpotId, polyline,
};

impl Area {
    /// What a body of this width covers, and the corners between its headings and the axes.
    #[must_use]
    pub fn of_body(pose: &Pose, width: MicroUnits) -> Self {
        let half = width.0 / 2;
        let corners = [(half, half), (half, -half)].map(|corner| rotated(corner, pose.theta.0));
        let reach = |along: fn(&(i64, i64)) -> i64| {
            let reaches = corners.iter().map(|corner| along(corner).abs());
            reaches.max().unwrap_or(half)
        };
        let (across, along) = (reach(|corner| corner.0), reach(|corner| corner.1));
        let corner = |sign: i64| {
            let (x, y) = (pose.x.0 + sign * across, pose.y.0 + sign * along);
            (MicroUnits(x), MicroUnits(y))
        };
        Self {
            low: corner(-1),
            high: corner(1),
        }
    }

    /// What a body of this width covers in any heading.
    fn of_turning_body(pose: &Pose, width: MicroUnits) -> Self {
        let half = width.0 / 2;
        let reach = (2 * half * half).isqrt() + 1;
        let corner = |reach: i64| (MicroUnits(pose.x.0 + reach), MicroUnits(pose.y.0 + reach));
        Self {
            low: corner(-reach),
            high: corner(reach),
        }
    }

    /// What a body of this width covers at a pose on the line between two others. Where their headings differ, it may have any.
    fn of_body_between(ends: (&Pose, &Pose)) -> fn(&Pose, MicroUnits) -> Self {
        match ends.0.theta == ends.1.theta {
            true => Self::of_body,
            false => Self::of_turning_body,
        }
    }

    /// What a body of this width may cover on the line between two poses, in rectangles around places at most `spacing` apart.
    pub(crate) fn along_line(
        (from, to): (&Pose, &Pose),
        width: MicroUnits,
        spacing: MicroUnits,
    ) -> Vec<Self> {
        let area_of = Self::of_body_between((from, to));
        let ends = [*from, *to];
        let poses = polyline::sampled(&ends, spacing);
        poses.map(|pose| area_of(&pose, width)).collect()
    }

    /// The rectangle around all that.
    pub(crate) fn around_line((from, to): (&Pose, &Pose), width: MicroUnits) -> Self {
        let area_of = Self::of_body_between((from, to));
        area_of(from, width).joined(&area_of(to, width))
    }

    fn joined(&self, other: &Self) -> Self {
        Self {
            low: (self.low.0.min(other.low.0), self.low.1.min(other.low.1)),
            high: (self.high.0.max(other.high.0), self.high.1.max(other.high.1)),
        }
    }

    /// The rectangle around what bodies of this width cover.
    pub(crate) fn of_bodies(poses: [&Pose; 2], width: MicroUnits) -> Self {
        let [first, second] = poses.map(|pose| Self::of_body(pose, width));
        first.joined(&second)
    }

    /// Both corners, in micro-units.
    pub(super) fn corners(&self) -> ((i64, i64), (i64, i64)) {
        let point = |corner: (MicroUnits, MicroUnits)| (corner.0.0, corner.1.0);
        (point(self.low), point(self.high))
    }
}

/// How much work the planner may do, and how exact the poses must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionParameters {
    /// The number of search nodes after which the planner falls back to the serial variant.
    pub expansions_max: u64,
    /// How often each path is planned again with all others fixed.
    pub improvement_passes: u32,
    /// The largest number of units for which the eager variant is planned as well.
    pub eager_units_max: usize,
    /// How far a spot may be off its place on a lattice, and a module that needs no step onto it, in units or radians.
    pub tolerance: MicroUnits,
}

impl Default for MotionParameters {
    fn default() -> Self {
        Self {
            expansions_max: 6_000_000,
            improvement_passes: 3,
            eager_units_max: 400,
            tolerance: MicroUnits(2_000),
        }
    }
}

/// The input of the path planner.
#[derive(Clone, Copy, Debug)]
pub struct MotionRequest<'a> {
    /// The target, and where the modules stand. A pinned module stands on its spot and never moves.
    pub problem: &'a PlanningProblem,
    /// Which module takes which spot, the blocks, and the acting order.
    pub plan: &'a Plan,
    /// Areas that no module may enter.
    pub obstacles: &'a [Area],
    /// The walls around the field, if it has any.
    pub walls: Option<Area>,
    /// Limits.
    pub parameters: MotionParameters,
}

impl MotionRequest<'_> {
    /// Whether the inside of a rectangle is free of obstacles and within the walls.
    pub(super) fn is_open(&self, rectangle: &Rectangle) -> bool {
        let (low, high) = rectangle;
        let covers = |area: &Area| overlap(rectangle, &area.corners(), 0);
        let is_within = |walls: &Area| {
            let (from, to) = walls.corners();
            low.0 >= from.0 && low.1 >= from.1 && high.0 <= to.0 && high.1 <= to.1
        };
        !self.obstacles.iter().any(covers) && self.walls.iter().all(is_within)
    }
}

/// By which neighbourhood each unit docks to a placed one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum OrderKind {
    /// Each unit docks along an edge of the target.
    Edges,
    /// Each unit docks to a unit on an adjacent cell; no order by edges leaves every unit a corridor.
    Adjacency,
}

/// Which variant of the planner found the paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variant {
    /// Units make way when a path needs their cells.
    Lazy,
    /// All units leave the target's box first.
    Eager,
    /// The budget was spent: each step begins after all earlier users of its cells.
    Serial,
}

/// What a unit does in one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepKind {
    /// The modules that stand docked at the start turn about a point in place, as one body.
    Turn {
        /// The point.
        centre: Pose,
        /// How far the modules' corners reach from it.
        radius: MicroUnits,
    },
    /// They shift along one axis onto the lattice, as one body.
    Shift,
    /// Docked modules that stood off a common lattice each go to a cell; they may overlap each other meanwhile.
    Regroup,
    /// The unit moves by one cell.
    Move,
    /// Half of a block's fold from its start layout to its target layout, within a disc that no other body enters.
    Fold {
        /// The middle of the disc.
        centre: Pose,
        /// The radius of the disc.
        radius: MicroUnits,
    },
}

/// One step of a unit. It takes one unit of plan time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// What the unit does.
    pub kind: StepKind,
    /// When it begins in plan time.
    pub begin: u32,
}

/// A condition on the begin of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Wait {
    /// The step that waits; a unit's steps count from 1.
    pub step: u32,
    /// The lead of the unit that is waited for.
    pub unit: ModuleId,
    /// How many steps that unit must have done.
    pub steps_done: u32,
}

/// Where a module is at a time of the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Waypoint {
    /// The pose.
    pub pose: Pose,
    /// When the module reaches it in plan time.
    pub time: u32,
}

/// The path of one module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModuleMotion {
    /// The module.
    pub module: ModuleId,
    /// The spot that it takes, if it takes one.
    pub spot: Option<SpotId>,
    /// The start, then the pose after each step of the unit.
    pub waypoints: Vec<Waypoint>,
}

/// The motion of one unit: a block that stays docked, or a single module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnitMotion {
    /// The lowest of its modules.
    pub lead: ModuleId,
    /// Its modules, ascending.
    pub modules: Vec<ModuleMotion>,
    /// Its steps in order.
    pub steps: Vec<Step>,
    /// What its steps wait for, ascending.
    pub waits: Vec<Wait>,
    /// How many of its first steps it does together with the units of `joint_with`.
    pub joint_steps: u32,
    /// The leads of the units that are docked to it at the start.
    pub joint_with: Vec<ModuleId>,
    /// The lead of the unit that it docks to.
    pub parent: Option<ModuleId>,
    /// When it docks in plan time; none without a spot.
    pub docked_at: Option<u32>,
    /// The fewest steps that could bring it to its spots.
    pub shortest: u32,
}

/// Into how many parts an arc is divided; a body is off the chord of a part by less than a hundredth of the radius.
const ARC_PARTS: i64 = 6;

impl UnitMotion {
    /// Where one of its modules passes once it has done this many steps: where it is then, and the poses along its path.
    pub fn poses_after(&self, done: usize, module: &ModuleMotion) -> impl Iterator<Item = Pose> {
        let waypoints = module.waypoints.get(done..).unwrap_or_default();
        let steps = self.steps.get(done..).unwrap_or_default();
        let first = waypoints.first().map(|waypoint| waypoint.pose);
        let legs = waypoints.windows(2).zip(steps);
        let along = legs.flat_map(|(ends, step)| {
            let (from, to) = (ends[0].pose, ends[1].pose);
            let arc = match step.kind {
                StepKind::Turn { centre, .. } => arc(from, centre),
                _ => Vec::new(),
            };
            arc.into_iter().chain([to])
        });
        first.into_iter().chain(along)
    }
}

/// Poses between the ends of a turn about the centre, by its heading.
fn arc(from: Pose, centre: Pose) -> Vec<Pose> {
    let offset = (from.x.0 - centre.x.0, from.y.0 - centre.y.0);
    let part = |part: i64| {
        let angle = centre.theta.0 * part / ARC_PARTS;
        let (x, y) = rotated(offset, angle);
        Pose {
            x: MicroUnits(centre.x.0 + x),
            y: MicroUnits(centre.y.0 + y),
            theta: MicroUnits(from.theta.0 + angle),
        }
    };
    (1..ARC_PARTS).map(part).collect()
}

/// Paths for all units that no two bodies contest, whatever delays the units have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MotionPlan {
    /// The pinned units, the others in the order in which they dock, then those without a spot.
    pub units: Vec<UnitMotion>,
    /// Which neighbourhood the order of docking follows.
    pub order: OrderKind,
    /// Blocks of the plan that move as single modules, because they do not get in as one body.
    pub taken_apart: Vec<Vec<ModuleId>>,
    /// Which variant found the paths.
    pub variant: Variant,
    /// When the last step ends in plan time.
    pub makespan: u32,
    /// No plan with this order ends earlier: the greatest of the longest shortest path and the chain of dockings.
    pub bound: u32,
    /// The most steps that any unit needs.
    pub longest_path: u32,
    /// The number of search nodes.
    pub expansions: u64,
}

/// What keeps a module from a start without contact.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum StartFault {
    /// The bodies overlap, or one reaches into the circle in which the other turns.
    #[error("{0} and {1} are too close")]
    NotApart(ModuleId, ModuleId),
    /// The two come to the same cell, or need each other's place on their way to it.
    #[error("{0} and {1} contest a cell")]
    SharedCell(ModuleId, ModuleId),
    /// The module is docked to others but not on a common lattice with the first of them.
    #[error("{0} is docked but off the lattice of {1}")]
    OffGroup(ModuleId, ModuleId),
    /// The module stands on an obstacle or beyond the walls.
    #[error("{0} is on an obstacle or beyond the walls")]
    Covered(ModuleId),
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

/// Why there is no motion plan.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MotionError {
    /// The target is not on a unit lattice.
    #[error(
        "target: {} not on the unit lattice of {origin} with a heading in quarter turns",
        listed(spots)
    )]
    OffLattice {
        /// The spot whose pose spans the lattice.
        origin: SpotId,
        /// The spots that are off it, ascending.
        spots: Vec<SpotId>,
    },
    /// Two spots of the target share a cell.
    #[error("target: {0} and {1} share a cell")]
    SharedCell(SpotId, SpotId),
    /// An edge of the target joins spots that are not side by side.
    #[error("target: {0} and {1} are joined but not on adjacent cells")]
    LongEdge(SpotId, SpotId),
    /// Some modules do not start in a way that lets them move without contact.
    #[error("starts: {}", faults_listed(.0))]
    Starts(Vec<StartFault>),
    /// An obstacle or a wall covers a spot.
    #[error("{0} lies on an obstacle or beyond the walls")]
    CoveredSpot(SpotId),
    /// The modules and spots are too far apart to search the cells between them.
    #[error("the field of {0} cells is larger than {FIELD_CELLS_MAX}")]
    FieldTooLarge(u64),
    /// The path of a module has more corners than a message holds.
    #[error("the path of {0} has more than {POLYLINE_POSES_MAX} corners")]
    TooManyCorners(ModuleId),
    /// A unit cannot get to its spots.
    #[error("{} cannot reach {}: {reason}", listed(modules), listed(spots))]
    Unreachable {
        /// The modules of the unit.
        modules: Vec<ModuleId>,
        /// Its spots.
        spots: Vec<SpotId>,
        /// Why.
        reason: Obstruction,
    },
}

impl MotionError {
    /// What to change so that there are paths.
    #[must_use]
    pub fn cure(&self) -> &'static str {
        match self {
            Self::OffLattice { .. } | Self::SharedCell(..) | Self::LongEdge(..) => {
                "put each spot on a cell of its own of one lattice of units, with headings in quarter turns"
            }
            Self::Starts(faults)
                if faults
                    .iter()
                    .all(|fault| matches!(fault, StartFault::Covered(_))) =>
            {
                "place these modules clear of obstacles and within the walls"
            }
            Self::Starts(_) => {
                "place these modules further apart, so that each can turn without touching another (`formation generate \
                 --apart` draws such starts)"
            }
            Self::CoveredSpot(_)
            | Self::FieldTooLarge(_)
            | Self::TooManyCorners(_)
            | Self::Unreachable { .. } => "change the target or the starts",
        }
    }
}

/// The most faults of starts that a message names.
const FAULTS_MAX: usize = 5;

/// The largest number of cells that the planner searches.
pub const FIELD_CELLS_MAX: u64 = 4_000_000;

/// Why a unit cannot get to its spots.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Obstruction {
    /// Units on these spots surround it or its spots.
    #[error("walled in by {}", spots_listed(.0))]
    WalledIn(Vec<SpotId>),
    /// Obstacles or walls close the way.
    #[error("obstacles close the path")]
    Obstacles,
    /// Units on the path have no free cell to move to.
    #[error(
        "no room: {} missing for {} to make way",
        cells(*missing),
        listed(modules)
    )]
    NoRoom {
        /// The modules that would have to make way.
        modules: Vec<ModuleId>,
        /// How many free cells are missing.
        missing: usize,
    },
}

/// The first faults. Where there are more, the modules that all faults name are counted: each of a crowd is too close to many.
fn faults_listed(faults: &[StartFault]) -> String {
    if faults.len() <= FAULTS_MAX {
        return enumerated(faults, FAULTS_MAX);
    }
    let modules: BTreeSet<ModuleId> = faults.iter().flat_map(StartFault::modules).collect();
    let first: Vec<String> = faults[..FAULTS_MAX]
        .iter()
        .map(ToString::to_string)
        .collect();
    format!(
        "{}, and others; this concerns {}",
        first.join(", "),
        counted(modules.len(), "module")
    )
}

fn spots_listed(spots: &[SpotId]) -> String {
    match spots {
        [spot] => spot.to_string(),
        spots => format!("spots {}", listed(spots.iter().map(|spot| spot.0))),
    }
}

fn cells(count: usize) -> String {
    match count {
        1 => "1 free cell is".to_owned(),
        count => format!("{count} free cells are"),
    }
}

fn listed(entries: impl IntoIterator<Item = impl Display>) -> String {
    enumerated(entries, usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_names_the_first_faults_and_counts_the_others() {
        let faults = |count| {
            let pairs = (1..=count).map(|id| StartFault::NotApart(ModuleId(id), ModuleId(id + 1)));
            MotionError::Starts(pairs.collect()).to_string()
        };
        assert_eq!(
            faults(2),
            "starts: module 1 and module 2 are too close and module 2 and module 3 are too close"
        );
        let many = "module 5 and module 6 are too close, and others; this concerns 8 modules";
        assert!(faults(7).ends_with(many), "{}", faults(7));
    }

    #[test]
    fn modules_on_obstacles_are_not_to_be_put_further_apart() {
        let covered = StartFault::Covered(ModuleId(1));
        let cure = |faults| MotionError::Starts(faults).cure();
        assert!(cure(vec![covered.clone()]).contains("clear of obstacles"));
        let close = StartFault::NotApart(ModuleId(2), ModuleId(3));
        assert!(cure(vec![covered, close]).contains("further apart"));
    }

    /// Half of the diagonal of a body of 0.9 units is 0.636 units.
    #[test]
    fn a_body_that_turns_covers_its_corners_in_every_heading() {
        let pose = |x, theta| Pose::from_units(x, 0.0, theta).unwrap();
        let width = crate::model::BODY_WIDTH;
        let reach = |from, to| Area::around_line((&from, &to), width).high.1.to_units();
        assert!((reach(pose(0.0, 0.0), pose(2.0, 0.0)) - 0.45).abs() < 0.001);
        assert!((reach(pose(0.0, 0.0), pose(0.0, 3.0)) - 0.636).abs() < 0.001);
        let along = Area::along_line((&pose(0.0, 0.0), &pose(0.0, 3.0)), width, width);
        assert!(along.iter().all(|area| area.high.1.to_units() > 0.636));
    }
}
