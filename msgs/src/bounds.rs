//! How much one message may hold; the `.msg` files state the same numbers.

use formation_model::{COORDINATE_LIMIT_UNITS, MICRO_PER_UNIT, POLYLINE_POSES_MAX};
pub use formation_model::{
    EDGES_MAX, LINKS_MAX, MODULES_MAX, NAME_BYTES_MAX, OBSTACLES_MAX, SPOTS_MAX,
};

/// The greatest magnitude of a coordinate, in micro-units.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the limit is a whole number far below 2^63"
)]
pub(crate) const COORDINATE_LIMIT_MICRO: i64 = COORDINATE_LIMIT_UNITS as i64 * MICRO_PER_UNIT;
/// Numbers of the path on which a body may be: three for each pose after the first.
pub const PATH_NUMBERS_MAX: usize = 3 * (POLYLINE_POSES_MAX - 1);
/// Options of a policy.
pub const POLICY_OPTIONS_MAX: usize = 64;
/// Violations in one verdict.
pub const VIOLATIONS_MAX: usize = 256;
/// Bytes of one violation.
pub const VIOLATION_BYTES_MAX: usize = 1024;
/// Bytes of the reason for a refusal.
pub const REASON_BYTES_MAX: usize = 1024;
/// Bytes of what an answer says to people.
pub const ANSWER_BYTES_MAX: usize = 1024;

/// The longest beginning of the text that fits into `bytes_max` bytes of UTF-8.
#[must_use]
pub fn shortened(mut text: String, bytes_max: usize) -> String {
    let end = (0..=bytes_max.min(text.len()))
        .rev()
        .find(|&end| text.is_char_boundary(end));
    text.truncate(end.unwrap_or(0));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_cut_between_characters() {
        let short = |bytes_max| shortened("a\u{e4}b".to_owned(), bytes_max);
        let cut: Vec<String> = (0..6).map(short).collect();
        assert_eq!(cut, ["", "a", "a", "a\u{e4}", "a\u{e4}b", "a\u{e4}b"]);
    }
}
