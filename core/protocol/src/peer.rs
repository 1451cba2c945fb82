//! One other module: its latest messages, and when they were sent.

use std::sync::Arc;
use std::time::Duration;

use formation_model::{Epoch, Heartbeat, Incarnation, ModuleId, ModuleRun, ModuleState, SourceId};

use super::channel::Channel;
use super::clock_offset::ClockOffset;

/// A state and its sender.
pub(super) type KeptState = (Arc<ModuleState>, Option<SourceId>);

/// What is known of one other module.
#[derive(Clone, Debug, Hash)]
pub(super) struct Peer {
    pub incarnation: Incarnation,
    pub heartbeat: Option<Heartbeat>,
    pub state: Option<Arc<ModuleState>>,
    /// The latest state of another run that may yet take the place of this one: a state comes only once. A later run does so when
    /// this one is silent, and an earlier one when this one has been silent for long.
    pub kept: Option<KeptState>,
    /// How the clock of a later run differs that is not let in yet, by the heartbeats of one sender.
    kept_clock: Option<((Incarnation, Option<SourceId>), ClockOffset)>,
    /// The later run that it, or a run before it, replaced after a long silence of that: a clock was set back in between.
    pub replaces: Option<Incarnation>,
    /// The participant that sends for this module, where the transport identifies it.
    pub source: Option<SourceId>,
    /// When the participant that sends for it left the graph, unless a heartbeat of this run came that was sent later.
    pub left_at: Option<Duration>,
    /// Whether its heartbeats show that it belongs to a session with other voters.
    pub has_other_voters: bool,
    /// When its latest heartbeat was sent, by this module's clock.
    alive_at: Option<Duration>,
    /// When the first message of this incarnation came.
    first_seen: Duration,
    /// How its clock differs from this one's.
    clock: Option<ClockOffset>,
    /// Whether this module counts on receiving it.
    pub channel: Channel,
}

impl Peer {
    pub fn new(incarnation: Incarnation, source: Option<SourceId>, now: Duration) -> Self {
        Self {
            incarnation,
            heartbeat: None,
            state: None,
            kept: None,
            kept_clock: None,
            replaces: None,
            source,
            left_at: None,
            has_other_voters: false,
            alive_at: None,
            first_seen: now,
            clock: None,
            channel: Channel::default(),
        }
    }

    /// Whether its latest heartbeat says that it has forgotten nothing.
    pub fn knows(&self) -> bool {
        let heartbeat = self.heartbeat.as_ref();
        heartbeat.is_some_and(|heartbeat| heartbeat.knows)
    }

    /// Whether its latest heartbeat lists all that it misses: it has listened, and knows who votes.
    pub fn tells_misses(&self, suspicion: Duration) -> bool {
        let heartbeat = self.heartbeat.as_ref();
        heartbeat.is_some_and(|heartbeat| heartbeat.uptime > suspicion) && self.knows_voters()
    }

    /// Whether its latest heartbeat says that it knows who votes.
    pub fn knows_voters(&self) -> bool {
        let heartbeat = self.heartbeat.as_ref();
        heartbeat.is_some_and(|heartbeat| heartbeat.voters != 0)
    }

    /// Whether it has taken the place of this run.
    pub fn has_replaced(&self, run: Incarnation) -> bool {
        self.incarnation > run || (self.incarnation < run && self.replaces >= Some(run))
    }

    /// Whether its latest heartbeat shows a later epoch than this.
    pub fn is_ahead_of(&self, epoch: Epoch) -> bool {
        let heartbeat = self.heartbeat.as_ref();
        heartbeat.is_some_and(|heartbeat| heartbeat.epoch > Some(epoch))
    }

    /// The age of the latest heartbeat; `None` without one, or if its participant has left since.
    pub fn age(&self, now: Duration) -> Option<Duration> {
        let alive_at = self.alive_at.filter(|_| self.left_at.is_none());
        alive_at.map(|at| now.saturating_sub(at))
    }

    /// When it last gave a sign of life.
    pub fn last_seen(&self) -> Duration {
        self.alive_at.unwrap_or(self.first_seen)
    }

    /// Estimates when a heartbeat was sent, by this module's clock; it is sent every `period`.
    /// Enforces M1.
    pub fn sent_at(&mut self, now: Duration, uptime: Duration, period: Duration) -> Duration {
        let clock = ClockOffset::with(self.clock, now, uptime, period);
        self.clock = Some(clock);
        clock.sent_at(uptime)
    }

    /// Compares the clock of a later run while that is not let in: this process may be suspended before it is.
    pub fn compare_later(
        &mut self,
        run: (Incarnation, Option<SourceId>),
        now: Duration,
        uptime: Duration,
        period: Duration,
    ) {
        let known = self.kept_clock.filter(|&(kept, _)| kept == run);
        let known = known.map(|(_, clock)| clock);
        self.kept_clock = Some((run, ClockOffset::with(known, now, uptime, period)));
    }

    /// Lets the run in that takes the place of a former one.
    pub fn follow(&mut self, former: &Self) {
        let run = (self.incarnation, self.source);
        let kept = former.kept_clock.filter(|&(kept, _)| kept == run);
        self.clock = kept.map(|(_, clock)| clock);
    }

    /// How its clock differs from this one's, and that of a later run which is not let in yet, as far as they were heard.
    pub fn clocks(&self) -> impl Iterator<Item = &ClockOffset> {
        let later = self.kept_clock.iter().map(|(_, clock)| clock);
        self.clock.iter().chain(later)
    }

    /// Records a heartbeat that was sent at a time.
    pub fn note_heartbeat(&mut self, heartbeat: Heartbeat, sent_at: Duration) {
        self.alive_at = Some(self.alive_at.map_or(sent_at, |at| at.max(sent_at)));
        self.heartbeat = Some(heartbeat);
        self.left_at = self.left_at.filter(|&left_at| sent_at <= left_at);
    }

    /// The modules that its latest heartbeat lists as not received.
    pub fn misses(&self) -> &[ModuleId] {
        let heartbeat = self.heartbeat.as_ref();
        heartbeat.map_or(&[], |heartbeat| &heartbeat.misses)
    }
}

/// The kept state, if this run sent it.
pub(super) fn state_of(
    kept: Option<KeptState>,
    run: ModuleRun,
    source: Option<SourceId>,
) -> Option<Arc<ModuleState>> {
    kept.filter(|(state, sender)| state.incarnation == run.incarnation && *sender == source)
        .map(|(state, _)| state)
}

/// The proofs in a state are for observers; to keep them would let any sender fill this module's memory.
pub(super) fn without_proofs(state: Arc<ModuleState>) -> Arc<ModuleState> {
    if state.waited_for.is_empty() && state.agreed_on.is_empty() {
        return state;
    }
    let mut state = ModuleState::clone(&state);
    state.waited_for = Vec::new();
    state.agreed_on = Vec::new();
    Arc::new(state)
}
