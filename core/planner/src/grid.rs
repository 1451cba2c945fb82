//! Targets of tests.

use formation_model::{RawSpot, RawTarget, Target};

/// A square of spots on the unit lattice, numbered row by row, each adjacent to those next to it.
pub(crate) fn grid(side: u32) -> Target {
    let spots = (0..side * side).map(|id| RawSpot {
        id,
        x: f64::from(id % side),
        y: f64::from(id / side),
        theta: 0.0,
    });
    let along = (0..side * side).filter(|id| id % side + 1 < side);
    let across = (0..side * (side - 1)).map(|id| [id, id + side]);
    let raw = RawTarget {
        frame_id: "map".to_owned(),
        spots: spots.collect(),
        edges: along.map(|id| [id, id + 1]).chain(across).collect(),
    };
    Target::try_from(raw).unwrap()
}
