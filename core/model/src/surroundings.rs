//! What a target's modules are and where they move: the shape and width of their bodies, obstacles, and walls.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::area_union::{UnionError, union};
use crate::{Area, FieldError, MicroUnits, RawArea, Spot};

/// The width of a body in units, unless a scenario gives another.
pub const BODY_WIDTH: MicroUnits = MicroUnits(900_000);

/// The most obstacles of one target, and of a message; those that touch or overlap each other are joined first.
pub const OBSTACLES_MAX: usize = 2_000;

/// The most boxes in a file, where a wall may be drawn cell by cell.
pub const DRAWN_BOXES_MAX: usize = 20_000;

/// The least width of a body.
const BODY_WIDTH_MIN: MicroUnits = MicroUnits(100_000);

/// What the bodies of modules look like from above. Digests contain the numbers.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum BodyShape {
    /// A square as wide as the body.
    #[default]
    Square = 0,
    /// A circle whose diameter is the body's width.
    Circle = 1,
}

impl BodyShape {
    /// Whether it looks the same however it is turned.
    #[must_use]
    pub fn is_round(self) -> bool {
        self == Self::Circle
    }
}

/// The surroundings of a target as they stand in a file or a message, in units, not yet checked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawSurroundings {
    /// The shape of a body.
    pub body: BodyShape,
    /// The width of a body; `None` for [`BODY_WIDTH`].
    pub body_width: Option<f64>,
    /// Boxes that no module may enter.
    pub obstacles: Vec<RawArea>,
    /// The box that no module may leave; `None` for an open field.
    pub arena: Option<RawArea>,
}

/// Validated surroundings of a target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Surroundings {
    body: BodyShape,
    body_width: MicroUnits,
    obstacles: Vec<Area>,
    arena: Option<Area>,
}

impl Default for Surroundings {
    fn default() -> Self {
        Self {
            body: BodyShape::Square,
            body_width: BODY_WIDTH,
            obstacles: Vec::new(),
            arena: None,
        }
    }
}

impl RawSurroundings {
    /// The obstacles as they are written.
    fn drawn(&self) -> Result<Vec<Area>, FieldError> {
        let count = self.obstacles.len();
        if count > DRAWN_BOXES_MAX {
            let reason = format!("{count} entries; at most {DRAWN_BOXES_MAX} are supported");
            return Err(FieldError::new("obstacles", reason));
        }
        let obstacles = self.obstacles.iter().enumerate();
        let drawn =
            obstacles.map(|(index, &area)| Area::checked(&format!("obstacles[{index}]"), area));
        drawn.collect()
    }

    /// Refuses a spot whose cell lies on one of these obstacles, which it names by its place in the list.
    pub(crate) fn check_spots(&self, spots: &[Spot]) -> Result<(), FieldError> {
        for (index, obstacle) in self.drawn()?.iter().enumerate() {
            let mut spots = spots.iter();
            if let Some(spot) = spots.find(|spot| obstacle.overlaps(&Area::cell(spot))) {
                let field = format!("obstacles[{index}]");
                return Err(FieldError::new(
                    field,
                    format_args!("{} lies on it", spot.id),
                ));
            }
        }
        Ok(())
    }
}

impl TryFrom<RawSurroundings> for Surroundings {
    type Error = FieldError;

    fn try_from(raw: RawSurroundings) -> Result<Self, FieldError> {
        let refused = |reason: &dyn fmt::Display| FieldError::new("body_width", reason);
        let body_width = raw.body_width.map(MicroUnits::from_units).transpose();
        let body_width = body_width.map_err(|error| refused(&error))?;
        let body_width = body_width.unwrap_or(BODY_WIDTH);
        if !(BODY_WIDTH_MIN..=MicroUnits::ONE).contains(&body_width) {
            let (least, given) = (BODY_WIDTH_MIN.to_units(), body_width.to_units());
            let pitch = "1, the pitch of the lattice";
            return Err(refused(&format_args!(
                "must lie between {least} units and {pitch}, got {given}"
            )));
        }
        let drawn = raw.drawn()?;
        let obstacles = union(&drawn, OBSTACLES_MAX).map_err(|error| {
            let reason = match error {
                UnionError::TooMany => format!(
                    "make more than {OBSTACLES_MAX} rectangles even where those that touch are joined; draw them \
                     coarser, as each closes all cells of the lattice that it reaches into"
                ),
                UnionError::TooDense => "overlap each other too often; draw each wall once".to_owned(),
            };
            FieldError::new("obstacles", reason)
        })?;
        let arena = raw.arena.map(|area| Area::checked("arena", area));
        Ok(Self {
            body: raw.body,
            body_width,
            obstacles,
            arena: arena.transpose()?,
        })
    }
}

impl Surroundings {
    /// The shape of a body.
    #[must_use]
    pub fn body(&self) -> BodyShape {
        self.body
    }

    /// The width of a square body, or the diameter of a round one. Bodies must not overlap; the rest of a cell is what drives may be off.
    #[must_use]
    pub fn body_width(&self) -> MicroUnits {
        self.body_width
    }

    /// Where no module may go: disjoint rectangles in a form that depends on the area alone that they cover.
    #[must_use]
    pub fn obstacles(&self) -> &[Area] {
        &self.obstacles
    }

    /// The walls around the field, if it has any.
    #[must_use]
    pub fn arena(&self) -> Option<Area> {
        self.arena
    }

    /// Whether there are neither obstacles nor walls.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.obstacles.is_empty() && self.arena.is_none()
    }

    /// Whether an area lies within the walls and on no obstacle.
    pub fn admits(&self, area: &Area) -> bool {
        self.arena.is_none_or(|arena| arena.holds(area))
            && !self
                .obstacles
                .iter()
                .any(|obstacle| obstacle.overlaps(area))
    }

    /// Refuses a spot whose cell lies on an obstacle or beyond the walls.
    pub fn check_spots(&self, spots: &[Spot]) -> Result<(), FieldError> {
        for spot in spots {
            let (id, cell) = (spot.id, Area::cell(spot));
            if self.arena.is_some_and(|arena| !arena.holds(&cell)) {
                return Err(FieldError::new("arena", format_args!("{id} is beyond it")));
            }
            let mut obstacles = self.obstacles.iter();
            if let Some(obstacle) = obstacles.find(|obstacle| obstacle.overlaps(&cell)) {
                let RawArea { x, y, .. } = obstacle.to_raw();
                let reason = format_args!("{id} lies on the one around x {x}, y {y}");
                return Err(FieldError::new("obstacles", reason));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use crate::{Scenario, digest};

    const TARGET: &str = "target: {spots: [{id: 3, x: 0, y: 0}, {id: 7, x: 1, y: 0}], edges: [[3, 7]]}\nsingletons: [{id: 1, x: 20, y: 20}]";

    fn read(more: &str) -> Result<Scenario, String> {
        Scenario::from_yaml(&format!("{TARGET}\n{more}")).map_err(|error| error.to_string())
    }

    #[test]
    fn what_is_wrong_with_obstacles_and_walls_is_named() {
        for (text, expected) in [
            (
                "obstacles: [{x: 5, y: 0, width: 1, height: 1}, {x: 1, y: 0.9, width: 1, height: 1}]",
                "obstacles[1]: spot 7 lies on it",
            ),
            (
                "obstacles: [{x: 5, y: 0, width: 0, height: 1}]",
                "obstacles[0].width: must be positive, got 0",
            ),
            (
                "obstacles: [{x: .nan, y: 0, width: 1, height: 1}]",
                "obstacles[0].x: must be a finite number, got NaN",
            ),
            (
                "arena: {x: 0, y: 0, width: 2, height: 2}",
                "arena: spot 7 is beyond it",
            ),
            (
                "planner: {motion: straight}",
                "line 1 column 1: planner.motion: modules move along paths only: leave this key out",
            ),
        ] {
            assert_eq!(read(text).unwrap_err(), expected);
        }
        // What only touches a cell leaves it open.
        assert!(read("obstacles: [{x: 0, y: 1, width: 9, height: 1}]").is_ok());
    }

    #[test]
    fn the_digest_of_the_target_covers_its_surroundings() {
        let digest = |more: &str| {
            let scenario = read(more).unwrap();
            digest::of_problem(scenario.problem())
        };
        let texts = [
            "",
            "body_width: 0.8",
            "body: circle",
            "arena: {x: 0, y: 0, width: 9, height: 9}",
            "obstacles: [{x: 9, y: 9, width: 9, height: 9}]",
            "obstacles: [{x: 9, y: 9, width: 9, height: 8}]",
        ];
        let digests: BTreeSet<_> = texts.iter().map(|text| digest(text)).collect();
        assert_eq!(digests.len(), texts.len());
        assert_eq!(digest("body_width: 0.9\nbody: square"), digest(""));
    }
}
