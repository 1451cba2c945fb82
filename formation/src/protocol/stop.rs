//! Stopping all modules on command, until they are resumed.
//!
//! The latest command is a register: the highest revision applies. Every heartbeat carries it, so it reaches whatever module
//! receives another one that knows it, outlives the process that gave it, and holds through restarts and new epochs. While
//! it says to stop, epochs are opened and plans are made as ever, and no module moves. A module that receives no heartbeat
//! of a member halts within the lease in any case.

use crate::model::{Removal, Stop};

use super::Agent;
use super::event::Event;
use super::refusal::Refusal;

impl Agent {
    /// Takes over a command to stop or to resume, if it is the latest.
    pub(super) fn handle_stop(&mut self, stop: Stop) {
        let context = &mut self.context;
        let known = context.stop;
        if stop <= known {
            return;
        }
        if !context.is_plausible(stop.revision) {
            return context.refuse(None, Refusal::ImplausibleStop);
        }
        context.stop = stop;
        match (known.stopped, stop.stopped) {
            (false, true) => {
                context.stand_still();
                context.emit(Event::Stopped);
            }
            (true, false) => context.emit(Event::Resumed),
            _ => {}
        }
    }

    /// Handles the report that a body was taken away.
    pub(super) fn handle_removal_report(&mut self, removal: Removal) {
        let run = match removal.incarnation {
            Some(incarnation) => Some(removal.module.run(incarnation)),
            // No run of this module is later than its own, which is not gone.
            None => self.latest_run_of(removal.module),
        };
        match run {
            Some(run) => self.handle_removal(run),
            None => self
                .context
                .refuse(Some(removal.module), Refusal::UnknownModule),
        }
    }
}
