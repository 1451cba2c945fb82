//! The protocol: one module's side of agreeing on a plan and carrying it out.
//!
//! An [`Agent`] is a state machine without I/O. Its host, be it a DDS process or a simulator, keeps to this order:
//!
//! 1. [`Agent::handle`] with one input and the time since some fixed start,
//! 2. [`Agent::poll_output`] until it is empty, doing what each output says,
//! 3. [`Agent::poll_timeout`], and [`Input::Timeout`] at that time unless another input comes first.
//!
//! Everything happens in **epochs**. The *convener* opens one (`convening`), the members halt and announce themselves,
//! and a roster fixes the whole input of the plan. The units take turns (`turns`); each agent recomputes every claim. When
//! all members show the same digest, and a lease has passed, the units move one after another (`acting`). Any doubt is
//! settled by a new epoch, which must hold a majority of the last (`quorum`).
//!
//! After each input the agent looks at its whole state afresh and does what is due; no step relies on having seen an
//! earlier one, so messages may come late, twice or in any order across writers.

mod acting;
mod briefing;
mod convening;
#[cfg(feature = "mutations")]
mod fingerprint;
mod io;
mod mutation;
mod parameters;
mod peers;
mod pins;
mod quorum;
mod refusal;
mod service;
mod turns;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

pub use io::{
    Command, EpochReason, Event, Identity, Input, MotionGoal, MotionReport, Output, Severity,
    SourceId,
};
#[cfg(feature = "mutations")]
pub use mutation::Mutation;
pub use parameters::{AgentParameters, ParametersError};
pub use quorum::QUORUM_BASES_MAX;
pub use refusal::{Refusal, RefusalCounts};

use crate::model::{
    Digest, Epoch, Heartbeat, Incarnation, Message, ModuleId, ModulePhase, ModuleState, Pose,
    Service, SpotId, TargetAnnouncement, digest,
};

use acting::Acting;
use convening::{Convening, Gathering};
#[cfg(not(feature = "mutations"))]
use mutation::Mutation;
use mutation::Switch;
use peers::{Hearing, Peers};
use quorum::Quorum;
use turns::{EarlyClaims, Turns};

/// So many revisions of the target are remembered, for conveners that have yet to hear of the latest.
const TARGETS_KEPT: usize = 16;

/// How far the epoch has come.
#[derive(Clone)]
enum Stage {
    /// No epoch includes this module.
    Idle,
    /// Halted and frozen; a roster is awaited, or collected if this module convenes.
    Gathering(Gathering),
    /// Taking turns.
    Planning(Box<Turns>),
    /// Agreeing, moving, settled or spare.
    Acting(Box<Acting>),
    /// The latest roster does not list this module.
    Outsider(Arc<crate::model::Roster>),
}

/// The spot on which a module has settled, and for which target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct SettledOn {
    spot: SpotId,
    target: Digest,
}

/// What the module itself is and has.
#[derive(Clone, Debug)]
struct Body {
    pose: Pose,
    links: BTreeSet<ModuleId>,
    settled_on: Option<SettledOn>,
    /// Whether a drive has been sent off and has not reported a halt or its arrival.
    moving: bool,
    /// The modules to which it was asked to dock, or from which to undock, and that it was not told of since.
    ports_busy: BTreeSet<ModuleId>,
}

impl Body {
    /// Whether its pose and links are as they will be until it is told to do something.
    fn is_at_rest(&self) -> bool {
        !self.moving && self.ports_busy.is_empty()
    }
}

/// When what was published last, and what is due.
#[derive(Clone, Debug, Default)]
struct Voice {
    heartbeat_sequence: u64,
    heartbeat_due: Duration,
    /// What the latest heartbeat showed of the epoch, so that a change is told at once.
    heartbeat_showed: Option<(Option<Epoch>, Option<Digest>, ModulePhase)>,
    digest_shown: Option<(Digest, u64)>,
    state_sequence: u64,
    state_changed: bool,
    pose_told: Duration,
}

/// One module's side of the protocol.
#[derive(Clone)]
pub struct Agent {
    module: ModuleId,
    incarnation: Incarnation,
    identity: Identity,
    parameters: AgentParameters,
    now: Duration,
    started: Duration,
    outputs: VecDeque<Output>,
    /// Whether the present input may change what is due; a heartbeat that only says "still here" does not.
    news: bool,
    wake: Option<Duration>,
    body: Body,
    service: Service,
    switch: Switch,
    peers: Peers,
    announcement: Option<Arc<TargetAnnouncement>>,
    /// What the latest revisions of the target were.
    targets: BTreeMap<u64, Digest>,
    epoch: Option<Epoch>,
    stage: Stage,
    quorum: Quorum,
    convening: Convening,
    early_claims: EarlyClaims,
    refusals: RefusalCounts,
    voice: Voice,
    /// Until when it stands back because another process runs under its identifier.
    standing_back_until: Option<Duration>,
    /// The later run of this module by which the others have replaced this one.
    succeeded_by: Option<Incarnation>,
    duplicate_told: Option<Incarnation>,
}

impl Agent {
    /// An agent for one module, started at `now`.
    #[must_use]
    pub fn new(identity: Identity, parameters: AgentParameters, now: Duration) -> Self {
        Self {
            module: identity.module,
            incarnation: identity.incarnation,
            body: Body {
                pose: identity.pose,
                links: identity.links.clone(),
                settled_on: None,
                moving: false,
                ports_busy: BTreeSet::new(),
            },
            identity,
            service: Service::Active,
            switch: Switch::default(),
            parameters,
            now,
            started: now,
            outputs: VecDeque::new(),
            news: true,
            wake: None,
            peers: Peers::default(),
            announcement: None,
            targets: BTreeMap::new(),
            epoch: None,
            stage: Stage::Idle,
            quorum: Quorum::default(),
            convening: Convening::new(now + parameters.suspicion, parameters.epoch_interval),
            early_claims: EarlyClaims::default(),
            refusals: RefusalCounts::default(),
            voice: Voice {
                heartbeat_due: now,
                state_changed: true,
                ..Voice::default()
            },
            standing_back_until: None,
            succeeded_by: None,
            duplicate_told: None,
        }
    }

    /// The same agent with a bug, for tests of those who should notice.
    #[cfg(feature = "mutations")]
    #[must_use]
    pub fn mutated(mut self, mutation: Mutation) -> Self {
        self.switch.chosen = Some(mutation);
        self.peers.switch = self.switch;
        self
    }

    /// Takes one input at the time `now`, which must not run backwards.
    pub fn handle(&mut self, now: Duration, input: Input) {
        self.now = self.now.max(now);
        self.news = true;
        match input {
            Input::Message { source, message } => self.hear(source, message),
            Input::Motion(report) => self.hear_motion(report),
            Input::Command(command) => self.obey(command),
            Input::Timeout => {}
        }
        if self.news {
            self.step();
        }
    }

    /// The next thing to do; `None` when the agent waits.
    pub fn poll_output(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// When [`Input::Timeout`] is due, on the clock of [`Self::handle`].
    #[must_use]
    pub fn poll_timeout(&self) -> Duration {
        let due = self.voice.heartbeat_due;
        self.wake.map_or(due, |wake| wake.min(due))
    }

    /// The module.
    #[must_use]
    pub fn module(&self) -> ModuleId {
        self.module
    }

    /// What the module is doing.
    #[must_use]
    pub fn phase(&self) -> ModulePhase {
        if self.convening.lacks_quorum() {
            return ModulePhase::WaitingForQuorum;
        }
        match &self.stage {
            Stage::Idle => ModulePhase::Listening,
            Stage::Gathering(_) => ModulePhase::Gathered,
            Stage::Planning(_) => ModulePhase::Planning,
            Stage::Acting(acting) => acting.phase(),
            Stage::Outsider(_) => ModulePhase::Spare,
        }
    }

    /// The epoch in which it is.
    #[must_use]
    pub fn epoch(&self) -> Option<Epoch> {
        self.epoch
    }

    /// The digest of its whole plan, once every turn is applied.
    #[must_use]
    pub fn digest(&self) -> Option<Digest> {
        match &self.stage {
            Stage::Acting(acting) => Some(acting.digest()),
            _ => None,
        }
    }

    /// The plan that it acts on.
    #[must_use]
    pub fn plan(&self) -> Option<&crate::model::Plan> {
        match &self.stage {
            Stage::Acting(acting) => Some(acting.plan()),
            _ => None,
        }
    }

    /// Where it stands, as far as its drive has told.
    #[must_use]
    pub fn pose(&self) -> Pose {
        self.body.pose
    }

    /// The modules that it is docked to.
    #[must_use]
    pub fn links(&self) -> &BTreeSet<ModuleId> {
        &self.body.links
    }

    /// How many turns of its epoch it has applied.
    #[must_use]
    pub fn applied_turns(&self) -> u32 {
        match &self.stage {
            Stage::Planning(turns) => turns.applied(),
            Stage::Acting(acting) => acting.turns(),
            _ => 0,
        }
    }

    /// Waits by other limits from the next input on. The caller has them validated, and leaves `lease`, `suspicion`
    /// and `heartbeat` as all members have them.
    pub fn set_parameters(&mut self, parameters: AgentParameters) {
        self.parameters = parameters;
    }

    /// How many messages it refused, by kind.
    #[must_use]
    pub fn refusals(&self) -> &RefusalCounts {
        &self.refusals
    }

    fn hear(&mut self, source: Option<SourceId>, message: Message) {
        match message {
            Message::Target(announcement) => self.hear_target(announcement),
            Message::ModuleState(state) => self.hear_state(source, state),
            Message::Roster(message) => self.hear_roster(source, message),
            Message::Claim(claim) => self.hear_claim(source, claim),
            Message::Heartbeat(heartbeat) => self.hear_heartbeat(source, heartbeat),
            Message::Eviction(_) => {}
        }
    }

    fn hear_target(&mut self, announcement: Arc<TargetAnnouncement>) {
        if let Some(known) = &self.announcement {
            if announcement.revision < known.revision {
                return;
            }
            if announcement.revision == known.revision {
                if announcement != *known {
                    self.refuse(None, Refusal::ContradictingTarget);
                }
                return;
            }
        }
        if announcement.target.is_none() {
            self.emit(Event::TargetWithdrawn);
            self.stand_still();
            self.stage = Stage::Idle;
            self.voice.state_changed = true;
        }
        self.peers.expect(announcement.expected_modules);
        self.know_target(announcement);
    }

    fn know_target(&mut self, announcement: Arc<TargetAnnouncement>) {
        self.targets
            .insert(announcement.revision, digest::of_target(&announcement));
        while self.targets.len() > TARGETS_KEPT {
            self.targets.pop_first();
        }
        self.announcement = Some(announcement);
    }

    fn hear_state(&mut self, source: Option<SourceId>, state: Arc<ModuleState>) {
        if state.module == self.module {
            self.hear_namesake(state.incarnation);
            return;
        }
        let (now, suspicion) = (self.now, self.parameters.suspicion);
        let (module, incarnation) = (state.module, state.incarnation);
        match self.peers.hear_state(now, suspicion, state, source) {
            Ok(true) => self.adjust_links_to(module),
            Ok(false) => {}
            Err(refusal) => self.refuse_of(module, incarnation, refusal),
        }
    }

    fn hear_heartbeat(&mut self, source: Option<SourceId>, heartbeat: Heartbeat) {
        if heartbeat.module == self.module {
            self.hear_namesake(heartbeat.incarnation);
            return;
        }
        let (now, suspicion) = (self.now, self.parameters.suspicion);
        match self.peers.hear_heartbeat(now, suspicion, heartbeat, source) {
            Ok(Hearing::Old) => self.news = false,
            Ok(Hearing::StillHere { age }) => self.news = age > self.parameters.lease,
            Ok(Hearing::News) => {
                if let Some(epoch) = heartbeat.epoch {
                    self.convening.note_epoch(epoch);
                    if heartbeat.digest.is_some() && self.epoch == Some(epoch) {
                        self.note_shown();
                    }
                }
                self.hear_early_roster(heartbeat.module);
            }
            Err(refusal) => self.refuse_of(heartbeat.module, heartbeat.incarnation, refusal),
        }
    }

    /// Another process speaks as this module: the later one stands back until the earlier falls silent.
    ///
    /// Unless the earlier one had been silent for long enough already: then the others have let the later one take its
    /// place, and believe only that. An earlier one that goes on after having been stopped must not push it out again.
    fn hear_namesake(&mut self, incarnation: Incarnation) {
        if incarnation == self.incarnation {
            self.refuse(Some(self.module), Refusal::WrongSource);
            return;
        }
        let listened = self.now.saturating_sub(self.started) > self.parameters.suspicion;
        let has_succeeded = listened && self.standing_back_until.is_none();
        let is_succeeded = self.succeeded_by.is_some_and(|later| incarnation >= later);
        if (incarnation < self.incarnation && !has_succeeded) || is_succeeded {
            self.stand_back();
        }
        self.refusals.add(Refusal::DuplicateModule);
        if self.duplicate_told != Some(incarnation) {
            self.duplicate_told = Some(incarnation);
            self.emit(Event::DuplicateModule(self.module));
        }
    }

    fn stand_back(&mut self) {
        self.standing_back_until = Some(self.now + self.parameters.suspicion);
        self.stand_still();
        self.stage = Stage::Idle;
    }

    fn hear_motion(&mut self, report: MotionReport) {
        match report {
            MotionReport::Pose(pose) => {
                self.body.pose = pose;
                if self.now >= self.voice.pose_told + self.parameters.pose_interval {
                    self.voice.state_changed = true;
                }
            }
            MotionReport::Arrived(pose) => {
                self.body.pose = pose;
                self.body.moving = false;
                self.voice.state_changed = true;
                if let Stage::Acting(acting) = &mut self.stage {
                    acting.arrived();
                }
            }
            MotionReport::Halted(pose) => {
                self.body.pose = pose;
                self.body.moving = false;
                self.voice.state_changed = true;
            }
            MotionReport::Docked(module) => {
                self.body.ports_busy.remove(&module);
                self.body.links.insert(module);
                self.voice.state_changed = true;
            }
            MotionReport::Undocked(module) => {
                self.body.ports_busy.remove(&module);
                self.body.links.remove(&module);
                self.voice.state_changed = true;
            }
            MotionReport::Failed => {
                // One that gave up on its way may coast; a failed drive need not report that it halted.
                self.stand_still();
                self.body.moving = false;
                self.body.ports_busy.clear();
                self.fail_motion();
            }
        }
    }

    /// Does whatever is due, whichever input made it so.
    fn step(&mut self) {
        self.wake = None;
        if let Some(until) = self.standing_back_until {
            if self.now < until {
                self.speak();
                return;
            }
            self.standing_back_until = None;
            self.duplicate_told = None;
        }
        if self
            .announcement
            .as_ref()
            .is_some_and(|known| known.target.is_some())
        {
            self.advance_gathering();
            self.advance_turns();
            self.advance_acting();
            self.consider_new_epoch();
        }
        self.speak();
    }

    /// Publishes the state if it changed, and the heartbeat if it is due.
    fn speak(&mut self) {
        let standing_back = self.standing_back_until.is_some();
        let may_tell = self.may_tell_frozen();
        if self.voice.state_changed && may_tell && !standing_back {
            self.voice.state_changed = false;
            self.voice.pose_told = self.now;
            self.voice.state_sequence += 1;
            let state = self.state();
            self.outputs
                .push_back(Output::Publish(Message::ModuleState(Arc::new(state))));
        }
        let shows = Some((self.epoch, self.digest(), self.phase()));
        if shows != self.voice.heartbeat_showed || self.now >= self.voice.heartbeat_due {
            self.voice.heartbeat_showed = shows;
            self.voice.heartbeat_due = self.now + self.parameters.heartbeat;
            self.voice.heartbeat_sequence += 1;
            let heartbeat = self.heartbeat();
            self.outputs
                .push_back(Output::Publish(Message::Heartbeat(heartbeat)));
            self.repeat_goal();
        }
    }

    fn state(&mut self) -> ModuleState {
        let mut state = ModuleState {
            module: self.module,
            incarnation: self.incarnation,
            sequence: self.voice.state_sequence,
            epoch: self.epoch,
            digest: self.digest(),
            phase: self.phase(),
            service: self.service,
            pose: self.body.pose,
            links: self.body.links.clone(),
            configuration: self.identity.configuration,
            leader: self.identity.leader,
            spot: None,
            unit: None,
            settled_since: 0,
            waited_for: Vec::new(),
            agreed_on: Vec::new(),
            quorum_bases: Vec::new(),
        };
        match &mut self.stage {
            Stage::Gathering(gathering) => {
                let revision = gathering.target_revision();
                state.spot = self.pin_at_revision(revision);
                state.quorum_bases = self.quorum.bases();
            }
            Stage::Acting(acting) => acting.describe(&mut state),
            Stage::Idle | Stage::Planning(_) | Stage::Outsider(_) => {}
        }
        state
    }

    fn heartbeat(&mut self) -> Heartbeat {
        let digest = self.digest();
        let sequence = self.voice.heartbeat_sequence;
        let digest_since = match (digest, self.voice.digest_shown) {
            (None, _) => 0,
            (Some(digest), Some((shown, since))) if shown == digest => since,
            (Some(_), _) => sequence,
        };
        self.voice.digest_shown = digest.map(|digest| (digest, digest_since));
        Heartbeat {
            module: self.module,
            incarnation: self.incarnation,
            sequence,
            uptime: self.now.saturating_sub(self.started),
            epoch: self.epoch,
            digest,
            digest_since,
            applied_turns: self.applied_turns(),
            phase: self.phase(),
        }
    }

    /// The spot of this target on which it has settled, and stays.
    fn pin_for(&self, target: &TargetAnnouncement) -> Option<SpotId> {
        if self.switch.is(Mutation::ForgetPins) {
            return None;
        }
        let settled = self.body.settled_on?;
        (settled.target == digest::of_target(target)).then_some(settled.spot)
    }

    /// The pin to freeze with: none unless it knows the very target that is gathered for, since a pin names a spot only.
    fn pin_at_revision(&self, target_revision: u64) -> Option<SpotId> {
        if self.switch.is(Mutation::PinForAnyTarget) {
            return self.pin_for(self.announcement.as_ref()?);
        }
        if self.switch.is(Mutation::ForgetPins) {
            return None;
        }
        let settled = self.body.settled_on?;
        (self.targets.get(&target_revision) == Some(&settled.target)).then_some(settled.spot)
    }

    fn stand_still(&mut self) {
        // A goal of the same moment, which nobody has heard yet, must not outlive the plan that it came from.
        self.outputs
            .retain(|output| !matches!(output, Output::Move(_)));
        if self.body.moving {
            self.outputs.push_back(Output::Halt);
        }
    }

    fn emit(&mut self, event: Event) {
        self.outputs.push_back(Output::Event(event));
    }

    fn refuse(&mut self, module: Option<ModuleId>, reason: Refusal) {
        self.refusals.add(reason);
        if !reason.is_ordinary() {
            self.emit(Event::Refused { module, reason });
        }
    }

    fn refuse_of(&mut self, module: ModuleId, incarnation: Incarnation, reason: Refusal) {
        if reason == Refusal::DuplicateModule {
            self.refusals.add(reason);
            if self.duplicate_told != Some(incarnation) {
                self.duplicate_told = Some(incarnation);
                self.emit(Event::DuplicateModule(module));
            }
        } else {
            self.refuse(Some(module), reason);
        }
    }

    /// Asks to be woken at `at`, if that lies ahead.
    fn wake_at(&mut self, at: Duration) {
        if at > self.now {
            self.wake = Some(self.wake.map_or(at, |wake| wake.min(at)));
        }
    }
}
