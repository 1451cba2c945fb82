//! Wall-clock time, for stamps and for telling one run of a process from the next.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use formation::model::Incarnation;
use formation_msgs::{Header, Time};

fn since_epoch() -> Duration {
    // A clock before 1970 is taken for one that was never set.
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
}

/// A header for data taken now.
pub(crate) fn header(frame_id: &str) -> Header {
    let now = since_epoch();
    Header {
        stamp: Time {
            sec: i32::try_from(now.as_secs()).unwrap_or(i32::MAX),
            nanosec: now.subsec_nanos(),
        },
        frame_id: frame_id.to_owned(),
    }
}

/// An incarnation for a process that starts now.
#[must_use]
pub fn incarnation() -> Incarnation {
    Incarnation(u64::try_from(since_epoch().as_micros()).unwrap_or(u64::MAX))
}

/// A revision for a target that is announced now: later announcements have greater ones.
#[must_use]
pub fn revision() -> u64 {
    u64::try_from(since_epoch().as_millis()).unwrap_or(u64::MAX)
}
