//! Wall-clock time: stamps, incarnations and revisions.

use formation::model::{Incarnation, STAMP_AHEAD_MAX};
use formation_msgs::{Header, Time};
use ros_runtime::stamp::since_epoch;

/// A header for data taken now.
#[must_use]
pub fn header(frame_id: &str) -> Header {
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

/// The latest stamp, in microseconds since 1970, that another process may have taken.
#[must_use]
pub fn latest() -> u64 {
    incarnation().0.saturating_add(STAMP_AHEAD_MAX)
}

/// A revision for a target that is announced now: later announcements have greater ones.
#[must_use]
pub fn revision() -> u64 {
    u64::try_from(since_epoch().as_millis()).unwrap_or(u64::MAX)
}
