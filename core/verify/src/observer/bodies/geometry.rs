//! Rectangles that overlap, and motion between two published poses.

use std::f64::consts::{FRAC_PI_2, PI, SQRT_2, TAU};
use std::time::Duration;

use formation_model::Pose;

/// A heading that changes by less is constant, and a motion that deviates by less from an axis is along it.
const SLACK: f64 = 0.02;
/// Two bodies are compared at moments between which they come nearer by at most this, in units.
const STRIDE: f64 = 0.05;
/// More moments are not compared within one segment.
const MOMENTS_MAX: u32 = 200;

/// What a module looks like from above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    /// The side of a square, or the diameter of a circle.
    pub(super) width: f64,
    pub(super) is_round: bool,
}

/// A pose in units and radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) heading: f64,
}

impl From<Pose> for Placed {
    fn from(pose: Pose) -> Self {
        Self {
            x: pose.x.to_units(),
            y: pose.y.to_units(),
            heading: pose.theta.to_units(),
        }
    }
}

impl Placed {
    /// The other pose as this one sees it: ahead, to the left, and by how much it is turned.
    pub(super) fn sees(&self, other: &Self) -> Self {
        let (sine, cosine) = self.heading.sin_cos();
        let (x, y) = (other.x - self.x, other.y - self.y);
        Self {
            x: x * cosine + y * sine,
            y: y * cosine - x * sine,
            heading: turn(self.heading, other.heading),
        }
    }

    /// How far a corner of a body is at most from where it would be at the other pose.
    pub(super) fn deviation(&self, other: &Self, width: f64) -> f64 {
        let moved = (other.x - self.x).hypot(other.y - self.y);
        moved + turn(self.heading, other.heading).abs() * width / SQRT_2
    }

    /// How far a module that is seen there is off the nearest place at which it can be docked: side by side, with its ports
    /// opposite those of the other.
    pub(super) fn off_docked(&self, width: f64) -> f64 {
        let quarter = (self.heading / FRAC_PI_2).round() * FRAC_PI_2;
        let sides = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)].into_iter();
        let places = sides.map(|(x, y)| Self {
            x,
            y,
            heading: quarter,
        });
        let distances = places.map(|place| self.deviation(&place, width));
        distances.fold(f64::INFINITY, f64::min)
    }
}

/// The smaller angle from one heading to another.
fn turn(from: f64, to: f64) -> f64 {
    (to - from + PI).rem_euclid(TAU) - PI
}

/// A rectangle around a centre: half its length along its heading, and half its width.
#[derive(Clone, Copy, Debug)]
struct Rectangle {
    centre: Placed,
    ahead: f64,
    aside: f64,
}

impl Rectangle {
    fn square(centre: Placed, width: f64) -> Self {
        let half = width / 2.0;
        Self {
            centre,
            ahead: half,
            aside: half,
        }
    }

    /// How far it reaches from its centre along a direction.
    fn reach(&self, direction: f64) -> f64 {
        let (sine, cosine) = (direction - self.centre.heading).sin_cos();
        self.ahead * cosine.abs() + self.aside * sine.abs()
    }

    /// How far the two would have to be shifted to part; negative if they are apart.
    fn depth(&self, other: &Self) -> f64 {
        let (x, y) = (
            other.centre.x - self.centre.x,
            other.centre.y - self.centre.y,
        );
        let headings = [self.centre.heading, other.centre.heading];
        let directions = headings.into_iter().flat_map(|one| [one, one + FRAC_PI_2]);
        directions
            .map(|direction| {
                let (sine, cosine) = direction.sin_cos();
                let apart = (x * cosine + y * sine).abs();
                self.reach(direction) + other.reach(direction) - apart
            })
            .fold(f64::INFINITY, f64::min)
    }
}

/// An even motion from one pose to another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub(super) begin: Duration,
    pub(super) end: Duration,
    pub(super) from: Placed,
    pub(super) to: Placed,
}

impl Leg {
    /// Whether the module is not in one place.
    pub(super) fn moves(&self) -> bool {
        self.from != self.to
    }

    fn length(&self) -> f64 {
        (self.end.saturating_sub(self.begin)).as_secs_f64()
    }

    fn turn(&self) -> f64 {
        turn(self.from.heading, self.to.heading)
    }

    fn at(&self, time: Duration) -> Placed {
        let length = self.length();
        if !self.moves() || length <= 0.0 {
            return self.to;
        }
        let share = time.saturating_sub(self.begin).as_secs_f64() / length;
        let between = |from: f64, to: f64| from + (to - from) * share;
        Placed {
            x: between(self.from.x, self.to.x),
            y: between(self.from.y, self.to.y),
            heading: self.from.heading + self.turn() * share,
        }
    }

    /// Units a second along each axis.
    fn velocity(&self) -> (f64, f64) {
        let length = self.length().max(1.0e-6);
        let speed = |from: f64, to: f64| (to - from) / length;
        (speed(self.from.x, self.to.x), speed(self.from.y, self.to.y))
    }

    /// The time that both legs have in common.
    pub(super) fn common(&self, other: &Self) -> Option<(Duration, Duration)> {
        let (begin, end) = (self.begin.max(other.begin), self.end.min(other.end));
        (begin < end).then_some((begin, end))
    }

    /// The speed at which an error of one clock moves the one body relative to the other: two that drive side by side
    /// have no relative speed, and yet an error of either clock shifts one of them.
    pub(super) fn error_speed(&self, other: &Self, width: f64) -> f64 {
        let (one, two) = (self.velocity(), other.velocity());
        let speeds = [one, two, (one.0 - two.0, one.1 - two.1)];
        let fastest = speeds.map(|(x, y)| x.hypot(y));
        let corner = |leg: &Self| leg.turn().abs() / leg.length().max(1.0e-6) * width / SQRT_2;
        fastest.into_iter().fold(0.0, f64::max) + corner(self) + corner(other)
    }

    /// Whether the bodies could touch at any time: the places that they cross are near each other.
    fn is_near(&self, other: &Self, width: f64) -> bool {
        let overlap = |low: [f64; 2], high: [f64; 2]| {
            low[0].min(low[1]) < high[0].max(high[1]) + width * SQRT_2
        };
        let (one, two) = ([self.from, self.to], [other.from, other.to]);
        let (one_x, two_x) = (one.map(|at| at.x), two.map(|at| at.x));
        let (one_y, two_y) = (one.map(|at| at.y), two.map(|at| at.y));
        overlap(one_x, two_x)
            && overlap(two_x, one_x)
            && overlap(one_y, two_y)
            && overlap(two_y, one_y)
    }

    /// When two bodies overlap the most, and by how much.
    pub(super) fn deepest(&self, other: &Self, body: Body) -> Option<(Duration, f64)> {
        let Body { width, is_round } = body;
        let (begin, end) = self.common(other)?;
        if !self.is_near(other, width) {
            return None;
        }
        let gap = |time: Duration| {
            let (one, two) = (self.at(time), other.at(time));
            (two.x - one.x, two.y - one.y)
        };
        let (before, after) = (gap(begin), gap(end));
        let nearer = (after.0 - before.0).hypot(after.1 - before.1);
        let strides = (nearer + self.turn().abs() + other.turn().abs()) / STRIDE;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped before"
        )]
        let moments = strides.ceil().clamp(1.0, f64::from(MOMENTS_MAX)) as u32;
        (0..=moments)
            .map(|moment| {
                let time = begin + (end - begin) * moment / moments;
                let (one, two) = (self.at(time), other.at(time));
                if is_round {
                    return (time, width - (two.x - one.x).hypot(two.y - one.y));
                }
                let one = Rectangle::square(one, width);
                (time, one.depth(&Rectangle::square(two, width)))
            })
            .filter(|&(_, depth)| depth > 0.0)
            .max_by(|one, two| one.1.total_cmp(&two.1).then(two.0.cmp(&one.0)))
    }

    /// What a body covers on the whole leg; `None` if it turns, or moves askew.
    fn swept(&self, width: f64) -> Option<Rectangle> {
        let seen = self.from.sees(&self.to);
        if seen.heading.abs() > SLACK || seen.x.abs() > SLACK && seen.y.abs() > SLACK {
            return None;
        }
        let half = |moved: f64| (width + moved.abs()) / 2.0;
        Some(Rectangle {
            centre: Placed {
                x: f64::midpoint(self.from.x, self.to.x),
                y: f64::midpoint(self.from.y, self.to.y),
                heading: self.from.heading,
            },
            ahead: half(seen.x),
            aside: half(seen.y),
        })
    }

    /// By how much the places overlap that two bodies cover on their whole legs, whenever they are there.
    pub(super) fn swept_depth(&self, other: &Self, body: Body) -> Option<f64> {
        let width = body.width;
        if !self.is_near(other, width) {
            return None;
        }
        if body.is_round {
            return Some(width - self.distance(other));
        }
        Some(self.swept(width)?.depth(&other.swept(width)?))
    }

    /// How near the lines come to each other along which the middles move.
    fn distance(&self, other: &Self) -> f64 {
        let ends = |leg: &Self| [(leg.from.x, leg.from.y), (leg.to.x, leg.to.y)];
        let ([one, two], [first, second]) = (ends(self), ends(other));
        let side = |at: (f64, f64), [from, to]: [(f64, f64); 2]| {
            (to.0 - from.0) * (at.1 - from.1) - (to.1 - from.1) * (at.0 - from.0)
        };
        let (own, its) = ([one, two], [first, second]);
        let crosses =
            side(first, own) * side(second, own) < 0.0 && side(one, its) * side(two, its) < 0.0;
        if crosses {
            return 0.0;
        }
        let ends = [(one, its), (two, its), (first, own), (second, own)];
        ends.into_iter()
            .map(|(at, line)| off_line(at, line))
            .fold(f64::INFINITY, f64::min)
    }
}

/// The distance of a point from the line between two others.
fn off_line((x, y): (f64, f64), [from, to]: [(f64, f64); 2]) -> f64 {
    let (right, up) = (to.0 - from.0, to.1 - from.1);
    let squared = right * right + up * up;
    let share = if squared > 0.0 {
        (((x - from.0) * right + (y - from.1) * up) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (from.0 + right * share - x).hypot(from.1 + up * share - y)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: Body = Body {
        width: 0.9,
        is_round: false,
    };

    fn leg(from: (f64, f64, f64), to: (f64, f64, f64)) -> Leg {
        let placed = |(x, y, heading)| Placed { x, y, heading };
        Leg {
            begin: Duration::from_secs(1),
            end: Duration::from_secs(2),
            from: placed(from),
            to: placed(to),
        }
    }

    #[track_caller]
    fn assert_depth(one: &Leg, other: &Leg, expected: Option<f64>) {
        for (one, other) in [(one, other), (other, one)] {
            let depth = one.deepest(other, BODY).map(|(_, depth)| depth);
            match (depth, expected) {
                (None, None) => {}
                (Some(depth), Some(expected)) if (depth - expected).abs() < 0.03 => {}
                _ => panic!("{depth:?} is not {expected:?}"),
            }
        }
    }

    #[test]
    fn bodies_are_compared_at_every_moment() {
        let right = leg((0.0, 0.0, 0.0), (4.0, 0.0, 0.0));
        assert_depth(&right, &leg((2.0, 0.5, 0.0), (2.0, 0.5, 0.0)), Some(0.4));
        assert_depth(&right, &leg((2.0, 1.0, 0.0), (2.0, 1.0, 0.0)), None);
        assert_depth(&right, &leg((4.0, 0.0, 0.0), (0.0, 0.0, 0.0)), Some(0.9));
        assert_depth(&right, &leg((1.0, 0.0, 0.0), (5.0, 0.0, 0.0)), None);
        let corner = std::f64::consts::FRAC_PI_4;
        assert_depth(&right, &leg((2.0, 1.1, corner), (2.0, 1.1, corner)), None);
        assert_depth(
            &right,
            &leg((2.0, 0.9, 0.0), (2.0, 0.9, 2.0 * corner)),
            Some(0.186),
        );
    }

    #[test]
    fn places_are_compared_whenever_bodies_are_there() {
        let right = leg((0.0, 0.0, 0.0), (4.0, 0.0, 0.0));
        let after = leg((-1.0, 0.0, 0.0), (3.0, 0.0, 0.0));
        assert!(right.swept_depth(&after, BODY).unwrap() > 0.8);
        let parallel = leg((0.0, 1.0, 0.0), (4.0, 1.0, 0.0));
        assert!(right.swept_depth(&parallel, BODY).unwrap() < 0.0);
        let turning = leg((0.0, 0.0, 0.0), (0.0, 0.0, 1.0));
        assert_eq!(right.swept_depth(&turning, BODY), None);
    }

    #[test]
    fn round_bodies_pass_each_other_at_their_corners() {
        let round = Body {
            is_round: true,
            ..BODY
        };
        let right = leg((0.0, 0.0, 0.0), (4.0, 0.0, 0.0));
        let beside = leg((2.0, 0.95, 0.7), (2.0, 0.95, 0.7));
        assert!(right.deepest(&beside, BODY).is_some());
        assert!(right.deepest(&beside, round).is_none());
        let after = leg((4.5, 0.8, 0.0), (5.0, 1.5, 0.0));
        assert!(right.swept_depth(&after, round).unwrap() < 0.0);
        let across = leg((1.0, -2.0, 0.0), (3.0, 2.0, 0.0));
        assert!(right.swept_depth(&across, round).unwrap() > 0.89);
    }
}
