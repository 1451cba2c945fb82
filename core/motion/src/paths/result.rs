//! What the path planner takes and returns.

use std::collections::BTreeSet;
use std::fmt::Display;

use thiserror::Error;

use super::rectangle::overlap;
use super::shape::Shape;
use formation_model::text::{counted, enumerated};
use formation_model::{
    Area, MicroUnits, ModuleId, POLYLINE_POSES_MAX, Plan, PlanningProblem, SpotId,
};

/// How much work the planner may do, and how exact the poses must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionParameters {
    /// The number of search nodes after which the planner falls back to the serial variant.
    pub expansions_max: u64,
    /// How often each path is planned again with all others fixed.
    pub improvement_passes: u32,
    /// The largest number of units for which the eager variant is planned as well.
    pub eager_units_max: usize,
    /// How far a spot may be off the lattice before an exit leads to it, and a module that needs no step onto it, in units or radians.
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
    /// The limits of the search.
    pub parameters: MotionParameters,
}

impl MotionRequest<'_> {
    /// Whether the inside of a shape is free of obstacles and within the walls.
    pub(super) fn is_open(&self, shape: &Shape) -> bool {
        self.blocking(shape).next().is_none() && self.is_within_walls(shape)
    }

    /// The obstacles that a shape reaches into.
    pub(super) fn blocking(&self, shape: &Shape) -> impl Iterator<Item = Shape> {
        let bounds = shape.bounds();
        let obstacles = self.obstacles.iter().map(Area::corners);
        let near = obstacles.filter(move |corners| overlap(&bounds, corners, 0));
        let near = near.map(Shape::rectangle);
        near.filter(|obstacle| shape.overlaps(obstacle, 0))
    }

    fn is_within_walls(&self, shape: &Shape) -> bool {
        let (low, high) = shape.bounds();
        let is_within = |walls: &Area| {
            let (from, to) = walls.corners();
            low.0 >= from.0 && low.1 >= from.1 && high.0 <= to.0 && high.1 <= to.1
        };
        self.walls.iter().all(is_within)
    }
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
    /// The module stands on an obstacle, on the body of a module that takes no part, or beyond the walls.
    #[error("{0} is on an obstacle or another body, or beyond the walls")]
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
    /// Two spots are so near to each other that bodies on them overlap.
    #[error("target: spots {} and {}: bodies overlap", .0.0, .1.0)]
    BodiesOverlap(SpotId, SpotId),
    /// Some modules do not start in a way that lets them move without contact.
    #[error("starts: {}", faults_listed(.0))]
    Starts(Vec<StartFault>),
    /// An obstacle or a wall covers a spot.
    #[error("{0} lies on an obstacle or beyond the walls")]
    CoveredSpot(SpotId),
    /// The modules and spots are too far apart to search the cells between them.
    #[error("the schedule of {0} cells is larger than {FIELD_CELLS_MAX}")]
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
            Self::BodiesOverlap(..) => {
                "move these spots apart, or make bodies narrower (`body_width`) or round (`body: circle`)"
            }
            Self::Starts(faults)
                if faults
                    .iter()
                    .all(|fault| matches!(fault, StartFault::Covered(_))) =>
            {
                "place these modules clear of obstacles and other bodies, and within the walls"
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
    /// Pinned modules on these spots surround it or its spots.
    #[error("walled in by {}", spots_listed(.0))]
    WalledIn(Vec<SpotId>),
    /// Obstacles or walls close the way.
    #[error("obstacles close the path")]
    Obstacles,
    /// These modules are on each path and cannot make way.
    #[error("no way past {}", listed(.0))]
    NoPassing(Vec<ModuleId>),
    /// The unit has to turn, and no place on its path has room for that.
    #[error("no room to turn on the path")]
    NoTurn,
    /// Its spots are off the lattice, and bodies, obstacles or walls leave no way from a cell near them.
    #[error("no way from the lattice onto it")]
    NoExit,
    /// Spots that are taken fill all that is free there, so no module can move.
    #[error("the spots leave no cell free")]
    Full,
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
}
