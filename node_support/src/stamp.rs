//! Wall-clock time: stamps, incarnations and revisions.

use std::time::Duration;

use formation_model::{Incarnation, STAMP_AHEAD_MAX};
use formation_msgs::{Header, Time};
use ros_runtime::stamp::{since_boot, since_epoch};

/// How often both clocks are looked at.
const LOOKS: u32 = 5;

/// A header for data taken now.
#[must_use]
pub fn header(frame_id: &str) -> Header {
    Header {
        stamp: since_epoch().into(),
        frame_id: frame_id.to_owned(),
    }
}

/// How long ago this process took a stamp, which another returns. `None` for one that was never set, or is ahead of the clock,
/// which was set back since then.
#[must_use]
pub fn age(stamp: Time) -> Option<Duration> {
    let Time { sec, nanosec } = stamp;
    let sec = u64::try_from(sec).ok().filter(|sec| *sec > 0)?;
    since_epoch().checked_sub(Duration::new(sec, nanosec))
}

/// A header for data that was taken this long ago.
#[must_use]
pub fn header_of_past(frame_id: &str, age: Duration) -> Header {
    Header {
        stamp: since_epoch().saturating_sub(age).into(),
        frame_id: frame_id.to_owned(),
    }
}

/// The time since 1970 at which the machine had run for `since_start`. Of several looks at both clocks, the one that took
/// the least time counts: a process may be suspended between two calls.
#[must_use]
pub fn since_1970(since_start: Duration) -> Duration {
    let look = |_| {
        let (before, now, after) = (since_boot(), since_epoch(), since_boot());
        (after.saturating_sub(before), now.saturating_sub(before))
    };
    let looks = (0..LOOKS).map(look);
    let boot = looks.min().map_or_else(since_epoch, |(_, boot)| boot);
    boot + since_start
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_is_as_old_as_its_stamp_says() {
        let now = header("map").stamp;
        assert!(age(now).unwrap() < Duration::from_secs(1));
        let past = header_of_past("map", Duration::from_secs(10)).stamp;
        assert!(age(past).unwrap() >= Duration::from_secs(10));
        let ahead = Time {
            sec: now.sec + 10,
            ..now
        };
        assert_eq!((age(ahead), age(Time::default())), (None, None));
    }
}
