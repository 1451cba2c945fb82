//! The motion of a plan: the path of each module, and what each step waits for.

use crate::turning::rotated;
use crate::{MicroUnits, ModuleId, Pose, SpotId};

/// Which variant of the planner found the paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variant {
    /// Units make way when a path needs their cells.
    Lazy,
    /// All units leave the target's box first.
    Eager,
    /// Single modules swap their spots on the way.
    Swapping,
    /// The budget was spent: each step begins after all earlier users of its cells.
    Serial,
}

/// What a unit does in one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepKind {
    /// The modules that stand docked at the start, or a unit that leaves the lattice, turn about a point in place, as one body.
    Turn {
        /// The point.
        centre: Pose,
        /// How far the modules' corners reach from it.
        radius: MicroUnits,
    },
    /// They shift onto the lattice along one axis, or off it, as one body.
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
    /// The lead of the unit that it docks to, along an edge of the target.
    pub parent: Option<ModuleId>,
    /// When it and all that dock before it on the way from the first unit have arrived, in plan time; none without a spot.
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

    /// Whether one of its modules moves as a part of something larger when it has done this many steps: of a block, or of what was
    /// docked and comes onto the lattice.
    pub fn is_in_block_after(&self, done: usize) -> bool {
        let joint = usize::try_from(self.joint_steps).unwrap_or(usize::MAX);
        let is_joint = done <= joint && !self.joint_with.is_empty();
        is_joint || self.modules.len() > 1
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
    /// Blocks of the plan that move as single modules, because they do not get in as one body.
    pub taken_apart: Vec<Vec<ModuleId>>,
    /// Which variant found the paths.
    pub variant: Variant,
    /// When the last step ends in plan time.
    pub makespan: u32,
    /// No plan ends earlier: the most steps that any unit needs.
    pub bound: u32,
    /// The number of search nodes.
    pub expansions: u64,
}
