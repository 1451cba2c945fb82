//! What a module has missed that is started beside others in one process: the transport brings that process nothing twice.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::model::{Message, ModuleId, ModuleState, RosterMessage, Service};

use super::Agent;
use super::io::SourceId;
use super::peers::Peer;

impl Agent {
    /// The same agent, in or out of service from its start.
    #[must_use]
    pub fn in_service(mut self, service: Service) -> Self {
        self.service = service;
        self
    }

    /// The other modules that live, as far as this one has heard, and the latest that each said of itself.
    #[must_use]
    pub fn living_peers(&self) -> BTreeMap<ModuleId, Option<&Arc<ModuleState>>> {
        self.peers
            .live(self.now, self.parameters.suspicion)
            .into_iter()
            .filter_map(|module| Some((module, self.peers.get(module)?.state.as_ref())))
            .collect()
    }

    /// What a module that starts now would be told first, were it a process of its own: the target, what every living module
    /// but this one says of itself, and the roster of this module's epoch. Each with its sender, as far as that is known.
    #[must_use]
    pub fn briefing(&self) -> Vec<(Option<SourceId>, Message)> {
        let target = self.announcement.iter().cloned().map(Message::Target);
        let living = self.peers.live(self.now, self.parameters.suspicion);
        let states = self.peers.iter().filter_map(|(module, peer)| {
            if !living.contains(&module) {
                return None;
            }
            let state = Arc::clone(peer.state.as_ref()?);
            Some((peer.source(), Message::ModuleState(state)))
        });
        let roster = self.roster().map(|roster| {
            let convener = self.peers.get(roster.epoch.convener);
            let source = convener.and_then(Peer::source);
            let plan = RosterMessage::Plan(Arc::clone(roster));
            (source, Message::Roster(plan))
        });
        target
            .map(|target| (None, target))
            .chain(states)
            .chain(roster)
            .collect()
    }
}
