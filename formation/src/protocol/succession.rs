//! Two processes under one module identifier: which of them takes part.
//!
//! The process that started later stands back until the earlier has been silent for `suspicion`. If the earlier had been
//! silent for that long already, the other modules have let the later one take its place, and accept only that. An earlier
//! process that continues after having been stopped then stands back itself.

use std::time::Duration;

use crate::model::{Incarnation, ModuleId};

use super::Agent;
use super::event::Event;
use super::refusal::Refusal;

/// What a process knows of other processes that run as the same module.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct Succession {
    /// Until when this process stands back because another one runs as its module.
    standing_back_until: Option<Duration>,
    /// The later run of this module by which the others have replaced this one.
    succeeded_by: Option<Incarnation>,
    /// The run of a duplicate, of this or another module, that was last reported.
    reported: Option<Incarnation>,
}

impl Succession {
    /// Whether this process stands back at present.
    pub fn is_standing_back(&self) -> bool {
        self.standing_back_until.is_some()
    }

    /// Stands back until a time.
    pub fn stand_back(&mut self, until: Duration) {
        self.standing_back_until = Some(until);
    }

    /// Takes part again if the time of standing back is over; returns whether it still stands back.
    pub fn still_stands_back(&mut self, now: Duration) -> bool {
        match self.standing_back_until {
            Some(until) if now < until => return true,
            Some(_) => {
                self.standing_back_until = None;
                self.reported = None;
            }
            None => {}
        }
        false
    }

    /// The others have replaced this run of the module by a later one.
    pub fn note_successor(&mut self, later: Incarnation) {
        self.succeeded_by = self.succeeded_by.max(Some(later));
    }

    /// Whether this run has to stand back for another; `listened` if it has been running for longer than `suspicion`.
    pub fn yields_to(&self, other: Incarnation, own: Incarnation, listened: bool) -> bool {
        let has_succeeded = listened && !self.is_standing_back();
        let is_succeeded = self.succeeded_by.is_some_and(|later| other >= later);
        (other < own && !has_succeeded) || is_succeeded
    }

    /// Whether a duplicate has not been reported last.
    pub fn is_news(&mut self, duplicate: Incarnation) -> bool {
        self.reported.replace(duplicate) != Some(duplicate)
    }
}

impl Agent {
    /// Another process sends as this module.
    pub(super) fn handle_duplicate(&mut self, incarnation: Incarnation) {
        let own = self.context.own;
        if incarnation == own.run.incarnation {
            let module = Some(own.run.module);
            return self.context.refuse(module, Refusal::WrongSource);
        }
        let uptime = self.context.now.saturating_sub(own.started);
        let has_listened = uptime > self.context.parameters.suspicion;
        if self
            .succession
            .yields_to(incarnation, own.run.incarnation, has_listened)
        {
            self.stand_back();
        }
        self.refuse_run(own.run.module, incarnation, Refusal::DuplicateModule);
    }

    /// Refuses a message of a run; a duplicate is reported once.
    pub(super) fn refuse_run(
        &mut self,
        module: ModuleId,
        incarnation: Incarnation,
        reason: Refusal,
    ) {
        if reason != Refusal::DuplicateModule {
            return self.context.refuse(Some(module), reason);
        }
        self.context.outbox.refusals.add(reason);
        if self.succession.is_news(incarnation) {
            self.context.emit(Event::DuplicateModule(module));
        }
    }

    /// Leaves the epoch for `suspicion`, in favour of another process.
    pub(super) fn stand_back(&mut self) {
        let until = self.context.now + self.context.parameters.suspicion;
        self.succession.stand_back(until);
        self.leave_epoch();
    }
}
