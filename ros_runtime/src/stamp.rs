//! Wall-clock time, for stamps.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use ros2_client::builtin_interfaces::Time;
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

impl Header {
    /// A header for data taken now that has no frame.
    #[must_use]
    pub fn now() -> Self {
        Self {
            stamp: Time::now(),
            frame_id: String::new(),
        }
    }
}
