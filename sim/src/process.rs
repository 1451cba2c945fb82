//! One simulated process: agent, drive, clock and inbox.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use formation::model::{Digest, Epoch, Incarnation, Message, ModuleId, TargetAnnouncement};
use formation::motion::SimulatedDrive;
use formation::protocol::{Agent, AgentParameters, DurableState, Identity, Input};

use crate::network::Topic;

/// Makes agents; tests give some of them a bug.
#[derive(Clone)]
pub struct AgentFactory(Arc<dyn Fn(Identity, AgentParameters, Duration) -> Agent + Send + Sync>);

impl AgentFactory {
    /// Makes agents by calling `make` with their identity, their time limits, and the time on their clock.
    pub fn new(
        make: impl Fn(Identity, AgentParameters, Duration) -> Agent + Send + Sync + 'static,
    ) -> Self {
        Self(Arc::new(make))
    }

    /// Makes an agent.
    #[must_use]
    pub fn make(&self, identity: Identity, parameters: AgentParameters, now: Duration) -> Agent {
        (self.0)(identity, parameters, now)
    }
}

impl Default for AgentFactory {
    /// Agents without a bug.
    fn default() -> Self {
        Self::new(Agent::new)
    }
}

impl fmt::Debug for AgentFactory {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("AgentFactory")
    }
}

/// A clock that runs fast or slow.
#[derive(Clone, Copy)]
pub(crate) struct Clock {
    /// Its offset to the cluster's time.
    pub offset: Duration,
    /// By how many millionths it runs fast, or slow if negative.
    pub drift_ppm: i64,
}

impl Clock {
    /// The cluster's time on this clock.
    pub fn local(&self, now: Duration) -> Duration {
        let micros = i64::try_from(now.as_micros()).unwrap_or(i64::MAX);
        let drift = micros / 1_000_000 * self.drift_ppm;
        self.offset + Duration::from_micros(micros.saturating_add(drift).max(0).unsigned_abs())
    }

    /// The first time of the cluster, within a microsecond, at which this clock shows `local` or later.
    pub fn global(&self, local: Duration) -> Duration {
        let mut at = local.saturating_sub(self.offset);
        loop {
            let shown = self.local(at);
            if shown >= local {
                return at;
            }
            at += (local - shown).max(Duration::from_micros(1));
        }
    }
}

/// The inputs that wait for a process that is stopped or busy.
#[derive(Default)]
pub(crate) struct Inbox {
    pub waiting: VecDeque<Input>,
    /// Until when the process is stopped or busy.
    pub held_until: Duration,
    /// Until when each input keeps the process busy, and the time that each takes.
    pub slow: Option<(Duration, Duration)>,
}

impl Inbox {
    /// Adds an input. A time-out does not wait: a process looks at its clock when it continues.
    pub fn add(&mut self, input: Input) {
        if !matches!(input, Input::Timeout) || self.waiting.is_empty() {
            self.waiting.push_back(input);
        }
    }

    /// The next input, unless the process is stopped or busy.
    pub fn next(&mut self, now: Duration) -> Option<Input> {
        if now < self.held_until {
            self.waiting
                .retain(|input| !matches!(input, Input::Timeout));
            return None;
        }
        let input = self.waiting.pop_front()?;
        match self.slow {
            Some((until, lag)) if now < until => self.held_until = now + lag,
            _ => self.slow = None,
        }
        Some(input)
    }
}

/// What the store of a module holds.
pub(crate) struct Stored {
    pub state: DurableState,
    /// The modules of which the run that wrote it had received a state, or knew from its store.
    pub seen: BTreeSet<ModuleId>,
}

/// One module's process: its agent, its drive, and its clock.
pub(crate) struct Process {
    pub agent: Agent,
    pub incarnation: Incarnation,
    pub clock: Clock,
    pub inbox: Inbox,
    pub timeout_at: Option<Duration>,
    pub drive: SimulatedDrive,
    /// Whether the drive fails whenever it receives a goal.
    pub drive_broken: bool,
    /// When the next report of the drive is scheduled.
    pub tick_at: Option<Duration>,
    /// The plan of the drive's last goal.
    pub driven_by: Option<(Epoch, Digest)>,
    /// The last announcement of a target that it received.
    pub announcement: Option<Arc<TargetAnnouncement>>,
    /// What was given to its store and is not held by it yet.
    pub writing: VecDeque<(u64, Stored)>,
    /// The samples that its writers keep for late readers.
    pub history: BTreeMap<Topic, Vec<(u64, Message)>>,
}
