//! What is to happen, in the order of its time.

use std::time::Duration;

use formation::model::{Incarnation, Message, ModuleId};
use formation::protocol::SourceId;

use crate::network::Channel;

pub(super) enum Happening {
    Start(ModuleId),
    Deliver {
        channel: Channel,
        /// The participant that wrote it: each run of a process is one of its own.
        source: Option<SourceId>,
        /// The incarnation of the reader for which it is meant; a restarted reader asks anew.
        reader: Incarnation,
        sample: u64,
        message: Message,
    },
    Timeout(ModuleId, Incarnation),
    DriveTick(ModuleId, Incarnation),
}

pub(super) struct Scheduled {
    pub(super) at: Duration,
    pub(super) order: u64,
    pub(super) happening: Happening,
}

impl PartialEq for Scheduled {
    fn eq(&self, other: &Self) -> bool {
        (self.at, self.order) == (other.at, other.order)
    }
}
impl Eq for Scheduled {}
impl PartialOrd for Scheduled {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Scheduled {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (self.at, self.order).cmp(&(other.at, other.order))
    }
}
