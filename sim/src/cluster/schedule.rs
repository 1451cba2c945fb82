//! What happens next, in the order of time.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{Message, ModuleId, ModuleRun, SourceId};
use formation_protocol::ComputedPlan;

use crate::network::Channel;

pub(super) enum Happening {
    Start(ModuleId),
    Deliver(Delivery),
    Timeout(ModuleRun),
    DriveTick(ModuleRun),
    /// The store of a module holds its state of this number.
    Persisted(ModuleRun, u64),
    Computed(ModuleRun, Arc<ComputedPlan>),
    /// A run of a process learns that this participant has left.
    Departed(ModuleRun, SourceId),
    /// The ports of a module have let go of another.
    Undocked(ModuleRun, ModuleId),
}

/// A message on its way to one reader.
pub(super) struct Delivery {
    pub(super) channel: Channel,
    /// The participant that wrote it: each run of a process is one of its own.
    pub(super) source: Option<SourceId>,
    /// The run of the reader that it is meant for; a restarted reader has new channels.
    pub(super) reader: ModuleRun,
    pub(super) sample: u64,
    pub(super) sent_at: Duration,
    pub(super) message: Message,
}

/// The virtual time, and what happens at later times.
#[derive(Default)]
pub(super) struct Schedule {
    pub(super) now: Duration,
    order: u64,
    /// By time, and in the order in which they were added. Boxed, as the queue moves its elements, and a message is large.
    queue: BTreeMap<(Duration, u64), Box<Happening>>,
}

impl Schedule {
    pub(super) fn add(&mut self, at: Duration, happening: Happening) {
        self.order += 1;
        self.queue.insert((at, self.order), Box::new(happening));
    }

    /// Advances to the next happening, or to `limit` if none is left before it.
    pub(super) fn next(&mut self, limit: Duration) -> Option<Happening> {
        let next = self.queue.first_entry();
        let Some(next) = next.filter(|next| next.key().0 <= limit) else {
            self.now = self.now.max(limit);
            return None;
        };
        let ((at, _), happening) = next.remove_entry();
        self.now = at;
        Some(*happening)
    }
}
