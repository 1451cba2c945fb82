//! What a module has missed that is added to a running process: the transport delivers nothing to that process twice.

use std::collections::BTreeMap;
use std::sync::Arc;

use formation_model::{Message, ModuleId, ModuleState, RosterMessage, SourceId};

use super::Agent;

impl Agent {
    /// The other live modules and the latest state of each.
    #[must_use]
    pub fn living_peers(&self) -> BTreeMap<ModuleId, Option<&Arc<ModuleState>>> {
        let live = self.context.peers.live(self.context.liveness());
        live.map(|(module, peer)| (module, peer.state.as_ref()))
            .collect()
    }

    /// The messages that a new process would receive from latched topics: the target, the state of every live module but
    /// this one, and the roster of this module's epoch. Each comes with its sender, as far as that is known.
    /// Enforces C5.
    #[must_use]
    pub fn latched_snapshot(&self) -> Vec<(Option<SourceId>, Message)> {
        let context = &self.context;
        let target = context.target.announcement().into_iter();
        let states = context
            .peers
            .live(context.liveness())
            .filter_map(|(_, peer)| {
                let state = Arc::clone(peer.state.as_ref()?);
                Some((peer.source, Message::ModuleState(state)))
            });
        let roster = self.stage.roster().map(|roster| {
            let convener = context.peers.get(roster.epoch.convener);
            let source = convener.and_then(|convener| convener.source);
            let plan = RosterMessage::Plan(Arc::clone(roster));
            (source, Message::Roster(plan))
        });
        target
            .map(|target| (None, Message::Target(Arc::clone(target))))
            .chain(states)
            .chain(roster)
            .collect()
    }
}
