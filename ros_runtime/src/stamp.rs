//! Wall-clock time, for stamps, and the time of a clock that continues while the machine is suspended.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use ros2_client::builtin_interfaces::Time;
use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};

/// When and in which frame, as `std_msgs/msg/Header` has it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// When the data was taken.
    pub stamp: Time,
    /// The frame of its poses; empty where it has none.
    pub frame_id: String,
}

/// The time since 1970; a clock before that counts as never set.
#[must_use]
pub fn since_epoch() -> Duration {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
}

/// The nanoseconds since 1970.
#[must_use]
pub fn nanoseconds_since_epoch() -> u64 {
    u64::try_from(since_epoch().as_nanos()).unwrap_or(u64::MAX)
}

/// The time since the machine started, with the time in which it was suspended. [`std::time::Instant`] does not count that:
/// what a process received before would seem to be recent when it continues.
#[must_use]
pub fn since_boot() -> Duration {
    let now = clock_gettime(ClockId::Boottime);
    // Neither is negative.
    Duration::new(
        now.tv_sec.try_into().unwrap_or_default(),
        now.tv_nsec.try_into().unwrap_or_default(),
    )
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn the_clock_counts_what_the_kernel_counts_as_uptime() {
        let uptime = fs::read_to_string("/proc/uptime").unwrap();
        let uptime = uptime.split_whitespace().next().unwrap();
        let uptime = Duration::from_secs_f64(uptime.parse().unwrap());
        let difference = since_boot().abs_diff(uptime);
        assert!(difference < Duration::from_secs(5), "{difference:?}");
    }
}
