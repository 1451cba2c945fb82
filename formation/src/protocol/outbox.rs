//! The outputs of an agent, the numbers of its heartbeats and states, and the time of its next time-out.

use std::collections::VecDeque;
use std::hash::{Hash, Hasher};
use std::time::Duration;

use crate::model::{Digest, Epoch, ModuleId, ModulePhase};

use super::event::Event;
use super::io::Output;
use super::refusal::{Refusal, RefusalCounts};

/// What a heartbeat shows of the protocol. A change is published at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Shown {
    pub epoch: Option<Epoch>,
    pub digest: Option<Digest>,
    pub phase: ModulePhase,
}

/// The heartbeats that were published.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct HeartbeatLog {
    pub sequence: u64,
    pub due: Duration,
    pub shown: Option<Shown>,
    /// The digest that is shown, and the first heartbeat that showed it.
    digest_since: Option<(Digest, u64)>,
}

impl HeartbeatLog {
    /// The sequence number of the first heartbeat that showed the digest of the latest; 0 without a digest.
    pub fn digest_since(&mut self, digest: Option<Digest>) -> u64 {
        let since = match (digest, self.digest_since) {
            (None, _) => 0,
            (Some(digest), Some((shown, since))) if shown == digest => since,
            (Some(_), _) => self.sequence,
        };
        self.digest_since = digest.map(|digest| (digest, since));
        since
    }
}

/// The states that were published.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct StateLog {
    pub sequence: u64,
    /// Whether the state differs from the last published one.
    pub changed: bool,
    /// When the pose was last published.
    pub pose_at: Duration,
}

/// Outputs on their way to the host, and what the next ones depend on.
#[derive(Clone, Debug, Default)]
pub(super) struct Outbox {
    outputs: VecDeque<Output>,
    pub refusals: RefusalCounts,
    wake: Option<Duration>,
    pub heartbeats: HeartbeatLog,
    pub states: StateLog,
}

impl Outbox {
    pub fn new(now: Duration) -> Self {
        let mut outbox = Self::default();
        outbox.heartbeats.due = now;
        outbox.states.changed = true;
        outbox
    }

    pub fn push(&mut self, output: Output) {
        self.outputs.push_back(output);
    }

    pub fn pop(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// Removes goals that the host has not taken yet: a goal must not outlive the plan that it came from.
    pub fn withdraw_goals(&mut self) {
        self.outputs
            .retain(|output| !matches!(output, Output::Move(_)));
    }

    /// Counts a refusal, and reports it unless it is the ordinary lateness of a network.
    pub fn refuse(&mut self, module: Option<ModuleId>, reason: Refusal) {
        self.refusals.add(reason);
        if !reason.is_ordinary() {
            self.push(Output::Event(Event::Refused { module, reason }));
        }
    }

    /// Asks to be woken at `at` at the latest.
    pub fn wake_at(&mut self, at: Duration) {
        self.wake = Some(self.wake.map_or(at, |wake| wake.min(at)));
    }

    /// Withdraws all requests to be woken, which the coming step makes again as needed.
    pub fn forget_wakes(&mut self) {
        self.wake = None;
    }

    /// When the next time-out is due.
    pub fn timeout(&self) -> Duration {
        let due = self.heartbeats.due;
        self.wake.map_or(due, |wake| wake.min(due))
    }
}

impl Hash for Outbox {
    /// Outputs are taken before states are compared, and counts change no behaviour.
    fn hash<H: Hasher>(&self, state: &mut H) {
        let Self {
            outputs: _,
            refusals: _,
            wake,
            heartbeats,
            states,
        } = self;
        (wake, heartbeats, states).hash(state);
    }
}
