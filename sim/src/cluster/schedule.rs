//! What happens next, in the order of time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;
use std::time::Duration;

use formation::model::{Incarnation, Message, ModuleId, ModuleRun};
use formation::protocol::{ComputedPlan, SourceId};

use crate::network::Channel;

pub(super) enum Happening {
    Start(ModuleId),
    Deliver(Delivery),
    Timeout(ModuleId, Incarnation),
    DriveTick(ModuleId, Incarnation),
    /// The store of a module holds its state of this number.
    Persisted(ModuleId, Incarnation, u64),
    Computed(ModuleId, Incarnation, Arc<ComputedPlan>),
}

/// A message on its way to one reader.
pub(super) struct Delivery {
    pub(super) channel: Channel,
    /// The participant that wrote it: each run of a process is one of its own.
    pub(super) source: Option<SourceId>,
    /// The run of the reader that it is meant for; a restarted reader has new channels.
    pub(super) reader: ModuleRun,
    pub(super) sample: u64,
    pub(super) message: Message,
}

/// The virtual time, and what happens at later times.
#[derive(Default)]
pub(super) struct Schedule {
    pub(super) now: Duration,
    order: u64,
    queue: BinaryHeap<Reverse<Scheduled>>,
}

impl Schedule {
    pub(super) fn add(&mut self, at: Duration, happening: Happening) {
        self.order += 1;
        self.queue.push(Reverse(Scheduled {
            at,
            order: self.order,
            happening: Box::new(happening),
        }));
    }

    /// Advances to the next happening, or to `limit` if none is left before it.
    pub(super) fn next(&mut self, limit: Duration) -> Option<Happening> {
        let next = self.queue.peek().filter(|Reverse(next)| next.at <= limit);
        if next.is_none() {
            self.now = self.now.max(limit);
            return None;
        }
        let Reverse(next) = self.queue.pop()?;
        self.now = next.at;
        Some(*next.happening)
    }
}

struct Scheduled {
    at: Duration,
    order: u64,
    /// Boxed, as the queue moves its elements, and a message is large.
    happening: Box<Happening>,
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
