//! Two processes under one module identifier: which of them takes part.
//!
//! The process that started later stands back until the earlier has been silent for `suspicion`. If the earlier had been
//! silent for that long already, the other modules have let the later one take its place, and accept only that. An earlier
//! process that continues after having been stopped then stands back itself.
//!
//! If nothing is received from the later run meanwhile, it has ended, and a clock that was set back made this one the earlier. It
//! then takes a number above that of the former run, as in Lamport's logical clocks, so that the numbers of a module's runs
//! ascend for all who know of them.

use std::time::Duration;

use formation_model::{BodyReport, Incarnation, ModuleRun};

use super::Agent;
use super::context::Own;
use super::event::Event;
use super::refusal::Refusal;

/// Fibonacci hashing (Knuth, The Art of Computer Programming 3, section 6.4): 2^64 divided by the golden ratio.
const SCATTERING: u64 = 0x9e37_79b9_7f4a_7c15;

/// All but 20 bits, so that a number rises by a second at most.
const SCATTERED_BITS_UNUSED: u32 = 44;

/// What a process knows of other processes that run as the same module.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct Succession {
    /// Until when this process stands back because another one runs as its module.
    standing_back_until: Option<Duration>,
    /// The later run of this module by which the others have replaced this one.
    succeeded_by: Option<Incarnation>,
    /// The number that this run is to exceed once it has stood back.
    to_exceed: Option<Incarnation>,
    /// The run of a duplicate, of this or another module, that was last reported.
    reported: Option<Incarnation>,
}

impl Succession {
    /// Whether this process stands back at present.
    pub fn is_standing_back(&self) -> bool {
        self.standing_back_until.is_some()
    }

    /// Stands back until a time.
    /// Enforces M4.
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

    /// The number that a run takes which has stood back for a later one that did not send, if this is one. Another run of the module may
    /// have taken, or will take, a number above the same later one, so that what is added depends on the start of this one.
    fn take_number_above(&mut self, own: Own) -> Option<Incarnation> {
        let former = self.to_exceed.take()?;
        let scattered = own.start_stamp.wrapping_mul(SCATTERING) >> SCATTERED_BITS_UNUSED;
        let next = former.0.checked_add(1)?.checked_add(scattered)?;
        (former > own.run.incarnation).then_some(Incarnation(next))
    }

    /// Whether this run has to stand back for another; `listened` if it has been running for longer than `suspicion`.
    pub fn yields_to(&self, other: Incarnation, own: Incarnation, listened: bool) -> bool {
        let has_succeeded = listened && !self.is_standing_back();
        let is_succeeded = self.succeeded_by.is_some_and(|later| other >= later);
        (other < own && !has_succeeded) || (other > own && is_succeeded)
    }

    /// Whether a duplicate has not been reported last.
    pub fn is_news(&mut self, duplicate: Incarnation) -> bool {
        self.reported.replace(duplicate) != Some(duplicate)
    }
}

impl Agent {
    /// Another process sends as this module.
    /// Enforces M4.
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
        self.refuse_run(own.run.module.run(incarnation), Refusal::DuplicateModule);
    }

    /// Others report these bodies, which ascend by module; there may be one of another run of this module.
    pub(super) fn note_run_named_in(&mut self, bodies: &[BodyReport]) {
        let own = self.context.module();
        let named = bodies.binary_search_by_key(&own, |body| body.module);
        if let Some(body) = named.ok().and_then(|index| bodies.get(index)) {
            self.note_named_run(body.incarnation);
        }
    }

    /// Peers named a run of this module. If that is later, this one yields to it, and then takes a number above it.
    pub(super) fn note_named_run(&mut self, named: Incarnation) {
        let context = &self.context;
        let is_later = named > context.own.run.incarnation && context.is_plausible(named.0);
        let is_new = self.succession.to_exceed < Some(named);
        if is_later && is_new {
            self.succession.to_exceed = Some(named);
            self.succession.note_successor(named);
            self.stand_back();
        }
    }

    /// Takes a number above that of a later run for which this one stood back, and which has not sent meanwhile.
    /// Enforces M7.
    pub(super) fn exceed_silent_run(&mut self) {
        if let Some(next) = self.succession.take_number_above(self.context.own) {
            self.context.own.run.incarnation = next;
            self.context.mark_state_changed();
            self.context.emit(Event::RunRenumbered(next));
        }
    }

    /// Refuses a message of a run; a duplicate is reported once.
    pub(super) fn refuse_run(&mut self, run: ModuleRun, reason: Refusal) {
        if reason == Refusal::StaleIncarnation {
            self.context.note_run(run);
        }
        if reason != Refusal::DuplicateModule {
            return self.context.refuse(Some(run.module), reason);
        }
        self.context.outbox.refusals.add(reason);
        if self.succession.is_news(run.incarnation) {
            self.context.emit(Event::DuplicateModule(run.module));
        }
    }

    /// Leaves the epoch for `suspicion`, in favour of another process.
    pub(super) fn stand_back(&mut self) {
        let until = self.context.now + self.context.parameters.suspicion;
        self.succession.stand_back(until);
        self.leave_epoch();
    }
}
