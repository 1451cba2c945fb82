//! The standard messages that ours are built on.

use std::time;

use serde::{Deserialize, Serialize};

use crate::check::{Checked, FieldError};

/// A point in time, as `builtin_interfaces/msg/Time` has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds since 1970-01-01 UTC, or since the start of simulated time.
    pub sec: i32,
    /// Nanoseconds within the second, below 10^9.
    pub nanosec: u32,
}

/// When and in which frame, as `std_msgs/msg/Header` has it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// When the data was taken.
    pub stamp: Time,
    /// The frame of its poses (REP-105).
    pub frame_id: String,
}

/// A span of time, as `builtin_interfaces/msg/Duration` has it; none of ours is negative.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Duration {
    /// Whole seconds.
    pub sec: i32,
    /// Nanoseconds on top of them, below 10^9.
    pub nanosec: u32,
}

impl From<time::Duration> for Time {
    /// Ends at the latest time of the wire, in 2038.
    fn from(since_1970: time::Duration) -> Self {
        let Duration { sec, nanosec } = since_1970.into();
        Self { sec, nanosec }
    }
}

impl Time {
    /// The time since 1970.
    pub(crate) fn validated(self, field: &str) -> Checked<time::Duration> {
        let Self { sec, nanosec } = self;
        Duration { sec, nanosec }.validated(field)
    }
}

impl From<time::Duration> for Duration {
    /// Ends at the longest span of the wire, 68 years.
    fn from(span: time::Duration) -> Self {
        i32::try_from(span.as_secs()).map_or(
            Self {
                sec: i32::MAX,
                nanosec: 999_999_999,
            },
            |sec| Self {
                sec,
                nanosec: span.subsec_nanos(),
            },
        )
    }
}

impl Duration {
    pub(crate) fn validated(self, field: &str) -> Checked<time::Duration> {
        match u64::try_from(self.sec) {
            Ok(sec) if self.nanosec < 1_000_000_000 => Ok(time::Duration::new(sec, self.nanosec)),
            _ => {
                let reason = "needs sec >= 0 and nanosec < 10^9";
                Err(FieldError::contradiction(field, reason))
            }
        }
    }
}
