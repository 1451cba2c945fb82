//! Angles in micro-radians and the rotation of points, in whole numbers.

/// A point in micro-units.
pub type Point = (i64, i64);

/// A quarter turn in units of 10^-10 radians.
const QUARTER: i64 = 15_707_963_268;
/// How many of these units make a micro-radian.
const PER_MICRO: i64 = 10_000;
/// One, in the fixed-point numbers of the series.
const ONE: i128 = 1_000_000_000_000;

/// The number of quarter turns that is nearest to an angle.
pub fn quarters(angle: i64) -> i64 {
    (angle * PER_MICRO + QUARTER / 2).div_euclid(QUARTER)
}

/// The angle of some quarter turns.
pub fn angle_of(quarters: i64) -> i64 {
    (quarters * QUARTER + PER_MICRO / 2).div_euclid(PER_MICRO)
}

/// How far an angle is from the nearest quarter turn.
pub fn off_quarter(angle: i64) -> i64 {
    angle - angle_of(quarters(angle))
}

/// The angle between -half a turn (excluded) and half a turn (included) of the same direction.
pub fn shortest(angle: i64) -> i64 {
    let full = 4 * QUARTER;
    let reduced = (angle * PER_MICRO).rem_euclid(full);
    let signed = if reduced > full / 2 {
        reduced - full
    } else {
        reduced
    };
    signed.div_euclid(PER_MICRO)
}

/// A point rotated counter-clockwise about the origin by quarter turns; exact.
pub fn by_quarters((x, y): Point, quarters: i64) -> Point {
    match quarters.rem_euclid(4) {
        0 => (x, y),
        1 => (-y, x),
        2 => (-x, -y),
        _ => (y, -x),
    }
}

/// A point rotated counter-clockwise about the origin, off by about a millionth of its distance at most.
pub fn rotated(offset: Point, angle: i64) -> Point {
    let (x, y) = by_quarters(offset, quarters(angle));
    let rest = i128::from(off_quarter(angle)) * 1_000_000;
    let square = rest * rest / ONE;
    // The series of sine and cosine to the ninth power; the rest is at most an eighth of a turn.
    let term = |inner: i128, divisor: i128| ONE - square * inner / ONE / divisor;
    let cosine = term(term(term(term(ONE, 56), 30), 12), 2);
    let sine = rest * term(term(term(term(ONE, 72), 42), 20), 6) / ONE;
    let (x, y) = (i128::from(x), i128::from(y));
    let rounded = |sum: i128| i64::try_from((sum + ONE / 2).div_euclid(ONE)).unwrap_or_default();
    (
        rounded(x * cosine - y * sine),
        rounded(x * sine + y * cosine),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_agrees_with_floats() {
        for step in -40_i32..40 {
            let angle = i64::from(step) * 157_079;
            let (sine, cosine) = (f64::from(step) * 0.157_079).sin_cos();
            let (x, y) = rotated((3_000_000, -7_000_000), angle);
            let expected = (3.0 * cosine + 7.0 * sine, 3.0 * sine - 7.0 * cosine);
            let off = |found: i64, expected: f64| {
                let expected = crate::MicroUnits::from_units(expected).unwrap().0;
                (found - expected).abs()
            };
            assert!(
                off(x, expected.0) <= 10 && off(y, expected.1) <= 10,
                "{step}"
            );
        }
    }

    #[test]
    fn angles_reduce_to_half_a_turn() {
        assert_eq!(quarters(3_141_592), 2);
        assert!(off_quarter(3_141_592).abs() <= 1);
        assert_eq!(shortest(0), 0);
        assert!((shortest(4_712_389) + 1_570_796).abs() <= 2);
        assert_eq!(by_quarters((2, 1), 1), (-1, 2));
    }
}
