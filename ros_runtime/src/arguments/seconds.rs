//! Times in seconds.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use crate::parameters::Range;

/// The longest time that an argument may name: a week.
const SECONDS_MAX: f64 = 604_800.0;
const SECONDS_MIN: f64 = 0.001;

/// A time in seconds, greater than zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seconds(pub Duration);

impl FromStr for Seconds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.trim()
            .parse::<f64>()
            .ok()
            .filter(|seconds| (SECONDS_MIN..=SECONDS_MAX).contains(seconds))
            .map(|seconds| Self(Duration::from_secs_f64(seconds)))
            .ok_or_else(|| {
                format!("must be seconds from {SECONDS_MIN} to {SECONDS_MAX}, got `{text}`")
            })
    }
}

impl fmt::Display for Seconds {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.as_secs_f64().fmt(formatter)
    }
}

/// The range of such a time as a parameter.
pub const SECONDS: Range = Range::Double {
    from: SECONDS_MIN,
    to: SECONDS_MAX,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_finite_and_positive() {
        assert_eq!("0.5".parse(), Ok(Seconds(Duration::from_millis(500))));
        for bad in ["0", "-1", "inf", "NaN", "1e9", "soon", ""] {
            assert!(bad.parse::<Seconds>().is_err(), "{bad}");
        }
    }
}
