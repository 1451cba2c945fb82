//! Obstacles and walls of targets.

use formation_model::{BodyShape, MotionMode, RawArea, RawSurroundings, Surroundings, Target};
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;

/// Widths of bodies, obstacles and walls.
pub fn surroundings() -> impl Strategy<Value = Surroundings> {
    let extent = || prop_oneof![0.000_001..2.0_f64, 1.0..100_000.0];
    let area = move || {
        (
            -400_000.0..400_000.0_f64,
            -400_000.0..400_000.0_f64,
            extent(),
            extent(),
        )
            .prop_map(|(x, y, width, height)| RawArea {
                x,
                y,
                width,
                height,
            })
    };
    let width = option::of(0.1..1.0_f64);
    let body = prop_oneof![Just(BodyShape::Square), Just(BodyShape::Circle)];
    let parts = (body, width, vec(area(), 0..4), option::of(area()));
    parts.prop_map(|(body, body_width, obstacles, arena)| {
        let raw = RawSurroundings {
            body,
            body_width,
            obstacles,
            arena,
        };
        Surroundings::try_from(raw).unwrap()
    })
}

/// The target in these surroundings, if its spots and the motion allow them.
pub fn placed_within(target: Target, surroundings: Surroundings, motion: MotionMode) -> Target {
    if motion == MotionMode::Straight {
        return target;
    }
    let open = target.clone();
    target.within(surroundings).unwrap_or(open)
}
