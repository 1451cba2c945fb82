//! What an agent has in every stage: who it is, what it knows of others, what it remembers, and what it has to send.

mod bodies;
mod outdated;
mod reception;
mod recording;
mod removals;

use std::collections::BTreeSet;
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    ConfigurationId, Digest, Epoch, Message, MicroUnits, ModuleId, ModuleRun, PlanningModule,
    RosterMember, STAMP_AHEAD_MAX, Service, SourceId, SpotId, Stop, TargetAnnouncement, digest,
};
use formation_motion::DEVIATION_LIMIT;

use bodies::Bodies;
use reception::Reception;
use removals::Removals;

use super::asked_plan::Plans;
use super::clock_offset::ClockDoubt;
use super::event::Event;
use super::io::{Identity, Output};
use super::known_target::KnownTarget;
use super::outbox::Outbox;
use super::pacing::EpochPacing;
use super::parameters::AgentParameters;
use super::peer::Peer;
use super::peers::{Liveness, Peers};
use super::plans::{ComputedPlan, PlanJob};
use super::quorum::Shortfall;
use super::refusal::Refusal;
use super::robot::{Robot, SettledOn};
use super::session::{Session, shortfall_of};
use super::shown_plans::{Frozen, ShownPlan, ShownPlans};

/// Within what distance of a goal a drive has arrived if nothing else is said.
const POSITION_TOLERANCE: MicroUnits = MicroUnits(20_000);

/// How far a module may be off its spot and keep it, unless twice the tolerance of its drive is more.
const SPOT_LIMIT: MicroUnits = MicroUnits(50_000);

/// Which module this is, and which run of its process.
#[derive(Clone, Copy, Debug)]
pub(super) struct Own {
    pub run: ModuleRun,
    /// The time of its start by its clock, in microseconds since 1970. `run` may have taken a later number.
    pub start_stamp: u64,
    /// The participant that publishes for it, if others are hosted with it.
    pub source: Option<SourceId>,
    pub configuration: Option<ConfigurationId>,
    pub leader: Option<ModuleId>,
    /// Within what distance of a goal its drive has arrived.
    pub position_tolerance: MicroUnits,
    /// Beyond what stated deviation its localisation counts as lost.
    pub deviation_limit: MicroUnits,
    /// Whether its heartbeats fall due at multiples of their period, with those of other modules on the same clock.
    pub shares_samples: bool,
    /// When this run started.
    pub started: Duration,
}

/// What every stage reads and changes.
#[derive(Clone, Debug)]
pub(super) struct Context {
    pub now: Duration,
    pub own: Own,
    pub parameters: AgentParameters,
    pub robot: Robot,
    pub peers: Peers,
    pub bodies: Bodies,
    /// The reports that bodies were taken away, which have not taken effect.
    pub removals: Removals,
    /// The latest command to stop or to resume.
    pub stop: Stop,
    /// Whether heartbeats show that this clock may have stood still.
    pub clock_doubt: Option<ClockDoubt>,
    pub target: KnownTarget,
    pub session: Session,
    pub pacing: EpochPacing,
    pub reception: Reception,
    pub plans: Plans,
    /// The majority that an epoch would need and that is not within reach.
    pub shortfall: Option<Shortfall>,
    pub outbox: Outbox,
}

impl Context {
    pub fn new(identity: Identity, parameters: AgentParameters, now: Duration) -> Self {
        let mut shown = ShownPlans::after(identity.last_plan.clone());
        if !identity.is_first_run {
            shown.forget_until(now + parameters.idle_age());
        }
        Self {
            now,
            own: Own {
                run: identity.run(),
                start_stamp: identity.incarnation.0,
                source: None,
                configuration: identity.configuration,
                leader: identity.leader,
                position_tolerance: POSITION_TOLERANCE,
                deviation_limit: DEVIATION_LIMIT,
                shares_samples: false,
                started: now,
            },
            parameters,
            robot: Robot::new(identity.pose, identity.links),
            peers: Peers::of(identity.module),
            bodies: Bodies::default(),
            removals: Removals::default(),
            stop: Stop::default(),
            clock_doubt: None,
            target: KnownTarget::default(),
            session: Session::new(identity.is_first_run, shown),
            pacing: EpochPacing::new(now + parameters.suspicion, parameters.epoch_interval),
            reception: Reception::default(),
            plans: Plans::default(),
            shortfall: None,
            outbox: Outbox::new(now, identity.has_store),
        }
    }

    pub fn module(&self) -> ModuleId {
        self.own.run.module
    }

    /// The latest time stamp, in microseconds since 1970, that another process may have taken: clocks that were never set
    /// start in 1970, and differ by less than [`STAMP_AHEAD_MAX`].
    pub fn latest_stamp(&self) -> u64 {
        let uptime = self.now.saturating_sub(self.own.started).as_micros();
        let uptime = u64::try_from(uptime).unwrap_or(u64::MAX);
        let own = self.own.start_stamp.saturating_add(uptime);
        own.saturating_add(STAMP_AHEAD_MAX)
    }

    /// Whether an incarnation, an epoch or a revision is low enough to be true. A bound that depends on what is known would let a
    /// stranger raise the number step by step, out of reach of modules that start later.
    /// Enforces E2.
    pub fn is_plausible(&self, number: u64) -> bool {
        number <= self.latest_stamp()
    }

    /// Whether it must not move, whatever the members agree on.
    pub fn holds_still(&self) -> bool {
        self.stop.stopped || self.clock_doubt.is_some()
    }

    pub fn liveness(&self) -> Liveness {
        Liveness {
            latest_stamp: self.latest_stamp(),
            now: self.now,
            suspicion: self.parameters.suspicion,
            period: self.parameters.heartbeat,
        }
    }

    /// The majority that the best clique lacks, for a target that is announced.
    pub fn live_shortfall(&mut self) -> Option<Shortfall> {
        let is_unknown = self.session.voters().named.is_empty();
        let mut live = self.peers.live(self.liveness());
        if is_unknown && live.any(|(_, peer)| peer.knows_voters()) {
            return Some(Shortfall::VotersUnknown);
        }
        drop(live);
        let votes = self.clique_votes();
        self.shortfall_of(&votes)
    }

    /// Those of the best clique, each with whether it knows.
    fn clique_votes(&mut self) -> Vec<(ModuleId, bool)> {
        let clique = self.clique();
        let mut votes = self.live_votes();
        votes.retain(|(module, _)| clique.binary_search(module).is_ok());
        votes
    }

    /// Whether the best clique has a majority without some of its modules.
    pub fn has_quorum_without(&mut self, some: &[ModuleId]) -> bool {
        let mut votes = self.clique_votes();
        votes.retain(|(module, _)| !some.contains(module));
        self.shortfall_of(&votes).is_none()
    }

    /// Whether a majority would be lacking if one more voter fell silent.
    pub fn depends_on_each_voter(&mut self) -> bool {
        let mut live = self.clique_votes();
        let voters = self.session.voters();
        let counts = |&(module, knows): &(ModuleId, bool)| {
            knows && voters.named.binary_search(&module).is_ok()
        };
        if let Some(lowest) = live.iter().position(counts) {
            live.remove(lowest);
        }
        self.shortfall_of(&live).is_some()
    }

    pub fn shortfall_of(&self, present: &[(ModuleId, bool)]) -> Option<Shortfall> {
        let target = self.target.announcement().map(Arc::as_ref);
        let voters = self.session.voters_for(&[], self.removals.due_votes());
        shortfall_of(&voters, present.iter().copied(), target)
    }

    /// This module and all live ones, each with whether it knows, in ascending order.
    pub fn live_votes(&self) -> Vec<(ModuleId, bool)> {
        let live = self.peers.live(self.liveness());
        let mut live: Vec<(ModuleId, bool)> =
            live.map(|(module, peer)| (module, peer.knows())).collect();
        let own = self.module();
        let position = live.partition_point(|&(module, _)| module < own);
        live.insert(position, (own, self.session.knows()));
        live
    }

    /// Whether this run of this module has listened for `suspicion`.
    pub fn has_listened(&self) -> bool {
        self.now >= self.own.started + self.parameters.suspicion
    }

    /// This module freezes: which plans can runs of it have shown within the lease?
    /// Enforces A2.
    pub fn freeze(&mut self) {
        let is_old = self.now >= self.own.started + self.parameters.idle_age();
        let shown = &mut self.session.shown;
        let is_idle = !shown.has_shown && (self.session.is_first_run || is_old);
        shown.frozen = Frozen {
            is_idle,
            last_plan: shown.only_plan(self.now).map(ShownPlan::digest),
        };
    }

    /// This module and all live ones, in ascending order.
    pub fn live_modules(&self) -> Vec<ModuleId> {
        let live = self.peers.live(self.liveness());
        let mut live: Vec<ModuleId> = live.map(|(module, _)| module).collect();
        let own = self.module();
        live.insert(live.partition_point(|&module| module < own), own);
        live
    }

    /// Whether a module's service is known and active.
    pub fn is_active(&self, module: ModuleId) -> bool {
        self.service_of(module) == Some(Service::Active)
    }

    /// Whether an epoch may be opened to include a module that is not in the roster: all that would be members receive it. A run that
    /// is yet to take a later number would be no member.
    /// Enforces E7, M7.
    pub fn is_wanted(&mut self, module: ModuleId) -> bool {
        !self.is_outdated(module) && self.clique().binary_search(&module).is_ok()
    }

    /// The service of a module; `None` before its first state.
    pub fn service_of(&self, module: ModuleId) -> Option<Service> {
        self.service_shown(module, self.peers.get(module))
    }

    /// The same for a module whose peer is at hand.
    pub fn service_shown(&self, module: ModuleId, peer: Option<&Peer>) -> Option<Service> {
        if module == self.module() {
            return Some(self.robot.service);
        }
        Some(peer?.state.as_ref()?.service)
    }

    /// Whether a later revision announces a target with other content than this one.
    /// Enforces E8.
    pub fn has_replaced(&self, target: &TargetAnnouncement) -> bool {
        self.target.announcement().is_some_and(|latest| {
            latest.revision > target.revision
                && digest::of_target(latest) != digest::of_target(target)
        })
    }

    /// Records the majority that is missing for the next epoch, and reports it if it differs.
    pub fn set_shortfall(&mut self, shortfall: Option<Shortfall>) {
        if shortfall.is_some() != self.shortfall.is_some() {
            self.mark_state_changed();
        }
        if shortfall == self.shortfall {
            return;
        }
        self.shortfall = shortfall;
        if let Some(shortfall) = shortfall {
            self.emit(Event::WaitingForQuorum(shortfall));
        }
    }

    /// The spot on which the module has settled, and which it keeps, if the target of that spot has this digest.
    /// Enforces P1.
    pub fn pin_for(&self, target: impl FnOnce() -> Digest) -> Option<SpotId> {
        let settled = self.robot.settled_on?;
        let is_of_target = settled.target == target();
        let stays = !self.is_off_spot(settled) || !self.robot.is_localised;
        (is_of_target && stays).then_some(settled.spot)
    }

    /// How far a settled module may be off its spot.
    pub fn spot_limit(&self) -> MicroUnits {
        SPOT_LIMIT.max(MicroUnits(2 * self.own.position_tolerance.0))
    }

    /// Whether the module is measured off a spot of the known target.
    fn is_off_spot(&self, settled: SettledOn) -> bool {
        let Some(announcement) = self.target.announcement() else {
            return false;
        };
        let target = announcement.target.as_ref();
        let place = target.and_then(|target| target.spot(settled.spot));
        let is_off = place.is_some_and(|place| {
            let limit = self.spot_limit();
            let pose = &self.robot.pose;
            pose.distance_to(&place.pose) > limit || pose.heading_difference(&place.pose) > limit
        });
        // In another target a spot of this number is another place.
        is_off && digest::of_target(announcement) == settled.target
    }

    /// This module as it announced itself when it froze for a plan for the target with this digest.
    /// Enforces G3.
    pub fn as_member(&self, target: impl FnOnce() -> Digest) -> RosterMember {
        RosterMember {
            incarnation: self.own.run.incarnation,
            knows: self.session.knows(),
            is_idle: self.session.shown.frozen.is_idle,
            service: self.robot.service,
            module: PlanningModule {
                id: self.module(),
                pose: self.robot.pose,
                links: self.robot.links.clone(),
                configuration: self.own.configuration,
                leader: self.own.leader,
                pin: self.pin_for(target),
            },
        }
    }

    /// Stops the drive, and withdraws goals of the same instant.
    /// Enforces A7.
    pub fn stand_still(&mut self) {
        self.outbox.withdraw_goals();
        if self.robot.moving {
            self.outbox.push(Output::Halt);
        }
    }

    /// Stops the drive, and gives up the spot on which the module has settled.
    /// Enforces S1.
    pub fn leave_spot(&mut self) {
        self.stand_still();
        self.robot.settled_on = None;
    }

    /// The drive or a port failed, or took too long: the module takes no spot until it receives the command to rejoin.
    /// Enforces X4.
    pub fn fail_motion(&mut self, spot: Option<SpotId>) {
        self.robot.kept_by = None;
        self.cannot_move(Event::MotionFailed(spot));
    }

    /// The module cannot move, for the reason in the event, and takes no spot.
    pub fn cannot_move(&mut self, reason: Event) {
        self.leave_spot();
        if self.robot.service != Service::MotionFailed {
            self.robot.service = Service::MotionFailed;
            self.mark_state_changed();
            self.emit(reason);
        }
    }

    /// Whether this module may open an epoch. One whose drive failed on the way may never be measured to stand, and then closes
    /// no roster.
    /// Enforces E4.
    pub fn can_convene(&self) -> bool {
        self.robot.is_at_rest() || !self.robot.has_failed
    }

    /// The plan of a job; `None` until the host has computed it.
    pub fn plan(&mut self, job: PlanJob) -> Option<Arc<ComputedPlan>> {
        self.plans.get(job, &mut self.outbox)
    }

    /// Records an epoch that exists, unless it is too high to be true.
    pub fn note_epoch(&mut self, epoch: Epoch) {
        if self.is_plausible(epoch.number) {
            self.session.note_epoch(epoch);
        }
    }

    /// Records that an epoch was opened, by this module or another.
    pub fn note_opened(&mut self, epoch: Epoch) {
        self.session.note_epoch(epoch);
        let limit = self.parameters.epoch_interval_limit;
        self.pacing.opened(self.now, limit);
    }

    /// Asks the ports to undock from these modules, unless they already work on a link to them.
    pub fn undock(&mut self, links: impl IntoIterator<Item = ModuleId>) {
        for link in links {
            if self.robot.ports_busy.insert(link) {
                self.outbox.push(Output::Undock(link));
            }
        }
    }

    /// The links that are not to be kept.
    pub fn links_except(&self, is_kept: impl Fn(ModuleId) -> bool) -> BTreeSet<ModuleId> {
        let links = self.robot.links.iter().copied();
        links.filter(|&link| !is_kept(link)).collect()
    }

    /// Publishes a state as soon as the stage allows it.
    pub fn mark_state_changed(&mut self) {
        self.outbox.states.changed = true;
    }

    pub fn publish(&mut self, message: Message) {
        self.outbox.push(Output::Publish(message));
    }

    pub fn emit(&mut self, event: Event) {
        self.outbox.push(Output::Event(event));
    }

    pub fn refuse(&mut self, module: Option<ModuleId>, reason: Refusal) {
        self.outbox.refuse(module, reason);
    }

    /// Asks to be woken at `at`, if that is in the future.
    pub fn wake_at(&mut self, at: Duration) {
        if at > self.now {
            self.outbox.wake_at(at);
        }
    }
}

impl Hash for Context {
    /// Everything that the behaviour of one run depends on. Times are compared with the time of the search itself. The plans
    /// of an agent that computes them itself follow from its stage.
    fn hash<H: Hasher>(&self, state: &mut H) {
        let Self {
            now: _,
            own,
            parameters: _,
            robot,
            peers,
            bodies,
            removals,
            stop,
            clock_doubt,
            target,
            session,
            pacing,
            reception,
            plans: _,
            shortfall,
            outbox,
        } = self;
        (own.run, robot, peers, bodies, removals, stop, target).hash(state);
        (session, pacing, reception, shortfall, outbox, clock_doubt).hash(state);
    }
}
