//! What a body covers, as an outsider sees it: spots, and the cells of others.

use formation_model::{Pose, Target};

use super::contact::nearest;

/// A body of any width stands on a spot if it is nearer to it than half the pitch of the lattice.
const HALF_WIDTH_UNITS: f64 = 0.5;

/// Poses are whole millionths of a unit.
const ROUNDING_UNITS: f64 = 1e-6;

/// Whether bodies on these lines keep all others off a spot.
pub(super) fn is_covered(spot: &Pose, lines: &[(Pose, Pose)], target: &Target) -> bool {
    let width = target.surroundings().body_width().to_units();
    lines.iter().any(|(from, to)| {
        is_near_line(spot, from, to) || reaches_into_cell(spot, (from, to), width)
    })
}

/// Whether a square body of this width that goes from one pose to another comes into the cell of a spot, whose sides are one unit.
fn reaches_into_cell(spot: &Pose, (from, to): (&Pose, &Pose), width: f64) -> bool {
    let reach = |pose: &Pose| {
        let heading = pose.theta.to_units();
        (heading.cos().abs() + heading.sin().abs()) * width / 2.0
    };
    // The part of the line on which body and cell overlap along both axes.
    let turns = from.theta != to.theta;
    let farthest = match turns {
        true => width * std::f64::consts::FRAC_1_SQRT_2,
        false => reach(from),
    };
    let limit = HALF_WIDTH_UNITS + farthest - ROUNDING_UNITS;
    let ((x, y), (from_x, from_y), (to_x, to_y)) = (units(spot), units(from), units(to));
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for (begin, end) in [(from_x - x, to_x - x), (from_y - y, to_y - y)] {
        let way = end - begin;
        if way.abs() <= ROUNDING_UNITS {
            if begin.abs() >= limit {
                return false;
            }
            continue;
        }
        let (one, other) = ((-limit - begin) / way, (limit - begin) / way);
        first = first.max(one.min(other));
        last = last.min(one.max(other));
    }
    first <= last
}

fn units(pose: &Pose) -> (f64, f64) {
    (pose.x.to_units(), pose.y.to_units())
}

pub(super) fn is_on(body: &Pose, spot: &Pose) -> bool {
    is_near_line(spot, body, body)
}

/// Whether a point is nearer than half a module to the line between two others.
fn is_near_line(point: &Pose, from: &Pose, to: &Pose) -> bool {
    let ((x, y), (from_x, from_y), (to_x, to_y)) = (units(point), units(from), units(to));
    nearest((from_x - x, from_y - y), (to_x - x, to_y - y)) < HALF_WIDTH_UNITS
}
