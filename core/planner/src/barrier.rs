//! What stands between a module and a spot, to name it to people.

use std::fmt;

use formation_model::{Area, FreeCells, PlanningProblem, RawArea};

/// What is in the way on the straight line from a module to a spot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Barrier {
    /// This obstacle, as the target has it: boxes of a file that touch are one.
    Obstacle(Area),
    /// The body of a module that takes no part.
    Body,
    /// The line leaves the arena.
    Arena,
}

impl fmt::Display for Barrier {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Obstacle(area) => {
                let RawArea { x, y, .. } = area.to_raw();
                write!(formatter, "the obstacle around x {x}, y {y}")
            }
            Self::Body => formatter.write_str("a body"),
            Self::Arena => formatter.write_str("the edge of the arena"),
        }
    }
}

impl Barrier {
    /// The first thing in the way from a module to a spot of the problem's target, both by position.
    pub(crate) fn between(
        problem: &PlanningProblem,
        cells: &FreeCells,
        module: usize,
        spot: usize,
    ) -> Option<Self> {
        let start = cells.start(&problem.modules().get(module)?.pose)?;
        let closed = cells.first_closed_between(start, *cells.spots().get(spot)?)?;
        let surroundings = problem.target().surroundings();
        let overlaps = |area: &Area| area.overlaps(&closed);
        let mut obstacles = surroundings.obstacles().iter();
        if let Some(&obstacle) = obstacles.find(|&area| overlaps(area)) {
            return Some(Self::Obstacle(obstacle));
        }
        if problem.bodies().iter().any(overlaps) {
            return Some(Self::Body);
        }
        let arena = surroundings.arena();
        arena
            .is_some_and(|arena| !arena.holds(&closed))
            .then_some(Self::Arena)
    }
}
