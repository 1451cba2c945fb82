//! Poses in the plane, quantised once at the border.

use nalgebra::{Isometry2, Vector2};
use serde::{Deserialize, Serialize};

use crate::{COORDINATE_LIMIT_UNITS, MicroUnits, QuantiseError};

/// A full turn in micro-radians.
const FULL_TURN: i64 = 6_283_185;

/// A position in micro-units and a heading in micro-radians, counter-clockwise from the x axis.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct Pose {
    /// The position along the frame's x axis.
    pub x: MicroUnits,
    /// The position along the frame's y axis.
    pub y: MicroUnits,
    /// The heading.
    pub theta: MicroUnits,
}

/// A coordinate of a pose that was refused, and why.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{coordinate} {source}")]
pub struct PoseError {
    /// `x`, `y` or `theta`.
    pub coordinate: &'static str,
    /// What is wrong with it.
    #[source]
    pub source: QuantiseError,
}

impl Pose {
    /// Quantises a pose given in units and radians.
    ///
    /// # Errors
    /// Names the coordinate that is not finite or too large.
    pub fn from_units(x: f64, y: f64, theta: f64) -> Result<Self, PoseError> {
        let quantise = |coordinate, value| {
            MicroUnits::from_units(value).map_err(|source| PoseError { coordinate, source })
        };
        Ok(Self {
            x: quantise("x", x)?,
            y: quantise("y", y)?,
            theta: quantise("theta", theta)?,
        })
    }

    /// The pose as a rigid motion from the frame's origin, in units and radians. For simulation and reports; decisions stay
    /// in fixed point.
    pub fn to_isometry(self) -> Isometry2<f64> {
        let translation = Vector2::new(self.x.to_units(), self.y.to_units());
        Isometry2::new(translation, self.theta.to_units())
    }

    /// Whether its position is one that [`Self::from_units`] accepts.
    pub fn is_within_limits(&self) -> bool {
        let limit = MicroUnits::from_units(COORDINATE_LIMIT_UNITS).unwrap_or_default();
        [self.x, self.y]
            .iter()
            .all(|coordinate| coordinate.0.abs() <= limit.0)
    }

    /// The angle between the two headings in micro-radians, at most half a turn.
    pub fn heading_difference(&self, other: &Self) -> MicroUnits {
        MicroUnits(self.turn_from(other).0.abs())
    }

    /// The turn in micro-radians from the other heading to this one, the shorter way round; counter-clockwise is positive.
    #[must_use]
    pub fn turn_from(&self, other: &Self) -> MicroUnits {
        let turn = (self.theta.0 - other.theta.0).rem_euclid(FULL_TURN);
        MicroUnits(if turn > FULL_TURN / 2 {
            turn - FULL_TURN
        } else {
            turn
        })
    }

    /// The distance between the two positions, rounded down to whole micro-units.
    #[must_use]
    #[inline]
    pub fn distance_to(&self, other: &Self) -> MicroUnits {
        let dx = self.x.0 - other.x.0;
        let dy = self.y.0 - other.y.0;
        MicroUnits(if dx.abs() < SHORT && dy.abs() < SHORT {
            short_root(dx * dx + dy * dy)
        } else {
            long_root(dx, dy)
        })
    }
}

/// For differences below this many micro-units along each axis, the squared distance is below 2^62.
const SHORT: i64 = 1 << 30;

/// The integer square root of a sum of squares that may exceed 64 bits.
#[cold]
fn long_root(dx: i64, dy: i64) -> i64 {
    let (dx, dy) = (i128::from(dx), i128::from(dy));
    i64::try_from((dx * dx + dy * dy).isqrt()).unwrap_or(i64::MAX)
}

/// The integer square root of a number below 2^62.
///
/// The float root, which errs by less than one at this size, is only the first guess. Whole numbers correct it, so the
/// result is exact on every machine.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "the guess is below 2^31, and corrected"
)]
#[inline]
fn short_root(square: i64) -> i64 {
    let guess = (square as f64).sqrt() as i64;
    if guess * guess > square {
        guess - 1
    } else if (guess + 1) * (guess + 1) <= square {
        guess + 1
    } else {
        guess
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_is_an_integer_square_root() {
        let origin = Pose::default();
        let far = Pose::from_units(3.0, 4.0, 0.0).unwrap();
        assert_eq!(origin.distance_to(&far), MicroUnits(5_000_000));
        let corner = Pose::from_units(1.0e6, 1.0e6, 0.0).unwrap();
        let opposite = Pose::from_units(-1.0e6, -1.0e6, 0.0).unwrap();
        assert_eq!(corner.distance_to(&opposite), MicroUnits(2_828_427_124_746));
    }

    #[test]
    fn the_short_root_is_exact_around_every_square() {
        let corner = (SHORT - 1) * (SHORT - 1) * 2;
        for root in (0..40_000_i64).chain((0..40_000).map(|step| corner.isqrt() - step)) {
            for square in [(root * root - 1).max(0), root * root, root * root + 1] {
                assert_eq!(short_root(square), square.isqrt());
            }
        }
    }

    #[test]
    fn a_pose_names_its_bad_coordinate() {
        let error = Pose::from_units(0.0, f64::NAN, 0.0).unwrap_err();
        assert_eq!(error.coordinate, "y");
    }
}
