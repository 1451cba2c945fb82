//! One simulated process and its clock.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use formation::model::{Digest, Epoch, Incarnation, Message};
use formation::motion::SimulatedDrive;
use formation::protocol::{Agent, AgentParameters, Identity, Input};

use crate::network::Topic;

/// How agents are made; tests give some of them a bug.
#[derive(Clone)]
pub struct AgentFactory(Arc<dyn Fn(Identity, AgentParameters, Duration) -> Agent + Send + Sync>);

impl AgentFactory {
    /// Makes agents by calling this with who they are, their time limits, and the time on their clock.
    pub fn new(
        make: impl Fn(Identity, AgentParameters, Duration) -> Agent + Send + Sync + 'static,
    ) -> Self {
        Self(Arc::new(make))
    }

    /// Makes one.
    #[must_use]
    pub fn make(&self, identity: Identity, parameters: AgentParameters, now: Duration) -> Agent {
        (self.0)(identity, parameters, now)
    }
}

impl Default for AgentFactory {
    /// Agents as they are.
    fn default() -> Self {
        Self::new(Agent::new)
    }
}

impl fmt::Debug for AgentFactory {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("AgentFactory")
    }
}

/// One module's process: its agent, its drive, and its own clock.
pub(crate) struct Process {
    pub agent: Agent,
    pub incarnation: Incarnation,
    pub drive: SimulatedDrive,
    /// The plan on which the drive was sent off last.
    pub driven_by: Option<(Epoch, Digest)>,
    /// Its clock's offset to the cluster's.
    pub clock_offset: Duration,
    /// By how many millionths its clock runs fast or slow.
    pub clock_drift_ppm: i64,
    pub timeout_at: Option<Duration>,
    pub ticking: bool,
    /// Until when its process stands still or is busy; inputs wait.
    pub held_until: Duration,
    /// Until when each input keeps it busy, and for how long.
    pub slow: Option<(Duration, Duration)>,
    pub waiting: VecDeque<Input>,
    /// Whether the drive fails whenever it is to go.
    pub drive_broken: bool,
    /// Whether the publisher's last word to it was a target.
    pub knows_target: bool,
    /// The revision of the publisher's last word to it.
    pub target_revision: u64,
    pub history: BTreeMap<Topic, Vec<(u64, Message)>>,
}

impl Process {
    /// The cluster's time on this process's clock.
    pub fn local(&self, now: Duration) -> Duration {
        let micros = i64::try_from(now.as_micros()).unwrap_or(i64::MAX);
        let drift = micros / 1_000_000 * self.clock_drift_ppm;
        self.clock_offset
            + Duration::from_micros(micros.saturating_add(drift).max(0).unsigned_abs())
    }

    /// The first time of the cluster, within a microsecond, at which this process's clock shows `local` or later.
    pub fn global(&self, local: Duration) -> Duration {
        let mut at = local.saturating_sub(self.clock_offset);
        loop {
            let shown = self.local(at);
            if shown >= local {
                return at;
            }
            at += (local - shown).max(Duration::from_micros(1));
        }
    }
}
