//! What bodies cover, exactly: convex shapes with rounded corners.

use super::rectangle::{Rectangle, bounds, overlap};
use formation_model::turning::{Point, rotated};

/// All points within a distance of the convex hull of some points.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    points: Vec<Point>,
    radius: i64,
}

impl Shape {
    /// A square with sides along the axes.
    pub fn square(middle: Point, half: i64) -> Self {
        Self::rectangle((
            (middle.0 - half, middle.1 - half),
            (middle.0 + half, middle.1 + half),
        ))
    }

    /// A rectangle with sides along the axes.
    pub fn rectangle((low, high): Rectangle) -> Self {
        Self {
            points: vec![low, (high.0, low.1), high, (low.0, high.1)],
            radius: 0,
        }
    }

    /// A square whose sides are at this angle to the axes.
    pub fn turned_square((x, y): Point, half: i64, angle: i64) -> Self {
        let corners = [(half, half), (-half, half), (-half, -half), (half, -half)];
        let corner = |corner: Point| {
            let (right, up) = rotated(corner, angle);
            (x + right, y + up)
        };
        Self {
            points: corners.map(corner).into(),
            radius: 0,
        }
    }

    /// A circle with its inside.
    pub fn circle(centre: Point, radius: i64) -> Self {
        Self {
            points: vec![centre],
            radius,
        }
    }

    /// The corners of its hull, before they are rounded.
    pub fn into_points(self) -> Vec<Point> {
        self.points
    }

    /// What this shape covers while its middle moves along a straight line.
    pub fn moved(mut self, (from, to): (Point, Point)) -> Self {
        let moved = |&(x, y): &Point| (x + to.0 - from.0, y + to.1 - from.1);
        let ends: Vec<Point> = self.points.iter().map(moved).collect();
        self.points.extend(ends);
        self.points.sort_unstable();
        self.points.dedup();
        self
    }

    /// The same shape elsewhere.
    pub fn shifted(mut self, by: Point) -> Self {
        for point in &mut self.points {
            *point = (point.0 + by.0, point.1 + by.1);
        }
        self
    }

    /// The least rectangle that holds the shape.
    pub fn bounds(&self) -> Rectangle {
        let (mut low, mut high) = bounds(&self.points);
        low = (low.0 - self.radius, low.1 - self.radius);
        high = (high.0 + self.radius, high.1 + self.radius);
        (low, high)
    }

    /// Whether two shapes overlap by more than some slack: no direction shows less of an overlap.
    ///
    /// The directions in which two shapes are farthest apart, or overlap least, are at right angles to a side of one of them or
    /// lead from a corner of one to a corner of the other.
    pub fn overlaps(&self, other: &Self, slack: i64) -> bool {
        if !overlap(&self.bounds(), &other.bounds(), slack) {
            return false;
        }
        let mut directions = self.directions_to(other);
        !directions.any(|direction| self.side_along(other, slack, direction).is_some())
    }

    /// Whether a shape overlaps another by no more than some slack now, and along the same direction never by more while it moves
    /// straight ahead by so much.
    pub fn leaves(&self, other: &Self, slack: i64, by: Point) -> bool {
        let ahead = |(x, y): Point| {
            let along = i128::from(by.0) * i128::from(x) + i128::from(by.1) * i128::from(y);
            along.signum()
        };
        self.directions_to(other).any(|direction| {
            let side = self.side_along(other, slack, direction);
            side.is_some_and(|side| side * ahead(direction) >= 0)
        })
    }

    /// On which side of another this shape is, if the two overlap by no more than some slack along a direction: 1 if it lies ahead in
    /// that direction, -1 if it lies behind.
    fn side_along(&self, other: &Self, slack: i64, (x, y): Point) -> Option<i128> {
        let apart = i128::from(self.radius + other.radius - slack);
        let along = |point: &Point| {
            i128::from(point.0) * i128::from(x) + i128::from(point.1) * i128::from(y)
        };
        let range = |points: &[Point]| {
            let all = || points.iter().map(along);
            (
                all().min().unwrap_or_default(),
                all().max().unwrap_or_default(),
            )
        };
        let (own, its) = (range(&self.points), range(&other.points));
        let (behind, ahead) = (its.0 - own.1, own.0 - its.1);
        // Both times the length of the direction, `needed` squared.
        let gap = behind.max(ahead);
        let needed = apart.pow(2) * (i128::from(x).pow(2) + i128::from(y).pow(2));
        let is_apart = if apart < 0 {
            gap >= 0 || gap.pow(2) <= needed
        } else {
            gap >= 0 && gap.pow(2) >= needed
        };
        is_apart.then_some(if ahead >= behind { 1 } else { -1 })
    }

    /// The directions in which this shape and another may overlap least.
    fn directions_to(&self, other: &Self) -> impl Iterator<Item = Point> {
        let corners = self.points.iter().flat_map(|own| {
            let others = other.points.iter();
            others.map(|its| (its.0 - own.0, its.1 - own.1))
        });
        let sides = self.across_sides().chain(other.across_sides());
        let directions = sides.chain(corners);
        directions.filter(|&direction| direction != (0, 0))
    }

    /// Directions at right angles to the lines between its points, the sides among them.
    fn across_sides(&self) -> impl Iterator<Item = Point> {
        let points = self.points.iter().enumerate();
        points.flat_map(|(index, one)| {
            let before = self.points[..index].iter();
            before.map(|other| (one.1 - other.1, other.0 - one.0))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: i64 = 1_000_000;
    const HALF: i64 = UNIT / 2;
    /// An eighth of a turn.
    const EIGHTH: i64 = 785_398;

    fn both_ways(one: &Shape, other: &Shape, slack: i64) -> bool {
        let found = one.overlaps(other, slack);
        assert_eq!(other.overlaps(one, slack), found);
        found
    }

    #[test]
    fn squares_overlap_by_more_than_the_slack_or_not_at_all() {
        let square = Shape::square((0, 0), HALF);
        let at = |x: i64, y: i64| Shape::square((x, y), HALF);
        assert!(!both_ways(&square, &at(UNIT, 0), 0));
        assert!(both_ways(&square, &at(UNIT - 1, UNIT - 1), 0));
        assert!(!both_ways(&square, &at(UNIT - 10, 0), 10));
        assert!(both_ways(&square, &at(UNIT - 11, 0), 10));
        assert!(!both_ways(&square, &at(UNIT - 11, UNIT - 10), 10));
    }

    #[test]
    fn a_turned_square_reaches_out_at_its_corners_only() {
        let turned = Shape::turned_square((0, 0), HALF, EIGHTH);
        let reach = 707_107;
        let square = |x: i64, y: i64| Shape::square((x, y), HALF);
        assert!(both_ways(&turned, &square(HALF + reach - 2, 0), 0));
        assert!(!both_ways(&turned, &square(HALF + reach + 2, 0), 0));
        // At the corner of the box around it there is room.
        let corner = HALF + reach / 2;
        assert!(both_ways(&turned, &square(corner - 2, corner - 2), 0));
        assert!(!both_ways(&turned, &square(corner + 2, corner + 2), 0));
    }

    #[test]
    fn circles_are_apart_from_sides_and_corners() {
        let circle = Shape::circle((0, 0), UNIT);
        let square = |x: i64, y: i64| Shape::square((x, y), HALF);
        assert!(both_ways(&circle, &square(UNIT + HALF - 1, 0), 0));
        assert!(!both_ways(&circle, &square(UNIT + HALF, 0), 0));
        // The corner of the square is next to the circle.
        assert!(both_ways(&circle, &square(1_207_106, 1_207_106), 0));
        assert!(!both_ways(&circle, &square(1_207_107, 1_207_107), 0));
        assert!(both_ways(&circle, &square(0, 0), 0));
        let other = Shape::circle((1_414_214, 1_414_214), UNIT);
        assert!(!both_ways(&circle, &other, 0));
        assert!(both_ways(&circle, &other.moved(((0, 0), (-10, 0))), 0));
    }

    #[test]
    fn what_moves_covers_its_way_and_no_more() {
        let way = Shape::circle((0, 0), HALF).moved(((0, 0), (2 * UNIT, 2 * UNIT)));
        let square = |x: i64, y: i64| Shape::square((x, y), HALF);
        assert!(both_ways(&way, &square(UNIT, UNIT), 0));
        assert!(!both_ways(&way, &square(2 * UNIT + HALF, 0), 0));
        // The corner of this one is 0.5 from the middle line.
        assert!(both_ways(&way, &square(1_500_000 + 207_106, 0), 0));
        assert!(!both_ways(&way, &square(1_500_000 + 207_108, 0), 0));
        let way = Shape::square((0, 0), HALF).moved(((0, 0), (UNIT, UNIT)));
        assert!(both_ways(&way, &square(UNIT, -1), 0) && both_ways(&way, &square(UNIT, 0), 0));
        assert!(!both_ways(&way, &square(UNIT + 1, 0 - UNIT + 1), 0));
    }

    #[test]
    fn what_leaves_overlaps_by_no_more_than_the_slack_and_not_by_more_on_its_way() {
        let body = Shape::square((0, 0), HALF);
        let beside = Shape::square((UNIT - 10, 0), HALF);
        let leaves = |slack: i64, by: Point| body.leaves(&beside, slack, by);
        assert!(leaves(10, (-UNIT, 0)) && leaves(10, (0, UNIT)));
        assert!(!leaves(9, (-UNIT, 0)), "it overlaps by more");
        assert!(!leaves(10, (1, 0)), "it moves into it");
        // Past the corner of one that it does not overlap.
        let next = Shape::square((UNIT, UNIT), HALF);
        assert!(body.leaves(&next, 0, (UNIT, -1)) && body.leaves(&next, 0, (-1, UNIT)));
        assert!(!body.leaves(&next, 0, (1, 1)));
    }
}
