//! What a module has missed that is added to a running process: the transport delivers nothing to that process twice.

use std::sync::Arc;
use std::time::Duration;

use formation_model::{Message, RosterMessage, SourceId};

use super::Agent;
use super::peers::{Heard, Seen};

impl Agent {
    /// What this module has received of latched topics that concern all modules: the target, and the roster of its epoch. Each comes with
    /// its sender, as far as that is known.
    pub(super) fn latched(&self) -> Vec<(Option<SourceId>, Message)> {
        let context = &self.context;
        let target = context.target.announcement().into_iter();
        let roster = self.stage.roster().map(|roster| {
            let convener = context.peers.get(roster.epoch.convener);
            let source = convener.and_then(|convener| convener.source);
            let plan = RosterMessage::Plan(Arc::clone(roster));
            (source, Message::Roster(plan))
        });
        target
            .map(|target| (None, Message::Target(Arc::clone(target))))
            .chain(roster)
            .collect()
    }

    /// Takes note of latched messages and of all peers, of which the process knows already.
    pub(super) fn catch_up(&mut self, now: Duration, latched: Vec<(Option<SourceId>, Message)>) {
        self.begin_input(now);
        let (mut seen, mut heard) = (Vec::new(), Vec::new());
        for peer in self.context.peers.all() {
            seen.extend(peer.state.as_ref().map(Seen::of));
            heard.extend(peer.heartbeat.as_ref().map(Heard::of));
        }
        let mut may_change_what_is_due = false;
        for seen in seen {
            may_change_what_is_due |= self.note_seen(&seen);
        }
        for heard in heard {
            may_change_what_is_due |= self.note_heartbeat(heard);
        }
        for (source, message) in latched {
            may_change_what_is_due |= self.handle_message(source, message);
        }
        self.end_input(may_change_what_is_due);
    }
}
