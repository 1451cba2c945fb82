//! Obstacles and walls of targets, and who is to take which spot.

use std::sync::Arc;

use formation_model::{
    BodyShape, PlannerParameters, Policy, RawArea, RawGiven, RawGivenSpot, RawSurroundings,
    Surroundings, Target, TargetAnnouncement,
};
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

/// The target in these surroundings, if its spots allow them.
/// With the policy `given`, a module for each spot.
pub fn placed_within(
    target: Target,
    surroundings: Surroundings,
    parameters: &PlannerParameters,
) -> Target {
    let target = match parameters.policy {
        Policy::Given => given_to_all(target),
        _ => target,
    };
    let open = target.clone();
    target.within(surroundings).unwrap_or(open)
}

fn given_to_all(target: Target) -> Target {
    let spots = target.spots().iter().zip((1..).step_by(3));
    let allocation = spots.map(|(spot, module)| RawGivenSpot {
        module,
        spot: spot.id.0,
    });
    let given = RawGiven {
        allocation: allocation.collect(),
        detached: vec![1, 4, 900],
    };
    target.with_given(&given).unwrap()
}

/// The announcement without an allocation, which fits some members alone.
pub fn for_any_members(mut announcement: TargetAnnouncement) -> TargetAnnouncement {
    if announcement.parameters.policy == Policy::Given {
        announcement.parameters.policy = Policy::Exact;
        let target = announcement.target.take();
        announcement.target = target.map(|target| Arc::new(Target::clone(&target).without_given()));
    }
    announcement
}
