//! Poses of the core as poses of the physics, in units and radians.

use std::f32::consts::{PI, TAU};

use formation_model as model;
use rapier2d::math::{Pose, Real, Vector};

/// A number of the physics, which computes with 32 bits.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a module's place is known to a hundredth; 32 bits resolve a ten-thousandth at 1000 units"
)]
pub(crate) fn real(number: f64) -> Real {
    number as Real
}

/// A pose of the core.
pub(crate) fn from_core(pose: &model::Pose) -> Pose {
    let [x, y, theta] = [pose.x, pose.y, pose.theta].map(|micro| real(micro.to_units()));
    Pose::new(Vector::new(x, y), theta)
}

/// A pose for the core; `None` if it lies beyond the limits of coordinates.
pub(crate) fn to_core(pose: &Pose) -> Option<model::Pose> {
    let Vector { x, y } = pose.translation;
    model::Pose::from_units(x.into(), y.into(), pose.rotation.angle().into()).ok()
}

/// The smaller angle from one heading to another, from -pi to pi.
pub(crate) fn turn(from: Real, to: Real) -> Real {
    let turn = (to - from).rem_euclid(TAU);
    if turn > PI { turn - TAU } else { turn }
}

/// How far two poses are apart, in units and radians.
pub(crate) fn deviation(one: &Pose, other: &Pose) -> Deviation {
    Deviation {
        distance: one.translation.distance(other.translation),
        angle: turn(one.rotation.angle(), other.rotation.angle()).abs(),
    }
}

/// How far two poses are apart, or may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deviation {
    /// In units.
    pub distance: Real,
    /// In radians.
    pub angle: Real,
}

impl Deviation {
    /// Whether neither exceeds the limit.
    pub fn is_within(self, limit: Self) -> bool {
        self.distance <= limit.distance && self.angle <= limit.angle
    }
}
