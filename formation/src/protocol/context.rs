//! What an agent has in every stage: who it is, what it knows of others, what it remembers, and what it has to send.

use std::collections::BTreeSet;
use std::hash::{Hash, Hasher};
use std::time::Duration;

use crate::model::{
    ConfigurationId, Epoch, Message, ModuleId, ModuleRun, PlanningModule, RosterMember, Service,
    SpotId, TargetAnnouncement, digest,
};

use super::body::Body;
use super::event::Event;
use super::io::{Identity, Output};
use super::memory::{KnownTarget, Memory};
use super::mutation::Bugs;
use super::outbox::Outbox;
use super::pacing::EpochPacing;
use super::parameters::AgentParameters;
use super::peers::{Liveness, Peers};
use super::quorum::Shortfall;
use super::refusal::Refusal;

/// Which module this is, and which run of its process.
#[derive(Clone, Copy, Debug)]
pub(super) struct Own {
    pub run: ModuleRun,
    pub configuration: Option<ConfigurationId>,
    pub leader: Option<ModuleId>,
    /// When this run started.
    pub started: Duration,
}

/// What every stage reads and changes.
#[derive(Clone, Debug)]
pub(super) struct Context {
    pub now: Duration,
    pub own: Own,
    pub parameters: AgentParameters,
    pub bugs: Bugs,
    pub body: Body,
    pub peers: Peers,
    pub target: KnownTarget,
    pub memory: Memory,
    pub pacing: EpochPacing,
    /// The majority that an epoch would need and that is not within reach.
    pub shortfall: Option<Shortfall>,
    pub outbox: Outbox,
}

impl Context {
    pub fn new(identity: Identity, parameters: AgentParameters, now: Duration) -> Self {
        Self {
            now,
            own: Own {
                run: identity.run(),
                configuration: identity.configuration,
                leader: identity.leader,
                started: now,
            },
            parameters,
            bugs: Bugs::default(),
            body: Body::new(identity.pose, identity.links),
            peers: Peers::default(),
            target: KnownTarget::default(),
            memory: Memory::default(),
            pacing: EpochPacing::new(now + parameters.suspicion, parameters.epoch_interval),
            shortfall: None,
            outbox: Outbox::new(now),
        }
    }

    pub fn module(&self) -> ModuleId {
        self.own.run.module
    }

    pub fn liveness(&self) -> Liveness {
        Liveness {
            now: self.now,
            suspicion: self.parameters.suspicion,
            bugs: self.bugs,
        }
    }

    /// This run and those of all live modules, in ascending order.
    pub fn live_runs(&self) -> Vec<ModuleRun> {
        let peers = self.peers.live(self.liveness());
        let mut runs: Vec<ModuleRun> = peers
            .map(|(module, peer)| ModuleRun {
                module,
                incarnation: peer.incarnation,
            })
            .chain([self.own.run])
            .collect();
        runs.sort_unstable();
        runs
    }

    /// Whether a module's service is known and active.
    pub fn is_active(&self, module: ModuleId) -> bool {
        self.service_of(module) == Some(Service::Active)
    }

    /// The service of a module; `None` before its first state.
    pub fn service_of(&self, module: ModuleId) -> Option<Service> {
        if module == self.module() {
            return Some(self.body.service);
        }
        Some(self.peers.state(module)?.service)
    }

    /// The first earlier roster of which these runs hold no majority.
    pub fn shortfall_of(&self, present: &[ModuleRun], expected: Option<u32>) -> Option<Shortfall> {
        if self.bugs.ignore_quorum() {
            return None;
        }
        let counted = self.bugs.counted(present);
        self.memory.quorum.shortfall(&counted, expected)
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
        if let Some(Shortfall { present, basis }) = shortfall {
            self.emit(Event::WaitingForQuorum { present, basis });
        }
    }

    /// The spot of this target on which the module has settled, and which it keeps.
    pub fn pin_for(&self, target: &TargetAnnouncement) -> Option<SpotId> {
        if self.bugs.forget_pins() {
            return None;
        }
        self.body.settled_spot(digest::of_target(target))
    }

    /// The pin to freeze with: none unless this module knows the target of that revision, since a pin names a spot only.
    pub fn pin_at_revision(&self, revision: u64) -> Option<SpotId> {
        if self.bugs.pin_for_any_target() {
            return self.pin_for(self.target.announcement()?);
        }
        if self.bugs.forget_pins() {
            return None;
        }
        self.body.settled_spot(self.target.at_revision(revision)?)
    }

    /// This module as it announced itself when it froze for a plan for this target.
    pub fn as_member(&self, target: &TargetAnnouncement) -> RosterMember {
        RosterMember {
            incarnation: self.own.run.incarnation,
            service: self.body.service,
            module: PlanningModule {
                id: self.module(),
                pose: self.body.pose,
                links: self.body.links.clone(),
                configuration: self.own.configuration,
                leader: self.own.leader,
                pin: self.pin_for(target),
            },
        }
    }

    /// Stops the drive, and withdraws goals of the same instant.
    pub fn stand_still(&mut self) {
        self.outbox.withdraw_goals();
        if self.body.moving {
            self.outbox.push(Output::Halt);
        }
    }

    /// Stops the drive, and gives up the spot on which the module has settled.
    pub fn leave_spot(&mut self) {
        self.stand_still();
        self.body.settled_on = None;
    }

    /// The drive or a port failed, or took too long: the module takes no spot until it receives the command to rejoin.
    pub fn fail_motion(&mut self, spot: Option<SpotId>) {
        self.leave_spot();
        if self.body.service == Service::Active {
            self.body.service = Service::MotionFailed;
            self.mark_state_changed();
            self.emit(Event::MotionFailed(spot));
        }
    }

    /// Records that an epoch was opened, by this module or another.
    pub fn note_opened(&mut self, epoch: Epoch) {
        self.memory.note_epoch(epoch);
        let limit = self.parameters.epoch_interval_limit;
        self.pacing.opened(self.now, limit);
    }

    /// Asks the ports to undock from these modules, unless they already work on a link to them.
    pub fn undock(&mut self, links: impl IntoIterator<Item = ModuleId>) {
        for link in links {
            if self.body.ports_busy.insert(link) {
                self.outbox.push(Output::Undock(link));
            }
        }
    }

    /// The links that are not to be kept.
    pub fn links_except(&self, is_kept: impl Fn(ModuleId) -> bool) -> BTreeSet<ModuleId> {
        let links = self.body.links.iter().copied();
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
    /// Everything that the behaviour of one run depends on. Times are compared with the time of the search itself.
    fn hash<H: Hasher>(&self, state: &mut H) {
        let Self {
            now: _,
            own,
            parameters: _,
            bugs: _,
            body,
            peers,
            target,
            memory,
            pacing,
            shortfall,
            outbox,
        } = self;
        (own.run, body, peers, target).hash(state);
        (memory, pacing, shortfall, outbox).hash(state);
    }
}
