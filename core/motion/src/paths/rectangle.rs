//! Rectangles along the axes.

use formation_model::MICRO_PER_UNIT;
use formation_model::turning::Point;

/// The corners with the smaller and with the larger coordinates.
pub(super) type Rectangle = (Point, Point);

/// Whether two rectangles overlap by more than some slack.
pub(super) fn overlap(one: &Rectangle, other: &Rectangle, slack: i64) -> bool {
    one.0.0 + slack < other.1.0
        && other.0.0 + slack < one.1.0
        && one.0.1 + slack < other.1.1
        && other.0.1 + slack < one.1.1
}

pub(super) fn hull(one: Rectangle, other: Rectangle) -> Rectangle {
    (
        (one.0.0.min(other.0.0), one.0.1.min(other.0.1)),
        (one.1.0.max(other.1.0), one.1.1.max(other.1.1)),
    )
}

/// Half the side of a cell.
pub(super) const HALF: i64 = MICRO_PER_UNIT / 2;

/// The cell around a point.
pub(super) fn square(middle: Point) -> Rectangle {
    (
        (middle.0 - HALF, middle.1 - HALF),
        (middle.0 + HALF, middle.1 + HALF),
    )
}

/// The lowest and the highest column and row.
pub(super) fn bounds(points: &[Point]) -> (Point, Point) {
    let mut low = (i64::MAX, i64::MAX);
    let mut high = (i64::MIN, i64::MIN);
    for point in points {
        low = (low.0.min(point.0), low.1.min(point.1));
        high = (high.0.max(point.0), high.1.max(point.1));
    }
    (low, high)
}
