//! The outputs of an agent, the numbers of its heartbeats and states, and the time of its next time-out.

use std::collections::VecDeque;
use std::hash::{Hash, Hasher};
use std::time::Duration;

use formation_model::{
    Digest, Epoch, Heartbeat, Incarnation, Message, ModuleId, ModulePhase, Stop,
};

use super::durable::{DurableState, StoredBodies, SyncKey};
use super::event::Event;
use super::io::Output;
use super::refusal::{Refusal, RefusalCounts};

/// What a heartbeat shows of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct HeartbeatContent {
    pub incarnation: Incarnation,
    pub epoch: Option<Epoch>,
    pub digest: Option<Digest>,
    pub phase: ModulePhase,
    pub stop: Stop,
}

impl HeartbeatContent {
    fn of(heartbeat: &Heartbeat) -> Self {
        Self {
            incarnation: heartbeat.incarnation,
            epoch: heartbeat.epoch,
            digest: heartbeat.digest,
            phase: heartbeat.phase,
            stop: heartbeat.stop,
        }
    }

    /// Whether others should know this at once. That a module computes or has computed its plan matters only to those who wait
    /// for longer than a heartbeat takes.
    pub fn is_urgent_after(self, known: Self) -> bool {
        let phase = match self.phase {
            ModulePhase::Computing | ModulePhase::Planning => known.phase,
            phase => phase,
        };
        Self { phase, ..self } != known
    }
}

/// The heartbeats that were published.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct HeartbeatLog {
    pub sequence: u64,
    pub due: Duration,
    pub shown: Option<HeartbeatContent>,
    /// The digest that is shown, and the first heartbeat that showed it.
    digest_since: Option<(Digest, u64)>,
}

impl HeartbeatLog {
    /// Whether a plan of this epoch is shown.
    pub fn show_plan_of(&self, epoch: Epoch) -> bool {
        let shows = |shown: HeartbeatContent| shown.epoch == Some(epoch) && shown.digest.is_some();
        self.shown.is_some_and(shows)
    }

    /// Whether a plan is shown.
    pub fn show_plan(&self) -> bool {
        self.shown.is_some_and(|shown| shown.digest.is_some())
    }

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

/// What was given to the store, and what waits for it.
#[derive(Clone, Debug, Default)]
pub(super) struct WriteAheadLog {
    /// What the outputs so far depend on, as it was last given to the store.
    pub given: Option<SyncKey>,
    /// The bodies in the state that was given last.
    pub bodies: Option<StoredBodies>,
    /// The number of states that were given to the store, and of those that it holds.
    given_count: u64,
    held_count: u64,
    /// Outputs that wait until the store holds that many states.
    waiting: VecDeque<(u64, Output)>,
    /// The number of outputs before the present input, and the heartbeats before it.
    before: (usize, HeartbeatLog),
}

/// Outputs on their way to the host, and what the next ones depend on.
#[derive(Clone, Debug, Default)]
pub(super) struct Outbox {
    outputs: VecDeque<Output>,
    pub has_store: bool,
    pub durable: WriteAheadLog,
    pub refusals: RefusalCounts,
    wake: Option<Duration>,
    pub heartbeats: HeartbeatLog,
    pub states: StateLog,
}

impl Outbox {
    pub fn new(now: Duration, has_store: bool) -> Self {
        let mut outbox = Self {
            has_store,
            ..Self::default()
        };
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
        let is_goal = |output: &Output| matches!(output, Output::Move(_));
        self.outputs.retain(|output| !is_goal(output));
        self.durable.waiting.retain(|(_, output)| !is_goal(output));
    }

    /// Removes the requests to dock that the host has not taken yet; returns to which modules.
    pub fn withdraw_docking(&mut self) -> Vec<ModuleId> {
        let waiting = self.durable.waiting.iter().map(|(_, output)| output);
        let docked_to = |output: &Output| match output {
            Output::Dock(module) => Some(*module),
            _ => None,
        };
        let withdrawn = self.outputs.iter().chain(waiting);
        let withdrawn = withdrawn.filter_map(docked_to).collect();
        self.outputs.retain(|output| docked_to(output).is_none());
        let held = &mut self.durable.waiting;
        held.retain(|(_, output)| docked_to(output).is_none());
        withdrawn
    }

    /// An input begins: the outputs from here on are its results.
    pub fn begin_input(&mut self) {
        self.durable.before = (self.outputs.len(), self.heartbeats.clone());
    }

    /// Whether outputs wait for the store.
    pub fn is_writing(&self) -> bool {
        self.durable.held_count < self.durable.given_count
    }

    /// Whether the plan for this epoch may be shown: the store, if there is one, holds what it depends on.
    pub fn may_show_plan_of(&self, epoch: Epoch) -> bool {
        let given = self.durable.given.as_ref();
        let holds = |given: &SyncKey| given.shows_plan_of(epoch) && !self.is_writing();
        !self.has_store || given.is_some_and(holds)
    }

    /// Gives a state to the store if there is a new one, and lets the results of the present input wait for the store. A halt,
    /// an event and a heartbeat that shows nothing new, or nothing but a command to stop or to resume, depend on nothing.
    /// Enforces Q8.
    pub fn write_ahead(&mut self, key: SyncKey, state: Option<DurableState>) {
        if state.is_some() {
            self.durable.given = Some(key);
            self.durable.given_count += 1;
        }
        if !self.is_writing() {
            return;
        }
        let (begin, heartbeats) = std::mem::take(&mut self.durable.before);
        let known = heartbeats.shown;
        for output in self.outputs.split_off(begin.min(self.outputs.len())) {
            match &output {
                Output::Halt | Output::Event(_) | Output::BeginRun { .. } => {
                    self.outputs.push_back(output);
                }
                Output::Publish(Message::Heartbeat(heartbeat)) => {
                    let stop = heartbeat.stop;
                    if Some(HeartbeatContent::of(heartbeat))
                        == known.map(|known| HeartbeatContent { stop, ..known })
                    {
                        self.outputs.push_back(output);
                    } else {
                        // It is not sent: another is made when the store holds the state, or when it is due.
                        self.heartbeats = HeartbeatLog {
                            due: self.heartbeats.due,
                            ..heartbeats.clone()
                        };
                    }
                }
                _ => {
                    let needed = self.durable.given_count;
                    self.durable.waiting.push_back((needed, output));
                }
            }
        }
        if let Some(state) = state {
            let number = self.durable.given_count;
            let state = Box::new(state);
            self.outputs.push_back(Output::Persist { number, state });
        }
    }

    /// The store holds the first `number` states.
    pub fn note_persisted(&mut self, number: u64) {
        let durable = &mut self.durable;
        durable.held_count = durable.held_count.max(number.min(durable.given_count));
        while let Some((needed, _)) = durable.waiting.front()
            && *needed <= durable.held_count
        {
            self.outputs
                .extend(durable.waiting.pop_front().map(|(_, output)| output));
        }
    }

    /// Counts a refusal, and reports it unless it is the ordinary lateness of a network.
    /// Enforces C2.
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
            has_store: _,
            durable,
            wake,
            heartbeats,
            states,
        } = self;
        (wake, heartbeats, states).hash(state);
        let unheld = durable.given_count - durable.held_count;
        (&durable.given, unheld, durable.waiting.len()).hash(state);
    }
}
