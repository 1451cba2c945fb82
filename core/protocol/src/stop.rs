//! Stopping all modules on command, until they are resumed.
//!
//! The latest command is a register: the highest revision applies. Every heartbeat carries it, so it reaches whatever module
//! receives another one that knows it, outlives the process that gave it, and holds through restarts and new epochs. While
//! it says to stop, epochs are opened and plans are made as ever, and no module moves. A module that receives no heartbeat
//! of a member halts within the lease in any case.

use formation_model::Stop;

use super::Agent;
use super::event::Event;
use super::refusal::Refusal;

impl Agent {
    /// Takes over a command to stop or to resume, if it is the latest.
    /// Enforces H1.
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
}
