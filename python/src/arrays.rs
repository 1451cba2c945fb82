//! Numbers as bytes, which NumPy reads without a copy of each.

use formation_model::Pose;

/// Appends a number as the eight bytes of a double in the order of this machine.
fn push(bytes: &mut Vec<u8>, number: f64) {
    bytes.extend(number.to_ne_bytes());
}

/// Poses as rows of x, y (units) and theta (radians).
pub fn pose_rows<'a>(poses: impl Iterator<Item = &'a Pose>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for pose in poses {
        for number in [pose.x, pose.y, pose.theta] {
            push(&mut bytes, number.to_units());
        }
    }
    bytes
}

/// Numbers one after another.
pub fn numbers(values: impl Iterator<Item = f64>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for value in values {
        push(&mut bytes, value);
    }
    bytes
}

/// Identifiers and positions, each of eight bytes.
pub fn integers(values: impl Iterator<Item = i64>) -> Vec<u8> {
    values.flat_map(i64::to_ne_bytes).collect()
}
