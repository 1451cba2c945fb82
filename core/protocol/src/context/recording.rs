//! Recording what is received: once a process, for all modules that it hosts.

use std::sync::Arc;

use formation_model::{Heartbeat, ModuleState, SourceId};

use crate::context::Context;
use crate::peers::{Heard, Seen};
use crate::refusal::Refusal;

impl Context {
    /// Records a heartbeat.
    /// Enforces Q4.
    pub fn record_heartbeat(&mut self, source: Option<SourceId>, heartbeat: Heartbeat) -> Heard {
        let liveness = self.liveness();
        let mut heard = Heard::of(&heartbeat);
        let module = heard.run.module;
        let has_other_voters = self.session.has_others(heartbeat.voters);
        let peers = self.peers.table_mut();
        if has_other_voters {
            peers.note_other_voters(module);
            heard.news = Err(Refusal::OtherVoters);
            return heard;
        }
        heard.news = peers.handle_heartbeat(liveness, heartbeat, source);
        if matches!(heard.news, Ok(_) | Err(Refusal::DuplicateModule)) {
            heard.gain = peers.gain_of(module, liveness.now);
        }
        heard
    }

    /// Records a state.
    pub fn record_state(&mut self, source: Option<SourceId>, state: Arc<ModuleState>) -> Seen {
        let liveness = self.liveness();
        let mut seen = Seen::of(&state);
        seen.news = (self.peers.table_mut()).handle_state(liveness, state, source);
        seen
    }

    /// Records that a participant has left the graph. Returns whether it sent for any module.
    pub fn record_departure(&mut self, source: SourceId) -> bool {
        let now = self.now;
        self.peers.table_mut().depart(now, source)
    }
}
