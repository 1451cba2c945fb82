//! What a module must not forget when its process ends, and when it must be in the store.
//!
//! The rule is that of a write-ahead log: whatever an agent publishes or does as a result of an input leaves the agent only
//! after its store holds what the result depends on (compare the `HardState` of raft). So the module never denies, after a
//! restart, an epoch that it entered, a digest that it showed, or a retirement that it confirmed, and a simulated module stands
//! where the others last saw it stand, docked to the same modules. Halting needs no store, and heartbeats go on meanwhile: they
//! repeat what was shown before.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::model::{
    BodyReport, Digest, Epoch, ModuleId, Pose, QuorumBasis, RETENTION_DISTANCE, Service, SpotId,
    Stop,
};

use super::Agent;
use super::body::SettledOn;
use super::event::Event;
use super::stage::Stage;

/// What the store of a module holds.
///
/// What grows with the number of modules (founders, quorum bases, bodies) is the same for most modules of a process. A host keeps it
/// once for all of them, so it is not serialised here.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DurableState {
    /// The latest epoch that it entered.
    pub entered: Option<Epoch>,
    /// The highest epoch that it knows of.
    pub highest: Option<Epoch>,
    /// The founders of the session; empty while they are not named.
    #[serde(skip)]
    pub founders: Vec<ModuleId>,
    /// The earlier rosters of which a new one must contain a majority.
    #[serde(skip)]
    pub quorum_bases: Vec<QuorumBasis>,
    /// Whether it takes part in plans.
    pub service: Service,
    /// The spot on which it has settled, and the digest of the target of that spot.
    pub settled_on: Option<(SpotId, Digest)>,
    /// Its pose when this was written.
    pub pose: Pose,
    /// The modules that it was docked to then.
    pub links: BTreeSet<ModuleId>,
    /// Where the bodies of other modules may be, and which were removed; ascending by module.
    #[serde(skip)]
    pub bodies: Arc<[BodyReport]>,
    /// The latest command to stop or to resume.
    pub stop: Stop,
}

/// The part of a durable state without which nothing may be published.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct SyncKey {
    entered: Option<Epoch>,
    shows_digest: bool,
    service: Service,
    settled_on: Option<SettledOn>,
    /// Where the module stands; `None` on its way.
    stands_at: Option<Pose>,
    links: BTreeSet<ModuleId>,
    /// Identifies the removals that are known. The bodies are written with the rest: before a plan is shown in which they count.
    removals: u64,
    stop: Stop,
}

/// The part of a key on which the bodies in a durable state depend.
#[derive(Clone, Debug, PartialEq, Eq)]
struct BodiesKey {
    entered: Option<Epoch>,
    shows_digest: bool,
    service: Service,
    settled_on: Option<SettledOn>,
    removals: u64,
}

/// The bodies that were given to the store last.
#[derive(Clone, Debug)]
pub(super) struct StoredBodies {
    key: BodiesKey,
    bodies: Arc<[BodyReport]>,
}

impl SyncKey {
    fn of_bodies(&self) -> BodiesKey {
        BodiesKey {
            entered: self.entered,
            shows_digest: self.shows_digest,
            service: self.service,
            settled_on: self.settled_on,
            removals: self.removals,
        }
    }

    /// Whether a plan for this epoch is shown.
    pub fn shows_plan_of(&self, epoch: Epoch) -> bool {
        self.shows_digest && self.entered == Some(epoch)
    }
}

impl Agent {
    /// The same agent with a store, which holds what an earlier run wrote, if any did.
    ///
    /// A pin is kept only if the module still stands where it stood: a robot may have been moved while it was off.
    #[must_use]
    pub fn restored(mut self, stored: Option<DurableState>) -> Self {
        debug_assert!(self.context.own.store.is_some(), "only a store restores");
        let Some(stored) = stored else {
            return self;
        };
        let context = &mut self.context;
        let memory = &mut context.memory;
        for epoch in [stored.entered, stored.highest].into_iter().flatten() {
            memory.restore_epoch(epoch);
        }
        memory.founders = stored.founders;
        memory.quorum.learn(&stored.quorum_bases);
        context.body.service = stored.service;
        let has_stayed = context.body.pose.distance_to(&stored.pose) <= RETENTION_DISTANCE;
        let is_as_stored = context.body.pose == stored.pose && context.body.links == stored.links;
        context.body.settled_on = stored
            .settled_on
            .filter(|_| has_stayed)
            .map(|(spot, target)| SettledOn { spot, target });
        context.stop = stored.stop;
        if context.stop.stopped {
            context.emit(Event::Stopped);
        }
        self.restore_bodies(&stored.bodies);
        self.stage = Stage::Listening(stored.entered);
        if is_as_stored {
            self.context.outbox.durable.given = Some(self.sync_key());
        }
        self
    }

    /// What the store has to hold now.
    ///
    /// The bodies say where other modules may be until this module acts on another plan. That holds for each later write before
    /// that as well, so they are found again only for what changes it, and not whenever this module sets off or stops: with a
    /// thousand modules that would be most of the work of a process.
    fn durable_state(&mut self, key: &SyncKey) -> DurableState {
        let key = key.of_bodies();
        let stored = self.context.outbox.durable.bodies.take();
        let stored = stored
            .filter(|stored| stored.key == key)
            .unwrap_or_else(|| StoredBodies {
                bodies: self.bodies_to_store().into(),
                key,
            });
        let bodies = Arc::clone(&stored.bodies);
        self.context.outbox.durable.bodies = Some(stored);
        let context = &self.context;
        DurableState {
            entered: self.stage.epoch(),
            highest: context.memory.highest_epoch(),
            founders: context.memory.founders.clone(),
            quorum_bases: context.memory.quorum.bases(),
            service: context.body.service,
            // A module that sets off leaves its spot once this is stored.
            settled_on: context
                .body
                .settled_on
                .filter(|_| !context.body.moving)
                .map(|settled| (settled.spot, settled.target)),
            pose: context.body.pose,
            links: context.body.links.clone(),
            bodies,
            stop: context.stop,
        }
    }

    pub(super) fn sync_key(&self) -> SyncKey {
        let body = &self.context.body;
        SyncKey {
            entered: self.stage.epoch(),
            shows_digest: self.stage.held_plan().is_some(),
            service: body.service,
            settled_on: body.settled_on,
            stands_at: (!body.moving).then_some(body.pose),
            links: body.links.clone(),
            removals: self.context.bodies.removals(),
            stop: self.context.stop,
        }
    }

    /// Lets the outputs of the input that was handled wait for the store, if they depend on something new.
    pub(super) fn write_ahead(&mut self) {
        if self.context.own.store.is_none() {
            return;
        }
        let key = self.sync_key();
        let is_new = self.context.outbox.durable.given.as_ref() != Some(&key);
        let state = is_new.then(|| self.durable_state(&key));
        self.context.outbox.write_ahead(key, state);
    }
}
