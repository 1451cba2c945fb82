//! The protocol: how one module agrees with others on a plan and carries it out.
//!
//! An [`Agent`] is a state machine without I/O. Its host, a DDS process or a simulator, keeps to this order:
//!
//! 1. [`Agent::handle`] with one input and the time since some fixed start,
//! 2. [`Agent::poll_output`] until it is empty, carrying out each output,
//! 3. [`Agent::poll_timeout`], and [`Input::Timeout`] at that time unless another input comes first.
//!
//! Everything happens in **epochs**. The *convener* opens one (`convening`), the members halt and announce themselves, and
//! a roster fixes the whole input of the plan (`stage/gathering`). The units take turns, and each agent recomputes every
//! claim (`stage/planning`). When all members show the same digest (`stage/agreeing`), and a lease has passed, the units
//! move one after another (`stage/acting`). A new epoch resolves any doubt; it must contain a majority of the
//! session's voters (`quorum`).
//!
//! An agent has a `Context`, which outlives every stage, and a `Stage`, which owns what exists only while it lasts. After
//! each input the stage takes steps until none leads to another stage. A step depends on the whole state and not on an
//! earlier message, so messages may come late, twice or in any order across writers.

mod asked_plan;
mod channel;
mod cliques;
mod clock_check;
mod clock_offset;
mod context;
mod convening;
mod durable;
mod event;
mod indexed_motion;
mod io;
mod known_target;
mod member_bodies;
mod motion;
mod outbox;
mod pacing;
mod parameters;
mod peer;
mod peers;
mod pins;
mod plans;
mod publishing;
mod quorum;
mod refusal;
mod replica;
mod robot;
mod roster_plan;
mod rosters;
mod session;
mod shown_plans;
mod snapshot;
mod stage;
mod stop;
mod succession;
mod write_ahead;

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::Arc;
use std::time::Duration;

pub use durable::DurableState;
pub use event::{EpochReason, Event, Severity};
pub use io::{Command, Identity, Input, Output};
pub use parameters::{AgentParameters, ParametersError};
pub use plans::{ComputedPlan, PlanJob};
pub use quorum::Shortfall;
pub use refusal::{Refusal, RefusalCounts};
pub use replica::{Arrived, Replica};
pub use shown_plans::ShownPlan;

use formation_model::{
    Digest, Epoch, Heartbeat, Message, MicroUnits, ModuleId, ModulePhase, ModuleRun, ModuleState,
    Plan, Pose, Service, SourceId, SpotClaim, TargetAnnouncement,
};

use context::Context;
use peers::{Heard, HeartbeatNews, Seen, StateNews};
use rosters::EarlyRosters;
use stage::{Stage, Transition};
use succession::Succession;

/// A revision further ahead of the known one, and of this module's clock, than this is refused.
const REVISION_STEP_MAX: u64 = 1 << 20;

/// One module's side of the protocol.
#[derive(Clone)]
pub struct Agent {
    context: Context,
    stage: Stage,
    succession: Succession,
    early_rosters: EarlyRosters,
}

impl Agent {
    /// An agent for one module, started at `now`.
    #[must_use]
    pub fn new(identity: Identity, parameters: AgentParameters, now: Duration) -> Self {
        Self {
            context: Context::new(identity, parameters, now),
            stage: Stage::Listening(None),
            succession: Succession::default(),
            early_rosters: EarlyRosters::default(),
        }
    }

    /// The same agent, which knows from its start who votes in the session.
    #[must_use]
    pub fn with_voters(mut self, voters: &[ModuleId]) -> Self {
        self.context.session.note_voters(voters);
        self
    }

    /// The same agent, in or out of service from its start.
    #[must_use]
    pub fn in_service(mut self, service: Service) -> Self {
        self.context.robot.service = service;
        self
    }

    /// The same agent, which started when the clock of its machine showed this time, in microseconds since 1970. Without it, that is
    /// its incarnation, which a store or a former run may have raised.
    #[must_use]
    pub fn started_at(mut self, stamp: u64) -> Self {
        self.context.own.start_stamp = stamp;
        self
    }

    /// The same agent, which asks its host for plans by [`Output::Compute`] and does not compute them itself.
    #[must_use]
    pub fn with_plans_of_host(mut self) -> Self {
        self.context.plans.by_host = true;
        self
    }

    /// The same agent, whose heartbeats fall due at multiples of their period and not a period after the last: a host that gives
    /// the same time to several agents sends them as one sample.
    #[must_use]
    pub fn with_shared_samples(mut self) -> Self {
        self.context.own.shares_samples = true;
        self
    }

    /// The same agent, published for by this participant, which may host others on the same clock.
    #[must_use]
    pub fn published_by(mut self, source: SourceId) -> Self {
        self.context.own.source = Some(source);
        self
    }

    /// The same agent, whose drive arrives within this distance of its goals.
    #[must_use]
    pub fn with_position_tolerance(mut self, tolerance: MicroUnits) -> Self {
        self.context.own.position_tolerance = tolerance;
        self
    }

    /// The same agent, whose localisation counts as lost if its driver states a greater standard deviation.
    #[must_use]
    pub fn with_deviation_limit(mut self, limit: MicroUnits) -> Self {
        self.context.own.deviation_limit = limit;
        self
    }

    /// Handles one input at the time `now`, which must not run backwards.
    pub fn handle(&mut self, now: Duration, input: Input) {
        if let Input::Persisted(number) = input {
            // What waited for the store depends on nothing in this input.
            self.context.outbox.note_persisted(number);
        }
        self.begin_input(now);
        let may_change_what_is_due = match input {
            Input::Message { source, message } => self.handle_message(source, message),
            Input::Motion(report) => {
                self.handle_motion(report);
                true
            }
            Input::Command(command) => {
                self.handle_command(command);
                true
            }
            Input::Departed(source) => self.context.record_departure(source),
            Input::Computed(computed) => self.context.plans.receive(computed),
            Input::Persisted(_) | Input::Timeout => true,
        };
        self.end_input(may_change_what_is_due);
    }

    fn begin_input(&mut self, now: Duration) {
        self.context.now = self.context.now.max(now);
        self.context.outbox.begin_input();
    }

    fn end_input(&mut self, may_change_what_is_due: bool) {
        if may_change_what_is_due {
            self.step();
        }
        self.write_ahead();
    }

    /// The next output to carry out; `None` when the agent waits.
    pub fn poll_output(&mut self) -> Option<Output> {
        let output = self.context.outbox.pop();
        if matches!(output, Some(Output::Move(_))) {
            // From here on the drive has the goal; a goal that was withdrawn before moved nothing.
            self.context.robot.settled_on = None;
        }
        output
    }

    /// When [`Input::Timeout`] is due, on the clock of [`Self::handle`].
    #[must_use]
    pub fn poll_timeout(&self) -> Duration {
        self.context.outbox.timeout()
    }

    /// The module.
    #[must_use]
    pub fn module(&self) -> ModuleId {
        self.context.module()
    }

    /// The module, and the number of this run of its process, which may rise.
    #[must_use]
    pub fn run(&self) -> ModuleRun {
        self.context.own.run
    }

    /// What the module is doing.
    #[must_use]
    pub fn phase(&self) -> ModulePhase {
        // While it moves, all members agree.
        if self.context.shortfall.is_some() && !self.context.robot.moving {
            ModulePhase::WaitingForQuorum
        } else {
            self.stage.phase()
        }
    }

    /// The latest epoch that it has entered.
    #[must_use]
    pub fn epoch(&self) -> Option<Epoch> {
        self.stage.epoch()
    }

    /// The last plan that it showed, if nobody can move by any other one that runs of it showed: the next run of its process starts with
    /// it, unless the drive may go on without the process.
    #[must_use]
    pub fn last_plan(&self) -> Option<&ShownPlan> {
        self.context.session.shown.only_plan(self.context.now)
    }

    /// The digest of its whole plan, once every turn is applied.
    #[must_use]
    pub fn digest(&self) -> Option<Digest> {
        Some(self.stage.held_plan()?.digest)
    }

    /// The plan that it acts on.
    #[must_use]
    pub fn plan(&self) -> Option<&Plan> {
        Some(&*self.stage.held_plan()?.plan)
    }

    /// Its pose, as last reported by its drive.
    #[must_use]
    pub fn pose(&self) -> Pose {
        self.context.robot.pose
    }

    /// The goals of the present step and of all after it; empty while it does not move.
    #[must_use]
    pub fn path_ahead(&self) -> Vec<Pose> {
        self.stage.path_ahead()
    }

    /// The modules that it is docked to.
    #[must_use]
    pub fn links(&self) -> &BTreeSet<ModuleId> {
        &self.context.robot.links
    }

    /// Whether it takes a spot when it can.
    #[must_use]
    pub fn service(&self) -> Service {
        self.context.robot.service
    }

    /// The number of turns of its epoch that it has applied.
    #[must_use]
    pub fn applied_turns(&self) -> u32 {
        self.stage.applied_turns()
    }

    /// Applies other time limits from the next input on. The caller has them validated, and leaves `lease`, `suspicion`
    /// and `heartbeat` as all members have them.
    pub fn set_parameters(&mut self, parameters: AgentParameters) {
        self.context.parameters = parameters;
    }

    /// The number of messages that it refused, by kind.
    #[must_use]
    pub fn refusals(&self) -> &RefusalCounts {
        &self.context.outbox.refusals
    }

    /// A hash of everything that its behaviour depends on; counts for reports are left out. Two agents of one module with
    /// equal hashes behave the same from now on, up to collisions of 64-bit hashes.
    #[must_use]
    pub fn state_hash(&self) -> u64 {
        let Self {
            context,
            stage,
            succession,
            early_rosters,
        } = self;
        let mut hasher = DefaultHasher::new();
        (context, stage, succession, early_rosters).hash(&mut hasher);
        hasher.finish()
    }

    /// Does what is due.
    /// Enforces C1.
    fn step(&mut self) {
        self.context.outbox.forget_wakes();
        self.check_clock();
        let stood_back = self.succession.is_standing_back();
        let stands_back = self.succession.still_stands_back(self.context.now);
        if stood_back && !stands_back {
            self.exceed_silent_run();
            self.handle_early_rosters();
        }
        let are_removals_new = self.context.refresh_removals();
        let are_missed_new = self.context.refresh_missed();
        if (are_removals_new || are_missed_new) && matches!(self.stage, Stage::Gathering(_)) {
            self.context.mark_state_changed();
        }
        self.context.move_again();
        if !stands_back && self.context.target.is_set() {
            let stands_there = |stage: &Stage| stage.is_settled() && !stage.is_off_path();
            let stood_there = stands_there(&self.stage);
            self.run_stage();
            if !stood_there && stands_there(&self.stage) {
                self.adjust_links_to_neighbours();
            }
            self.consider_new_epoch();
        }
        self.publish_due();
    }

    /// Lets the stage take steps until none leads to another stage.
    fn run_stage(&mut self) {
        loop {
            let stage = std::mem::replace(&mut self.stage, Stage::Listening(None));
            match stage.step(&mut self.context) {
                Transition::Enter(stage) => self.stage = stage,
                Transition::Stay(stage) => {
                    self.stage = stage;
                    return;
                }
            }
        }
    }

    /// Leaves the epoch, and stands still.
    fn leave_epoch(&mut self) {
        self.remember_members();
        self.context.stand_still();
        self.stage = Stage::Listening(self.stage.epoch());
    }

    /// Handles a message; returns whether it may change what is due.
    fn handle_message(&mut self, source: Option<SourceId>, message: Message) -> bool {
        match message {
            Message::Target(announcement) => self.handle_target(announcement),
            Message::ModuleState(state) => return self.handle_state(source, state),
            Message::Roster(message) => self.handle_roster(source, message),
            Message::Claim(claim) => self.handle_claim(source, claim),
            Message::Heartbeat(heartbeat) => return self.handle_heartbeat(source, heartbeat),
            // A claim contains its evictions.
            Message::Eviction(_) => {}
            Message::OtherSessionState(state) => self.handle_other_session_state(&state),
            Message::Stop(stop) => self.handle_stop(stop),
            Message::Removal(removal) => self.context.handle_removal_report(removal),
        }
        true
    }

    /// Enforces E8, E10.
    fn handle_target(&mut self, announcement: Arc<TargetAnnouncement>) {
        if !self.is_plausible_revision(announcement.revision) {
            return self.context.refuse(None, Refusal::ImplausibleRevision);
        }
        let context = &mut self.context;
        if context.session.contradicts(&announcement.voters) {
            return context.refuse(None, Refusal::OtherVoters);
        }
        if let Some(known) = context.target.announcement() {
            if announcement.revision == known.revision && announcement != *known {
                context.refuse(None, Refusal::ContradictingTarget);
                return;
            }
            if announcement.revision <= known.revision {
                return;
            }
        }
        // A target that is ignored as old names no voters either.
        context.session.note_voters(&announcement.voters);
        context
            .peers
            .table_mut()
            .expect(announcement.expected_modules);
        if announcement.target.is_none() {
            context.emit(Event::TargetWithdrawn);
            context.mark_state_changed();
            self.leave_epoch();
        }
        self.context.target.set(announcement);
    }

    /// Whether a revision is near enough to this module's clock, or to the known revision, to be true.
    fn is_plausible_revision(&self, revision: u64) -> bool {
        let known = self.context.target.revision().unwrap_or_default();
        self.context.is_plausible(revision) || revision <= known.saturating_add(REVISION_STEP_MAX)
    }

    /// Handles a state. What a second process sends as this module is not recorded: to this one that is no peer.
    fn handle_state(&mut self, source: Option<SourceId>, state: Arc<ModuleState>) -> bool {
        let seen = match state.module == self.module() {
            true => Seen::of(&state),
            false => self.context.record_state(source, state),
        };
        self.note_seen(&seen)
    }

    /// Takes note of a state; one that is known already changes nothing that is due. A process repeats the states of all its modules.
    fn note_seen(&mut self, seen: &Seen) -> bool {
        let Seen { state, news } = seen;
        let run = state.module.run(state.incarnation);
        if run.module == self.module() {
            self.handle_duplicate(run.incarnation);
            return true;
        }
        match *news {
            Ok(StateNews::Old) => return false,
            Ok(news) => {
                if news == StateNews::OfRun {
                    self.context.note_run(run);
                }
                self.note_body(state);
                if news == StateNews::OnTheWay {
                    return self.stage.waits_for(run.module);
                }
                self.stage.follow_place(state, &self.context);
                self.adjust_links_to(state);
                self.note_run_named_in(&state.bodies);
            }
            Err(refusal) => self.refuse_run(run, refusal),
        }
        true
    }

    /// Handles that the latest state of a module may report the body of another run of this one.
    fn handle_bodies_of(&mut self, module: ModuleId) {
        if let Some(state) = self.context.peers.state(module).cloned() {
            self.note_run_named_in(&state.bodies);
        }
    }

    /// The same for a heartbeat.
    fn handle_heartbeat(&mut self, source: Option<SourceId>, heartbeat: Heartbeat) -> bool {
        let heard = match heartbeat.module == self.module() {
            true => Heard::of(&heartbeat),
            false => self.context.record_heartbeat(source, heartbeat),
        };
        self.note_heartbeat(heard)
    }

    /// Takes note of a heartbeat; one that shows nothing new changes nothing that is due.
    /// Enforces H2.
    fn note_heartbeat(&mut self, heard: Heard) -> bool {
        let Heard {
            run,
            epoch,
            stop,
            holds_plan,
            news,
            gain,
        } = heard;
        if run.module == self.module() {
            self.handle_duplicate(run.incarnation);
            return true;
        }
        let is_clock_in_doubt = self.doubt_clock(run.module, gain);
        if news.is_ok() && self.context.is_back(run.module) {
            self.hurry_heartbeat();
        }
        let context = &mut self.context;
        match news {
            Ok(HeartbeatNews::Old) => return is_clock_in_doubt,
            Ok(HeartbeatNews::StillLive { age, advanced }) => {
                context.note_heard(run);
                // What was too far ahead of this clock may be near enough by now.
                if let Some(epoch) = epoch {
                    context.note_epoch(epoch);
                }
                let is_late = age > context.parameters.lease;
                if is_late {
                    // While it was silent a later run may have become known.
                    context.note_run(run);
                }
                let is_commanded = stop > context.stop && context.is_plausible(stop.revision);
                if is_commanded {
                    self.handle_stop(stop);
                }
                let may_go_on = advanced && self.stage.waits_for(run.module);
                return is_late || is_commanded || is_clock_in_doubt || may_go_on;
            }
            Ok(HeartbeatNews::New) => {
                self.handle_stop(stop);
                self.context.note_run(run);
                self.context.note_heard(run);
                self.note_shown(epoch, holds_plan);
                // A state that was kept may have become its own.
                self.handle_bodies_of(run.module);
                self.handle_early_roster_of(run.module);
            }
            Err(Refusal::OtherVoters) => {
                context.refuse(Some(run.module), Refusal::OtherVoters);
            }
            Err(refusal) => {
                if refusal == Refusal::StaleIncarnation {
                    self.context.note_heard(run);
                }
                self.refuse_run(run, refusal);
            }
        }
        true
    }

    /// Whether a heartbeat may change anything for this module. Of most that come to a process it changes nothing for any of its
    /// modules.
    fn heeds(&self, heard: Heard) -> bool {
        let context = &self.context;
        let (age, advanced) = match heard.news {
            Ok(HeartbeatNews::Old) => (Duration::ZERO, false),
            Ok(HeartbeatNews::StillLive { age, advanced }) => (age, advanced),
            Ok(HeartbeatNews::New) | Err(_) => return true,
        };
        // A second process that sends as this module may be live for the others of this process.
        heard.run.module == self.module()
            || age > context.parameters.lease
            || advanced && self.stage.waits_for(heard.run.module)
            || heard.gain > context.parameters.heartbeat
            || heard.stop > context.stop
            || heard.epoch > context.session.highest_epoch()
            || context.lists_as_missed(heard.run.module)
            || context.doubts_removal_of(heard.run.module)
    }

    /// Records the epoch that a heartbeat shows, and whether it shows a plan.
    fn note_shown(&mut self, epoch: Option<Epoch>, holds_plan: bool) {
        let Some(epoch) = epoch else {
            return;
        };
        self.context.note_epoch(epoch);
        self.context.session.has_seen_plan |= holds_plan;
    }

    fn handle_claim(&mut self, source: Option<SourceId>, claim: Arc<SpotClaim>) {
        let claimant = claim.claimant;
        if let Err(refusal) = self.check_claim(source, &claim) {
            return self.context.refuse(Some(claimant), refusal);
        }
        // Rosters list only modules that have halted for their epoch, so the claims of other epochs concern other modules.
        if self.stage.epoch() == Some(claim.epoch)
            && let Err(refusal) = self.stage.take_claim(claim)
        {
            self.context.refuse(Some(claimant), refusal);
        }
    }

    /// Enforces T3.
    fn check_claim(&self, source: Option<SourceId>, claim: &SpotClaim) -> Result<(), Refusal> {
        let run = claim.claimant.run(claim.incarnation);
        self.context.peers.check_source(run, source)?;
        if claim.claimant == self.module() {
            return Err(Refusal::WrongSource);
        }
        let current = self.stage.epoch();
        if current.is_some_and(|current| claim.epoch < current) {
            return Err(Refusal::StaleEpoch);
        }
        if current != Some(claim.epoch) && !self.context.is_plausible(claim.epoch.number) {
            return Err(Refusal::ImplausibleEpoch);
        }
        Ok(())
    }
}
