//! Straight lines from pose to pose, on which the body of a module may be.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{MicroUnits, Pose};

/// The most poses of a polyline. The path of a module that needs more is not used (`formation_motion`).
pub const POLYLINE_POSES_MAX: usize = 256;

/// Straight lines from each pose to the next; at least one pose and at most [`POLYLINE_POSES_MAX`]. Cheap to clone.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "Vec<Pose>", into = "Vec<Pose>")]
pub struct Polyline(Arc<[Pose]>);

/// Why poses make no polyline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{0} poses make no polyline, which has 1 to {POLYLINE_POSES_MAX}")]
pub struct PolylineError(pub usize);

impl TryFrom<Vec<Pose>> for Polyline {
    type Error = PolylineError;

    fn try_from(poses: Vec<Pose>) -> Result<Self, PolylineError> {
        if (1..=POLYLINE_POSES_MAX).contains(&poses.len()) {
            Ok(Self(poses.into()))
        } else {
            Err(PolylineError(poses.len()))
        }
    }
}

impl From<Polyline> for Vec<Pose> {
    fn from(polyline: Polyline) -> Self {
        polyline.0.to_vec()
    }
}

impl Polyline {
    /// A straight line.
    #[must_use]
    pub fn line(from: Pose, to: Pose) -> Self {
        Self([from, to].into())
    }

    /// The polyline through these poses, without those that lie on the line between their neighbours.
    pub fn through(poses: impl IntoIterator<Item = Pose>) -> Result<Self, PolylineError> {
        let mut corners: Vec<Pose> = Vec::new();
        for pose in poses {
            if corners.last() == Some(&pose) {
                continue;
            }
            if let [.., before, last] = corners[..]
                && goes_on(&before, &last, &pose)
            {
                corners.pop();
            }
            corners.push(pose);
        }
        Self::try_from(corners)
    }

    /// The poses, of which there is at least one.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        &self.0
    }
}

/// Whether a body that keeps its heading goes on from `middle` to `to` in the direction in which it came from `from`.
fn goes_on(from: &Pose, middle: &Pose, to: &Pose) -> bool {
    let (before, after) = (offset(from, middle), offset(middle, to));
    let is_straight = before.0 * after.1 == before.1 * after.0;
    let is_ahead = before.0 * after.0 + before.1 * after.1 > 0;
    from.theta == middle.theta && middle.theta == to.theta && is_straight && is_ahead
}

/// The position of a pose as seen from another, wide enough for products.
fn offset(from: &Pose, to: &Pose) -> (i128, i128) {
    let along = |from: MicroUnits, to: MicroUnits| i128::from(to.0) - i128::from(from.0);
    (along(from.x, to.x), along(from.y, to.y))
}

/// The lines between poses; one of no length if there is one pose.
pub fn lines(poses: &[Pose]) -> impl Iterator<Item = (&Pose, &Pose)> {
    let last = poses.len().saturating_sub(1);
    let ends = poses.iter().enumerate().take(last.max(1));
    ends.map(move |(index, from)| (from, &poses[(index + 1).min(last)]))
}

/// How long the lines between poses are together.
pub fn length(poses: &[Pose]) -> MicroUnits {
    let lengths = lines(poses).map(|(from, to)| from.distance_to(to).0);
    MicroUnits(lengths.fold(0, i64::saturating_add))
}

/// Poses on the lines between poses, at most `spacing` apart.
pub fn sampled(poses: &[Pose], spacing: MicroUnits) -> impl Iterator<Item = Pose> {
    lines(poses).flat_map(move |(&from, &to)| {
        let parts = from.distance_to(&to).0 / spacing.0.max(1) + 1;
        let last = if from == to { 0 } else { parts };
        let between = move |from: MicroUnits, to: MicroUnits, part: i64| {
            let way = i128::from(to.0 - from.0) * i128::from(part) / i128::from(parts);
            MicroUnits(from.0 + i64::try_from(way).unwrap_or_default())
        };
        (0..=last).map(move |part| Pose {
            x: between(from.x, to.x, part),
            y: between(from.y, to.y, part),
            theta: if part == last { to.theta } else { from.theta },
        })
    })
}

/// Into how many parts other places divide a line at most; if they would divide it into more, none does.
const PARTS_MAX: usize = 64;

/// The parts of the line between two poses that are no nearer to any of some places than a distance, or a few micro-units longer.
pub fn parts_away_from(
    (from, to): (&Pose, &Pose),
    places: &[Pose],
    distance: MicroUnits,
) -> Vec<(Pose, Pose)> {
    let length = i128::from(from.distance_to(to).0);
    if length == 0 {
        let mut places = places.iter();
        let is_away = places.all(|place| from.distance_to(place) >= distance);
        return Vec::from_iter(is_away.then_some((*from, *to)));
    }
    let line = offset(from, to);
    let near = places.iter().filter_map(|place| {
        let to_place = offset(from, place);
        let progress = (line.0 * to_place.0 + line.1 * to_place.1) / length;
        // Rounded such that the part that is left out is not longer than it is.
        let across = (line.0 * to_place.1 - line.1 * to_place.0).abs() / length + 1;
        let half = (i128::from(distance.0).pow(2) - across.pow(2))
            .max(0)
            .isqrt()
            - 2;
        (half > 0).then_some((progress - half, progress + half))
    });
    let mut parts = vec![(0, length)];
    for (first, last) in near {
        let cut = parts.into_iter().flat_map(|(begin, end)| {
            let (before, after) = ((begin, end.min(first)), (begin.max(last), end));
            let is_left = |part: &(i128, i128)| part.0 <= part.1;
            [Some(before), Some(after).filter(|_| last <= end)]
                .into_iter()
                .flatten()
                .filter(is_left)
        });
        parts = cut.collect();
        if parts.len() > PARTS_MAX {
            return vec![(*from, *to)];
        }
    }
    let at = |along: i128| {
        let between = |from: MicroUnits, way: i128| {
            MicroUnits(from.0 + i64::try_from(way * along / length).unwrap_or_default())
        };
        match along {
            0 => *from,
            _ if along == length => *to,
            _ => Pose {
                x: between(from.x, line.0),
                y: between(from.y, line.1),
                theta: from.theta,
            },
        }
    };
    let ends = parts.into_iter().map(|(begin, end)| (at(begin), at(end)));
    ends.collect()
}

/// The distance of a point from the nearest of the lines between poses; `None` if there is no pose.
pub fn distance(point: &Pose, poses: &[Pose]) -> Option<MicroUnits> {
    let distances = lines(poses).map(|(from, to)| distance_to_line(point, from, to));
    distances.min()
}

/// The distance of a point from the straight line between two others, rounded to whole micro-units.
fn distance_to_line(point: &Pose, from: &Pose, to: &Pose) -> MicroUnits {
    let (line, offset) = (offset(from, to), offset(from, point));
    let length = i128::from(from.distance_to(to).0);
    let progress = line.0 * offset.0 + line.1 * offset.1;
    if progress <= 0 || length == 0 {
        return from.distance_to(point);
    }
    if progress >= line.0 * line.0 + line.1 * line.1 {
        return to.distance_to(point);
    }
    // Coordinates are at most 10^12 micro-units, so the products fit.
    let area = (line.0 * offset.1 - line.1 * offset.0).abs();
    MicroUnits(i64::try_from(area / length).unwrap_or(i64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MICRO_PER_UNIT;

    fn at(x: f64, y: f64) -> Pose {
        Pose::from_units(x, y, 0.0).unwrap()
    }

    #[test]
    fn the_distance_to_a_line_ends_at_its_ends() {
        let (from, to) = (at(1.0, 1.0), at(4.0, 5.0));
        for (point, distance) in [
            (at(1.0, 0.0), 1.0),
            (at(4.0, 7.0), 2.0),
            (at(2.5, 3.0), 0.0),
            (at(-1.5, 5.5), 4.7),
            (at(6.5, 0.0), 5.0),
        ] {
            let found = distance_to_line(&point, &from, &to);
            assert!((found.to_units() - distance).abs() < 1.0e-5, "{point:?}");
        }
        assert_eq!(
            distance_to_line(&at(1.0, 2.0), &from, &from),
            MicroUnits::ONE
        );
        let (far, corner) = (at(-1.0e6, -1.0e6), at(1.0e6, 1.0e6));
        let off = distance_to_line(&at(1.0e6, -1.0e6), &far, &corner);
        assert!((off.to_units() - 1_414_213.562).abs() < 1.0e-2);
    }

    #[test]
    fn what_is_near_other_places_is_cut_out_of_a_line() {
        let parts = |places: &[Pose]| {
            let (from, to) = (at(0.0, 0.0), at(4.0, 3.0));
            let parts = parts_away_from((&from, &to), places, MicroUnits(900_000));
            let along = |pose: &Pose| (from.distance_to(pose).to_units() * 1_000.0).round();
            let parts = parts.iter().map(|(begin, end)| (along(begin), along(end)));
            parts.collect::<Vec<_>>()
        };
        let all = [(0.0, 5_000.0)];
        assert_eq!(parts(&[]), all);
        assert_eq!(parts(&[at(2.5, 0.5), at(-1.0, 0.0), at(6.0, 4.0)]), all);
        assert_eq!(parts(&[at(1.6, 1.2)]), [(0.0, 1_100.0), (2_900.0, 5_000.0)]);
        assert_eq!(parts(&[at(4.0, 3.0)]), [(0.0, 4_100.0)]);
        assert_eq!(parts(&[at(0.0, 0.0)]), [(900.0, 5_000.0)]);
        let two = parts(&[at(1.6, 1.2), at(2.4, 1.8)]);
        assert_eq!(two, [(0.0, 1_100.0), (3_900.0, 5_000.0)]);
        let beside = parts(&[at(2.18, 2.26)]);
        assert_eq!(beside, [(0.0, 2_352.0), (3_848.0, 5_000.0)]);
        let here = at(1.0, 1.0);
        let nowhere = parts_away_from((&here, &here), &[at(1.5, 1.0)], MicroUnits(900_000));
        assert_eq!(nowhere, []);
    }

    #[test]
    fn poses_in_between_are_left_out() {
        let steps = [
            (0.0, 0.0),
            (0.0, 0.0),
            (1.0, 0.0),
            (2.0, 0.0),
            (2.0, 1.0),
            (2.0, 3.0),
        ];
        let line = Polyline::through(steps.map(|(x, y)| at(x, y))).unwrap();
        assert_eq!(line.poses(), [at(0.0, 0.0), at(2.0, 0.0), at(2.0, 3.0)]);
        let back = Polyline::through([at(0.0, 0.0), at(2.0, 0.0), at(1.0, 0.0)]).unwrap();
        assert_eq!(
            back.poses().len(),
            3,
            "a body that turns back has been further away"
        );
        let turn = Pose::from_units(1.0, 0.0, 1.0).unwrap();
        let turned = Polyline::through([at(0.0, 0.0), at(1.0, 0.0), turn]).unwrap();
        assert_eq!(turned.poses().len(), 3);
    }

    #[test]
    fn a_polyline_has_a_pose_and_not_too_many() {
        assert_eq!(Polyline::through([]), Err(PolylineError(0)));
        let corner = |index: usize| {
            at(
                f64::from(u32::try_from(index).unwrap()),
                f64::from(index.is_multiple_of(2)),
            )
        };
        let corners = |count: usize| Polyline::through((0..count).map(corner));
        assert!(corners(POLYLINE_POSES_MAX).is_ok());
        assert_eq!(
            corners(POLYLINE_POSES_MAX + 1),
            Err(PolylineError(POLYLINE_POSES_MAX + 1))
        );
    }

    #[test]
    fn samples_fill_the_lines() {
        let poses = [at(0.0, 0.0), at(2.0, 0.0), at(2.0, 1.0)];
        let samples: Vec<Pose> = sampled(&poses, MicroUnits(MICRO_PER_UNIT / 2)).collect();
        assert_eq!(
            (samples[0], samples[samples.len() - 1]),
            (poses[0], poses[2])
        );
        for pair in samples.windows(2) {
            assert!(pair[0].distance_to(&pair[1]).0 <= MICRO_PER_UNIT / 2);
        }
        assert_eq!(sampled(&poses[..1], MicroUnits::ONE).count(), 1);
        assert_eq!(sampled(&[], MicroUnits::ONE).count(), 0);
    }
}
