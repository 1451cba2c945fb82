//! From units on the ground to pixels in a picture.

use formation_model::{BodyShape, Pose};

/// The length of a unit, unless the picture would become too large.
const PIXELS_PER_UNIT_MAX: f64 = 48.0;
/// The maximum length of the longer side of the ground.
const GROUND_MAX: f64 = 1_000.0;
/// The minimum margin around the outermost poses, in units.
const MARGIN_UNITS: f64 = 1.0;
/// The minimum distances of grid lines and of their numbers.
const GRID_GAP_MIN: f64 = 20.0;
const NUMBER_GAP_MIN: f64 = 44.0;

/// The side of a module's square, in units: less than any body has, so that the lines of links show between docked modules.
const MODULE_UNITS: f64 = 0.9;
/// The minimum side of a module's square.
const MODULE_MIN: f64 = 7.0;

/// The part of the plane that a picture shows. The y axis points upwards on the ground and downwards in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    left_units: f64,
    top_units: f64,
    scale: f64,
    /// The size of the ground, in pixels.
    pub(crate) width: f64,
    pub(crate) height: f64,
    /// What modules look like from above.
    pub(crate) body: BodyShape,
}

/// A line of the grid: its position in pixels, and its number if there is room for it.
pub(crate) struct GridLine {
    pub(crate) at: f64,
    pub(crate) number: Option<f64>,
}

impl Frame {
    /// A frame around some poses.
    pub(crate) fn around(poses: impl IntoIterator<Item = Pose>) -> Self {
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut bottom, mut top) = (f64::INFINITY, f64::NEG_INFINITY);
        for pose in poses {
            let (x, y) = (pose.x.to_units(), pose.y.to_units());
            (left, right) = (left.min(x), right.max(x));
            (bottom, top) = (bottom.min(y), top.max(y));
        }
        if left > right {
            (left, right, bottom, top) = (0.0, 0.0, 0.0, 0.0);
        }
        let longest = (right - left).max(top - bottom);
        let margin = MARGIN_UNITS.max(longest / 40.0);
        let scale = PIXELS_PER_UNIT_MAX.min(GROUND_MAX / (longest + 2.0 * margin));
        Self {
            left_units: left - margin,
            top_units: top + margin,
            scale,
            width: (right - left + 2.0 * margin) * scale,
            height: (top - bottom + 2.0 * margin) * scale,
            body: BodyShape::Square,
        }
    }

    /// Draws modules in this shape.
    pub(crate) fn with_bodies(self, body: BodyShape) -> Self {
        Self { body, ..self }
    }

    /// Widens the ground on both sides to at least this width in pixels.
    pub(crate) fn at_least(mut self, width: f64) -> Self {
        let missing = (width - self.width).max(0.0);
        self.left_units -= missing / 2.0 / self.scale;
        self.width += missing;
        self
    }

    /// The x and y of the upper left corner in units.
    pub(crate) fn origin(&self) -> (f64, f64) {
        (self.left_units, self.top_units)
    }

    /// The pixels in a unit.
    pub(crate) fn scale(&self) -> f64 {
        self.scale
    }

    pub(crate) fn x(&self, pose: &Pose) -> f64 {
        (pose.x.to_units() - self.left_units) * self.scale
    }

    pub(crate) fn y(&self, pose: &Pose) -> f64 {
        (self.top_units - pose.y.to_units()) * self.scale
    }

    /// The clockwise angle of a module at this pose in the picture, in degrees.
    pub(crate) fn turn(pose: &Pose) -> f64 {
        -pose.theta.to_units().to_degrees()
    }

    /// The side of a module's square.
    pub(crate) fn module_side(&self) -> f64 {
        (MODULE_UNITS * self.scale).max(MODULE_MIN)
    }

    /// Whether modules are drawn to scale.
    pub(crate) fn is_to_scale(&self) -> bool {
        MODULE_UNITS * self.scale >= MODULE_MIN
    }

    pub(crate) fn columns(&self) -> Vec<GridLine> {
        let right = self.left_units + self.width / self.scale;
        self.lines(self.left_units, right, |x| {
            (x - self.left_units) * self.scale
        })
    }

    pub(crate) fn rows(&self) -> Vec<GridLine> {
        let bottom = self.top_units - self.height / self.scale;
        self.lines(bottom, self.top_units, |y| {
            (self.top_units - y) * self.scale
        })
    }

    fn lines(&self, from: f64, to: f64, at: impl Fn(f64) -> f64) -> Vec<GridLine> {
        let step = round_step(GRID_GAP_MIN / self.scale);
        let number_step = round_step((NUMBER_GAP_MIN / self.scale).max(step));
        let mut lines = Vec::new();
        let mut index = (from / step).ceil();
        while index * step <= to {
            // Adding zero turns -0 into 0.
            let place = index * step + 0.0;
            let nearest = (place / number_step).round() * number_step;
            lines.push(GridLine {
                at: at(place),
                number: ((place - nearest).abs() < step / 1_000.0).then_some(place),
            });
            index += 1.0;
        }
        lines
    }
}

/// The least of 1, 2, 5, 10, 20, 50 and so on that is at least `at_least`.
fn round_step(at_least: f64) -> f64 {
    let mut step = 1.0;
    loop {
        for factor in [1.0, 2.0, 5.0] {
            if step * factor >= at_least {
                return step * factor;
            }
        }
        step *= 10.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(x: f64, y: f64) -> Pose {
        Pose::from_units(x, y, 0.0).unwrap()
    }

    #[test]
    fn upwards_on_the_ground_is_upwards_in_the_picture() {
        let frame = Frame::around([pose(1.0, 1.0), pose(3.0, 2.0)]);
        assert!((frame.x(&pose(1.0, 1.0)) - 48.0).abs() < 1e-9);
        assert!((frame.y(&pose(1.0, 2.0)) - 48.0).abs() < 1e-9);
        assert!((frame.y(&pose(1.0, 1.0)) - 96.0).abs() < 1e-9);
        assert!((frame.width - 4.0 * 48.0).abs() < 1e-9);
        let wider = frame.at_least(400.0);
        assert!(
            (wider.x(&pose(2.0, 1.0)) - 200.0).abs() < 1e-9,
            "in the middle"
        );
    }

    #[test]
    fn a_picture_of_anything_stays_small_and_legible() {
        for far in [0.0, 10.0, 1_000.0, 1.0e6] {
            let frame = Frame::around([pose(-far, -far), pose(far, far / 2.0)]);
            assert!(frame.width <= 1_000.1 && frame.height <= 1_000.1);
            assert!(frame.module_side() >= 7.0);
            let columns = frame.columns();
            assert!(columns.len() < 60, "{} lines", columns.len());
            assert!(columns.iter().any(|line| line.number.is_some()));
        }
        assert!(Frame::around([]).width > 0.0);
    }
}
