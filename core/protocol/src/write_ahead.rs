//! Giving an agent's state to its store, and continuing from what the store holds.

use std::sync::Arc;

use formation_model::RETENTION_DISTANCE;

use super::Agent;
use super::durable::{DurableState, StoredBodies, SyncKey};
use super::event::Event;
use super::robot::SettledOn;
use super::stage::Stage;

impl Agent {
    /// The same agent with a store, which holds what an earlier run wrote, if any did; or with the memory of an earlier run of
    /// the same process.
    ///
    /// A pin is kept only if the module still stands where it stood: a robot may have been moved while it was off.
    /// Enforces Q9, H2.
    #[must_use]
    pub fn restored(mut self, stored: Option<DurableState>) -> Self {
        let Some(stored) = stored else {
            return self;
        };
        let context = &mut self.context;
        let idle_from = context.own.started + context.parameters.idle_age();
        let session = &mut context.session;
        for epoch in [stored.entered, stored.highest].into_iter().flatten() {
            session.note_epoch(epoch);
        }
        session.is_first_run = false;
        session.shown.forget_until(idle_from);
        session.was_in_force = stored.knows;
        session.restore_voters(&stored.voters);
        context.robot.service = stored.service;
        let has_stayed = context.robot.pose.distance_to(&stored.pose) <= RETENTION_DISTANCE;
        let is_as_stored = context.robot.pose == stored.pose && context.robot.links == stored.links;
        context.robot.settled_on = stored
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

    /// What a later run of the same process goes on from.
    #[must_use]
    pub fn memory(&mut self) -> DurableState {
        let key = self.sync_key();
        self.durable_state(&key)
    }

    /// What the store has to hold now.
    ///
    /// The bodies say where other modules may be until this module acts on another plan. That holds for each later write before
    /// that as well, so they are found again only for what changes it, and when nobody is on the way any more. With a thousand
    /// modules to do so whenever this module sets off or stops would be most of the work of a process.
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
            highest: context.session.highest_epoch(),
            knows: context.session.knows(),
            voters: context.session.voters().clone(),
            service: context.robot.lasting_service(),
            // A module that sets off leaves its spot once this is stored.
            settled_on: context
                .robot
                .settled_on
                .filter(|_| !context.robot.moving)
                .map(|settled| (settled.spot, settled.target)),
            pose: context.robot.pose,
            links: context.robot.links.clone(),
            bodies,
            stop: context.stop,
        }
    }

    pub(super) fn sync_key(&mut self) -> SyncKey {
        let is_carried_out = self.stage.is_carried_out(&self.context);
        let body = &self.context.robot;
        SyncKey {
            incarnation: self.context.own.run.incarnation,
            entered: self.stage.epoch(),
            shows_digest: self.stage.held_plan().is_some(),
            knows: self.context.session.knows(),
            votes_removed: self.context.session.votes_removed(),
            service: body.lasting_service(),
            settled_on: body.settled_on,
            stands_at: (!body.moving).then_some(body.pose),
            links: body.links.clone(),
            is_carried_out,
            removals: self.context.bodies.removals(),
            stop: self.context.stop,
        }
    }

    /// Lets the outputs of the input that was handled wait for the store, if they depend on something new.
    pub(super) fn write_ahead(&mut self) {
        if !self.context.outbox.has_store {
            return;
        }
        let key = self.sync_key();
        let is_new = self.context.outbox.durable.given.as_ref() != Some(&key);
        let state = is_new.then(|| self.durable_state(&key));
        self.context.outbox.write_ahead(key, state);
    }
}
