//! Rectangles with sides along the axes.

use serde::{Deserialize, Serialize};

use crate::{FieldError, MICRO_PER_UNIT, MicroUnits, Spot};

/// A rectangle with sides along the axes of the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Area {
    /// The corner with the smaller coordinates.
    pub low: (MicroUnits, MicroUnits),
    /// The corner with the larger coordinates.
    pub high: (MicroUnits, MicroUnits),
}

/// An area as it stands in a file or a message, in units, not yet checked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a box with x, y, width and height")]
pub struct RawArea {
    /// Its middle.
    pub x: f64,
    /// Its middle.
    pub y: f64,
    /// Its extent along x.
    pub width: f64,
    /// Its extent along y.
    pub height: f64,
}

impl Area {
    /// Quantises an area with the path `field`.
    pub(crate) fn checked(field: &str, raw: RawArea) -> Result<Self, FieldError> {
        for (name, extent) in [("width", raw.width), ("height", raw.height)] {
            if extent <= 0.0 {
                let reason = format!("must be positive, got {extent}");
                return Err(FieldError::new(format_args!("{field}.{name}"), reason));
            }
        }
        let along = |name: &str, middle: f64, extent: f64| {
            let quantised = |end: f64| {
                let refused = |error| FieldError::new(format_args!("{field}.{name}"), error);
                MicroUnits::from_units(end).map_err(refused)
            };
            let (low, high) = (middle - extent / 2.0, middle + extent / 2.0);
            Ok::<_, FieldError>((quantised(low)?, quantised(high)?))
        };
        let (left, right) = along("x", raw.x, raw.width)?;
        let (bottom, top) = along("y", raw.y, raw.height)?;
        Ok(Self {
            low: (left, bottom),
            high: (right, top),
        })
    }

    /// The area as it stands in files and messages.
    #[must_use]
    pub fn to_raw(&self) -> RawArea {
        let [(left, bottom), (right, top)] =
            [self.low, self.high].map(|(x, y)| (x.to_units(), y.to_units()));
        RawArea {
            x: f64::midpoint(left, right),
            y: f64::midpoint(bottom, top),
            width: right - left,
            height: top - bottom,
        }
    }

    /// The cell of a spot.
    pub(crate) fn cell(spot: &Spot) -> Self {
        let half = MicroUnits(MICRO_PER_UNIT / 2);
        let (x, y) = (spot.pose.x, spot.pose.y);
        Self {
            low: (x - half, y - half),
            high: (x + half, y + half),
        }
    }

    /// Whether the insides of two areas have a point in common.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.low.0 < other.high.0
            && other.low.0 < self.high.0
            && self.low.1 < other.high.1
            && other.low.1 < self.high.1
    }

    /// Whether all of another area lies in this one.
    pub fn holds(&self, other: &Self) -> bool {
        self.low.0 <= other.low.0
            && self.low.1 <= other.low.1
            && other.high.0 <= self.high.0
            && other.high.1 <= self.high.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_area_is_read_back_exactly() {
        for (low, high) in [
            ((1, 2), (4, 8)),
            ((-999_999_999_999, 0), (999_999_999_999, 1)),
        ] {
            let corner = |(x, y): (i64, i64)| (MicroUnits(x), MicroUnits(y));
            let area = Area {
                low: corner(low),
                high: corner(high),
            };
            assert_eq!(Area::checked("", area.to_raw()), Ok(area));
        }
    }
}
