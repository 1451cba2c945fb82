//! Fixed-point numbers. Every module must compute the same bits, so no float enters a comparison.

use std::fmt;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Sub};

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The number of micro-units of one unit.
pub const MICRO_PER_UNIT: i64 = 1_000_000;

/// The greatest magnitude of a coordinate, in units.
pub const COORDINATE_LIMIT_UNITS: f64 = 1.0e6;

/// The greatest weight of a cost.
///
/// Coordinates up to 1e6 units, weights up to 100 and at most [`crate::MODULES_MAX`] modules keep every
/// sum of utilities below 3e18, so plain `i64` arithmetic cannot overflow.
pub const WEIGHT_LIMIT: f64 = 100.0;

/// A length, angle, value, cost or utility in millionths of its unit.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct MicroUnits(pub i64);

/// Why a float could not be quantised.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum QuantiseError {
    /// The number is NaN or infinite.
    #[error("must be a finite number, got {0}")]
    NotFinite(f64),
    /// The number's magnitude is beyond the limit.
    #[error("must lie within +-{limit}, got {value}")]
    OutOfRange {
        /// The number that was given.
        value: f64,
        /// The greatest magnitude allowed.
        limit: f64,
    },
}

impl MicroUnits {
    /// Zero.
    pub const ZERO: Self = Self(0);
    /// One whole unit.
    pub const ONE: Self = Self(MICRO_PER_UNIT);

    /// Quantises a coordinate or an angle, rounding half away from zero.
    ///
    /// # Errors
    /// Refuses numbers that are not finite or exceed [`COORDINATE_LIMIT_UNITS`].
    pub fn from_units(value: f64) -> Result<Self, QuantiseError> {
        Self::from_units_within(value, COORDINATE_LIMIT_UNITS)
    }

    /// Quantises a number whose magnitude is at most `limit` units, where `limit` is at most 1e12.
    ///
    /// # Errors
    /// Refuses numbers that are not finite or exceed `limit`.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the magnitude was just checked to fit"
    )]
    pub(crate) fn from_units_within(value: f64, limit: f64) -> Result<Self, QuantiseError> {
        if !value.is_finite() {
            return Err(QuantiseError::NotFinite(value));
        }
        if value.abs() > limit {
            return Err(QuantiseError::OutOfRange { value, limit });
        }
        Ok(Self((value * 1.0e6).round() as i64))
    }

    /// The number in units, for display and for messages.
    #[expect(
        clippy::cast_precision_loss,
        reason = "for display and transport; coordinates are below 2^53 micro-units"
    )]
    pub fn to_units(self) -> f64 {
        self.0 as f64 / 1.0e6
    }

    /// The product of two fixed-point numbers, rounded towards zero.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "weights and lengths are bounded so that the product fits; see WEIGHT_LIMIT"
    )]
    pub fn scaled_by(self, factor: Self) -> Self {
        if factor == Self::ONE {
            return self;
        }
        match self.0.checked_mul(factor.0) {
            // The division is much faster in 64 bits.
            Some(product) => Self(product / MICRO_PER_UNIT),
            None => Self(
                (i128::from(self.0) * i128::from(factor.0) / i128::from(MICRO_PER_UNIT)) as i64,
            ),
        }
    }

    /// This number `count` times; saturates.
    #[must_use]
    pub fn times(self, count: usize) -> Self {
        let count = i64::try_from(count).unwrap_or(i64::MAX);
        Self(self.0.saturating_mul(count))
    }
}

impl Add for MicroUnits {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl AddAssign for MicroUnits {
    fn add_assign(&mut self, other: Self) {
        self.0 += other.0;
    }
}

impl Sub for MicroUnits {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Sum for MicroUnits {
    fn sum<I: Iterator<Item = Self>>(numbers: I) -> Self {
        numbers.fold(Self::ZERO, Add::add)
    }
}

impl fmt::Display for MicroUnits {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:.6}", self.to_units())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantising_rounds_and_refuses() {
        assert_eq!(MicroUnits::from_units(1.5), Ok(MicroUnits(1_500_000)));
        assert_eq!(
            MicroUnits::from_units(-1.0e6),
            Ok(MicroUnits(-1_000_000_000_000))
        );
        assert!(MicroUnits::from_units(f64::NAN).is_err());
        assert!(MicroUnits::from_units(f64::INFINITY).is_err());
        assert!(MicroUnits::from_units(1.0e6 + 1.0).is_err());
    }

    #[test]
    fn the_largest_product_fits() {
        let longest = MicroUnits(2_828_427_124_746);
        let heaviest = MicroUnits(100 * MICRO_PER_UNIT);
        assert_eq!(longest.scaled_by(heaviest), MicroUnits(282_842_712_474_600));
    }
}
