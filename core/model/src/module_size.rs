//! The size of modules: how the units of the core relate to metres.

use std::fmt;

use thiserror::Error;

use crate::{COORDINATE_LIMIT_UNITS, MicroUnits, Pose, PoseError, QuantiseError};

/// The least size of a module, in metres.
pub const MODULE_SIZE_MIN_M: f64 = 0.001;

/// The greatest size of a module, in metres.
pub const MODULE_SIZE_MAX_M: f64 = 1_000.0;

/// The length of one unit, the pitch of the lattice, in whole micrometres.
///
/// The core computes in units. Scenario files are in units as well; ROS 2 messages are in metres. A length that goes out
/// and comes in with the same size is the same number of micro-units.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ModuleSize(i64);

/// Why a number is not the size of a module.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("must lie between {MODULE_SIZE_MIN_M} m and {MODULE_SIZE_MAX_M} m, got {0}")]
pub struct ModuleSizeError(pub f64);

impl Default for ModuleSize {
    fn default() -> Self {
        Self::METRE
    }
}

impl fmt::Display for ModuleSize {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} m", self.metres())
    }
}

impl ModuleSize {
    /// One metre.
    pub const METRE: Self = Self(1_000_000);

    /// The size of a module in metres, rounded to micrometres.
    ///
    /// # Errors
    /// The number is not between [`MODULE_SIZE_MIN_M`] and [`MODULE_SIZE_MAX_M`].
    pub fn from_metres(metres: f64) -> Result<Self, ModuleSizeError> {
        if !(MODULE_SIZE_MIN_M..=MODULE_SIZE_MAX_M).contains(&metres) {
            return Err(ModuleSizeError(metres));
        }
        let quantised = MicroUnits::from_units(metres).map_err(|_| ModuleSizeError(metres))?;
        Ok(Self(quantised.0))
    }

    /// The length of one unit in metres.
    #[must_use]
    pub fn metres(self) -> f64 {
        MicroUnits(self.0).to_units()
    }

    /// A length in metres.
    #[must_use]
    pub fn to_metres(self, length: MicroUnits) -> f64 {
        self.scale_to_metres(length.to_units())
    }

    /// A number of units in metres.
    #[must_use]
    pub fn scale_to_metres(self, units: f64) -> f64 {
        if self == Self::METRE {
            return units;
        }
        units * self.metres()
    }

    /// A number of metres in units, rounded to micro-units unless a unit is a metre.
    #[must_use]
    pub fn scale_to_units(self, metres: f64) -> f64 {
        if self == Self::METRE {
            return metres;
        }
        // A length at the limit is not to lie beyond it by a rounding.
        (metres / self.metres() * 1.0e6).round() / 1.0e6
    }

    /// A number of metres in units, rounded to micro-units.
    ///
    /// # Errors
    /// The number is not finite, or beyond [`COORDINATE_LIMIT_UNITS`].
    pub fn from_metres_to_units(self, metres: f64) -> Result<MicroUnits, QuantiseError> {
        MicroUnits::from_units(self.scale_to_units(metres)).map_err(|error| match error {
            QuantiseError::NotFinite(_) => QuantiseError::NotFinite(metres),
            QuantiseError::OutOfRange { .. } => QuantiseError::OutOfRange {
                value: metres,
                limit: COORDINATE_LIMIT_UNITS * self.metres(),
            },
        })
    }

    /// The pose whose coordinates are given in metres and radians.
    ///
    /// # Errors
    /// Names the coordinate that is not finite or out of range.
    pub fn pose_from_metres(self, x: f64, y: f64, theta: f64) -> Result<Pose, PoseError> {
        let length = |coordinate, metres| {
            let units = self.from_metres_to_units(metres);
            units.map_err(|source| PoseError { coordinate, source })
        };
        Ok(Pose {
            x: length("x", x)?,
            y: length("y", y)?,
            theta: Pose::from_units(0.0, 0.0, theta)?.theta,
        })
    }

    /// The position of a pose, in metres.
    #[must_use]
    pub fn position_in_metres(self, pose: &Pose) -> (f64, f64) {
        (self.to_metres(pose.x), self.to_metres(pose.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_between_a_millimetre_and_a_kilometre() {
        for good in [0.001, 0.08, 1.0, 1_000.0] {
            let size = ModuleSize::from_metres(good).unwrap();
            assert!((size.metres() - good).abs() < 1e-9);
        }
        for bad in [0.0, -1.0, 0.000_9, 1_000.1, f64::NAN, f64::INFINITY] {
            assert!(ModuleSize::from_metres(bad).is_err(), "{bad}");
        }
        let refused = ModuleSize::from_metres(0.0).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "must lie between 0.001 m and 1000 m, got 0"
        );
    }

    #[test]
    fn lengths_survive_the_change_of_unit_exactly() {
        for metres in [0.001, 0.003, 0.08, 0.33, 1.0, 7.7, 546.344_439, 1_000.0] {
            let size = ModuleSize::from_metres(metres).unwrap();
            for micro in [
                0,
                1,
                -1,
                333_333,
                80_000_001,
                999_999_999_999,
                -1_000_000_000_000,
            ] {
                let there = size.to_metres(MicroUnits(micro));
                let back = size.from_metres_to_units(there);
                assert_eq!(back, Ok(MicroUnits(micro)), "{micro} at {metres} m");
            }
        }
    }

    #[test]
    fn limits_are_stated_in_metres() {
        let size = ModuleSize::from_metres(0.08).unwrap();
        let refused = size.pose_from_metres(0.0, 90_000.0, 0.0).unwrap_err();
        assert_eq!(refused.coordinate, "y");
        assert_eq!(
            refused.source.to_string(),
            "must lie within +-80000, got 90000"
        );
    }
}
