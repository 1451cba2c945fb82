//! What bodies cover, as rectangles along the axes.

use crate::turning::rotated;
use crate::{Area, MicroUnits, Pose, polyline};

impl Area {
    /// What a body of this width covers, and the corners between its headings and the axes.
    #[must_use]
    pub fn of_body(pose: &Pose, width: MicroUnits) -> Self {
        let half = width.0 / 2;
        let corners = [(half, half), (half, -half)].map(|corner| rotated(corner, pose.theta.0));
        let reach = |along: fn(&(i64, i64)) -> i64| {
            let reaches = corners.iter().map(|corner| along(corner).abs());
            reaches.max().unwrap_or(half)
        };
        let (across, along) = (reach(|corner| corner.0), reach(|corner| corner.1));
        let corner = |sign: i64| {
            let (x, y) = (pose.x.0 + sign * across, pose.y.0 + sign * along);
            (MicroUnits(x), MicroUnits(y))
        };
        Self {
            low: corner(-1),
            high: corner(1),
        }
    }

    /// What a body of this width covers at any heading, in rectangles: at most a part in 32 of its extent too much on each side.
    pub fn of_turned_body(pose: &Pose, width: MicroUnits) -> Vec<Self> {
        const PARTS: i64 = 32;
        let around = Self::of_body(pose, width);
        let half = width.0 / 2;
        let corner = |right: i64, up: i64| {
            let (x, y) = rotated((right, up), pose.theta.0);
            (pose.x.0 + x, pose.y.0 + y)
        };
        let corners = [(half, half), (-half, half), (-half, -half), (half, -half)]
            .map(|(right, up)| corner(right, up));
        let (low, high) = (around.low.1.0, around.high.1.0);
        let strip = |part: i64| {
            let bottom = low + (high - low) * part / PARTS;
            let top = low + (high - low) * (part + 1) / PARTS;
            // Where its sides enter and leave the strip, and the corners in it.
            let sides = (0..4).map(|side| (corners[side], corners[(side + 1) % 4]));
            let at = |((x, y), (to_x, to_y)): ((i64, i64), (i64, i64)), height: i64| {
                let height = height.clamp(y.min(to_y), y.max(to_y));
                let rise = i128::from(to_y - y);
                if rise == 0 {
                    return [x.min(to_x), x.max(to_x)];
                }
                let along = i128::from(to_x - x) * i128::from(height - y) / rise;
                let across = x + i64::try_from(along).unwrap_or_default();
                [across, across]
            };
            let meets = |&((_, y), (_, to_y)): &((i64, i64), (i64, i64))| {
                y.min(to_y) <= top && bottom <= y.max(to_y)
            };
            let ends = sides.filter(meets).flat_map(|side| {
                let ends = [at(side, bottom), at(side, top)];
                ends.into_iter().flatten()
            });
            let (left, right) = ends.fold((i64::MAX, i64::MIN), |(left, right), x| {
                (left.min(x - 1), right.max(x + 1))
            });
            (left < right).then_some(Self {
                low: (MicroUnits(left), MicroUnits(bottom)),
                high: (MicroUnits(right), MicroUnits(top)),
            })
        };
        (0..PARTS).filter_map(strip).collect()
    }

    /// What a round body of this diameter covers: rectangles that hold the circle and reach beyond it by at most a sixteenth of its
    /// radius.
    pub fn of_round_body(pose: &Pose, width: MicroUnits) -> Vec<Self> {
        const PARTS: i64 = 8;
        let square = (width.0 / 2).pow(2);
        let reach = |part: i64| (square * part / PARTS).isqrt() + 1;
        let corner = |right: i64, up: i64| (pose.x + MicroUnits(right), pose.y + MicroUnits(up));
        let around = |part: i64| {
            let (across, along) = (reach(PARTS - part), reach(part + 1));
            Self {
                low: corner(-across, -along),
                high: corner(across, along),
            }
        };
        (0..PARTS).map(around).collect()
    }

    /// What a body of this width covers in any heading.
    fn of_turning_body(pose: &Pose, width: MicroUnits) -> Self {
        let half = width.0 / 2;
        let reach = (2 * half * half).isqrt() + 1;
        let corner = |reach: i64| (MicroUnits(pose.x.0 + reach), MicroUnits(pose.y.0 + reach));
        Self {
            low: corner(-reach),
            high: corner(reach),
        }
    }

    /// What a body of this width covers at a pose on the line between two others. Where their headings differ, it may have any.
    fn of_body_between(ends: (&Pose, &Pose)) -> fn(&Pose, MicroUnits) -> Self {
        match ends.0.theta == ends.1.theta {
            true => Self::of_body,
            false => Self::of_turning_body,
        }
    }

    /// What a body of this width may cover on a part of the line between two poses, in rectangles around places at most `spacing`
    /// apart.
    pub fn along_line(
        ends: (&Pose, &Pose),
        part: (Pose, Pose),
        width: MicroUnits,
        spacing: MicroUnits,
    ) -> Vec<Self> {
        let area_of = Self::of_body_between(ends);
        let ends_of_part: [Pose; 2] = part.into();
        let poses = polyline::sampled(&ends_of_part, spacing);
        poses.map(|pose| area_of(&pose, width)).collect()
    }

    /// The rectangle around all that a body of this width may cover on the line between two poses.
    pub fn around_line((from, to): (&Pose, &Pose), width: MicroUnits) -> Self {
        let area_of = Self::of_body_between((from, to));
        area_of(from, width).joined(&area_of(to, width))
    }

    fn joined(&self, other: &Self) -> Self {
        Self {
            low: (self.low.0.min(other.low.0), self.low.1.min(other.low.1)),
            high: (self.high.0.max(other.high.0), self.high.1.max(other.high.1)),
        }
    }

    /// The rectangle around what bodies of this width cover.
    pub fn of_bodies(poses: [&Pose; 2], width: MicroUnits) -> Self {
        let [first, second] = poses.map(|pose| Self::of_body(pose, width));
        first.joined(&second)
    }

    /// Both corners, in micro-units.
    pub fn corners(&self) -> ((i64, i64), (i64, i64)) {
        let point = |corner: (MicroUnits, MicroUnits)| (corner.0.0, corner.1.0);
        (point(self.low), point(self.high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_body_covers_its_circle_and_little_more() {
        let pose = Pose::from_units(2.0, -1.0, 0.7).unwrap();
        let areas = Area::of_round_body(&pose, MicroUnits(900_000));
        let is_covered = |radius: f64, angle: f64| {
            let (sine, cosine) = angle.sin_cos();
            let point = Pose::from_units(2.0 + radius * cosine, radius * sine - 1.0, 0.0).unwrap();
            let mut areas = areas.iter();
            areas.any(|area| {
                let ((left, bottom), (right, top)) = area.corners();
                (left..=right).contains(&point.x.0) && (bottom..=top).contains(&point.y.0)
            })
        };
        for degree in 0..360 {
            let angle = f64::from(degree).to_radians();
            assert!(is_covered(0.45, angle), "{degree}");
            assert!(!is_covered(0.45 + 0.45 / 16.0, angle), "{degree}");
        }
    }

    /// Half of the diagonal of a body of 0.9 units is 0.636 units.
    #[test]
    fn a_body_that_turns_covers_its_corners_in_every_heading() {
        let pose = |x, theta| Pose::from_units(x, 0.0, theta).unwrap();
        let width = crate::BODY_WIDTH;
        let reach = |from, to| Area::around_line((&from, &to), width).high.1.to_units();
        assert!((reach(pose(0.0, 0.0), pose(2.0, 0.0)) - 0.45).abs() < 0.001);
        assert!((reach(pose(0.0, 0.0), pose(0.0, 3.0)) - 0.636).abs() < 0.001);
        let line = (pose(0.0, 0.0), pose(0.0, 3.0));
        let along = Area::along_line((&line.0, &line.1), line, width, width);
        assert!(along.iter().all(|area| area.high.1.to_units() > 0.636));
    }
}
