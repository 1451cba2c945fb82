//! One simulated process: agent, drive, clock and inbox.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    Digest, Epoch, Message, MicroUnits, ModuleId, ModuleRun, Pose, TargetAnnouncement,
};
use formation_motion::SimulatedDrive;
use formation_protocol::{Agent, AgentParameters, DurableState, Identity, Input};

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

/// A clock that runs fast or slow.
#[derive(Clone, Copy, Default)]
pub(crate) struct Clock {
    /// Its offset to the cluster's time.
    pub offset: Duration,
    /// By how many millionths it runs fast, or slow if negative.
    pub drift_ppm: i64,
    /// How long it stood still, before the last time that it does.
    pub stood_still: Duration,
    /// From when until when it last stands still.
    pub stands_still: (Duration, Duration),
}

impl Clock {
    /// The cluster's time on this clock.
    pub fn local(&self, now: Duration) -> Duration {
        let (from, until) = self.stands_still;
        let stands = now.clamp(from.min(now), until).saturating_sub(from);
        let now = now.saturating_sub(self.stood_still + stands);
        let micros = i64::try_from(now.as_micros()).unwrap_or(i64::MAX);
        let drift = micros / 1_000_000 * self.drift_ppm;
        self.offset + Duration::from_micros(micros.saturating_add(drift).max(0).unsigned_abs())
    }

    /// Whether it stands still at a time.
    pub fn stands_still_at(&self, now: Duration) -> bool {
        let (from, until) = self.stands_still;
        from <= now && now < until
    }

    /// Stands still from `from` until `until`.
    pub fn stand_still(&mut self, from: Duration, until: Duration) {
        let (last_from, last_until) = self.stands_still;
        self.stood_still += last_until - last_from;
        self.stands_still = (from, until);
    }

    /// The first time of the cluster, within a microsecond, at which this clock shows `local` or later.
    pub fn global(&self, local: Duration) -> Duration {
        let (from, until) = self.stands_still;
        // What it shows after it last stood still it shows for the first time then.
        if local > self.local(from) && until > from {
            let runs = Self {
                stood_still: self.stood_still + (until - from),
                stands_still: Default::default(),
                ..*self
            };
            return runs.global(local).max(until);
        }
        let even = local.saturating_sub(self.offset) + self.stood_still;
        // A fast clock shows `local` earlier than an even one, by less than it is ahead then.
        let ahead = self.local(even).saturating_sub(local);
        let mut at = even.saturating_sub(ahead);
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
    /// Whether the best-effort messages that came while it was stopped are lost.
    pub loses_best_effort: bool,
}

impl Inbox {
    /// Adds an input. A time-out does not wait: a process looks at its clock when it continues.
    pub fn add(&mut self, input: Input) {
        if !matches!(input, Input::Timeout) || self.waiting.is_empty() {
            self.waiting.push_back(input);
        }
    }

    /// The next inputs, none if the process is stopped or busy: one, or all messages up to the next other input if a stop has
    /// just ended.
    pub fn next(&mut self, now: Duration) -> Vec<Input> {
        if now < self.held_until {
            self.waiting
                .retain(|input| !matches!(input, Input::Timeout));
            return Vec::new();
        }
        if std::mem::take(&mut self.loses_best_effort) {
            self.waiting.retain(|input| match input {
                Input::Message { message, .. } => Topic::of(message).is_reliable(),
                _ => true,
            });
        }
        let slow = self.slow.filter(|&(until, _)| now < until);
        let is_message = |input: &&Input| matches!(input, Input::Message { .. });
        let messages = self.waiting.iter().take_while(is_message).count();
        let count = if slow.is_some() { 1 } else { messages.max(1) };
        let count = count.min(self.waiting.len());
        if let Some((_, lag)) = slow
            && count > 0
        {
            self.held_until = now + lag;
        }
        self.waiting.drain(..count).collect()
    }
}

/// What the store of a module holds.
pub(crate) struct Stored {
    pub state: DurableState,
    /// The modules whose states the run that wrote it had received, or that it knew from its store.
    pub seen: BTreeSet<ModuleId>,
}

/// A time in which the machine of a process stands still, with its clock.
#[derive(Clone, Copy)]
pub(crate) struct Suspension {
    pub from: Duration,
    pub until: Duration,
    /// Whether a heartbeat has come that shows it.
    pub is_shown: bool,
}

/// The time in which a process gets to know the clock of another.
const ACQUAINTANCE: Duration = Duration::from_secs(2);

impl Suspension {
    /// Whether a heartbeat shows it that this process sent: since then, by a clock that was known before and has stood still for
    /// less.
    pub fn is_shown_by(&self, sender: &Process, sent_at: Duration) -> bool {
        let is_known = sender.started + ACQUAINTANCE <= self.from;
        let lasted = |one: &Self| one.until - one.from;
        let stood_less = sender.suspension.is_none_or(|other| {
            other.until <= self.from || lasted(&other) + ACQUAINTANCE < lasted(self)
        });
        sent_at >= self.until && is_known && stood_less
    }
}

/// What the process of a module has for it: its drive, its clock and its inbox.
pub(crate) struct Process {
    pub run: ModuleRun,
    pub clock: Clock,
    pub inbox: Inbox,
    pub timeout_at: Option<Duration>,
    /// Goes by the poses that are measured.
    pub drive: SimulatedDrive,
    /// Whether its agent has ordered a halt, which the drive reports once it stands.
    pub is_coasting: bool,
    /// When it started.
    pub started: Duration,
    /// The last suspension of its machine.
    pub suspension: Option<Suspension>,
    /// Whether nothing that the drive reports reaches the agent.
    pub is_mute: bool,
    /// Whether the drive fell silent on its way, so that the agent never knows that it stands.
    pub is_lost: bool,
    /// How far off its body its poses are measured, along x and y.
    pub measured_off: (MicroUnits, MicroUnits),
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

impl Process {
    /// Where its body is.
    pub fn body(&self) -> Pose {
        let measured = self.drive.pose();
        let (x, y) = self.measured_off;
        shifted(&measured, (MicroUnits(-x.0), MicroUnits(-y.0)))
    }
}

/// A way along x and y.
pub type Way = (MicroUnits, MicroUnits);

/// A pose moved along x and y.
pub(crate) fn shifted(pose: &Pose, (x, y): (MicroUnits, MicroUnits)) -> Pose {
    Pose {
        x: MicroUnits(pose.x.0 + x.0),
        y: MicroUnits(pose.y.0 + y.0),
        ..*pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_at_which_a_clock_shows_a_time_is_found_for_fast_and_slow_ones() {
        for drift_ppm in [-200, 0, 200] {
            let offset = Duration::from_millis(300);
            let mut clock = Clock {
                offset,
                drift_ppm,
                ..Clock::default()
            };
            if drift_ppm != 0 {
                clock.stand_still(Duration::from_secs(7), Duration::from_secs(37));
            }
            for millis in [300, 1_300, 13_337, 600_000] {
                let shown = Duration::from_millis(millis);
                let at = clock.global(shown);
                assert!(clock.local(at) >= shown);
                let before = at.saturating_sub(Duration::from_micros(1));
                assert!(
                    at.is_zero() || clock.local(before) < shown,
                    "{drift_ppm} {millis}"
                );
            }
        }
    }
}
