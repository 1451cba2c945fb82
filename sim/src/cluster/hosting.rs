//! Processes of several modules: their agents share a replica, a clock, and what is sent to them.

use std::collections::BTreeMap;

use formation_model::{Message, ModuleId, RosterMessage, SourceId};
use formation_protocol::{Agent, Arrived, Replica};

use super::Cluster;
use crate::network::Participant;

/// Which modules share a process. The lowest one, its first, stands for it.
#[derive(Default)]
pub(super) struct Hosting {
    /// The modules of each process of several, in ascending order.
    shared: BTreeMap<ModuleId, Vec<ModuleId>>,
    /// The first module of the process of each of these.
    first: BTreeMap<ModuleId, ModuleId>,
    /// What runs, by the first module.
    pub(super) replicas: BTreeMap<ModuleId, Replica>,
}

impl Hosting {
    /// The first module of a module's process.
    pub(super) fn first(&self, module: ModuleId) -> ModuleId {
        self.first.get(&module).copied().unwrap_or(module)
    }

    /// All modules of a module's process.
    pub(super) fn together(&self, module: ModuleId) -> Vec<ModuleId> {
        let shared = self.shared.get(&self.first(module));
        shared.cloned().unwrap_or_else(|| vec![module])
    }

    /// The place of a module among those of its process.
    fn index(&self, module: ModuleId) -> usize {
        let shared = self.shared.get(&self.first(module));
        let index = shared.and_then(|shared| shared.iter().position(|&one| one == module));
        index.unwrap_or_default()
    }

    /// The agent of a running module.
    pub(super) fn agent(&self, module: ModuleId) -> Option<&Agent> {
        let replica = self.replicas.get(&self.first(module))?;
        replica.agents().get(self.index(module))
    }

    /// Lets the agent of a running module act, or asks it.
    pub(super) fn with_agent<R>(
        &mut self,
        module: ModuleId,
        act: impl FnOnce(&mut Agent) -> R,
    ) -> Option<R> {
        let index = self.index(module);
        let replica = self.replicas.get_mut(&self.first(module))?;
        Some(replica.with(index, act))
    }
}

impl Cluster {
    /// Lets modules share a process. To be called before the first step.
    pub fn host_together(&mut self, modules: &[ModuleId]) {
        let mut modules = modules.to_vec();
        modules.sort_unstable();
        if let [first, _, ..] = modules[..] {
            let of = modules.iter().map(|&module| (module, first));
            self.hosting.first.extend(of);
            self.hosting.shared.insert(first, modules);
        }
    }

    /// A message that came to the process of a module.
    pub(super) fn received(
        &self,
        module: ModuleId,
        source: Option<SourceId>,
        message: Message,
    ) -> Arrived {
        let first = self.hosting.first(module);
        let is_own = source.is_some() && source == self.source(Participant::Module(first));
        let author = author_of(&message).filter(|&author| self.hosting.first(author) == first);
        Arrived {
            source,
            sender: (author.filter(|_| is_own)).map(|author| self.hosting.index(author)),
            message,
        }
    }
}

/// The module that a message names as its sender.
fn author_of(message: &Message) -> Option<ModuleId> {
    match message {
        Message::ModuleState(state) => Some(state.module),
        Message::Heartbeat(heartbeat) => Some(heartbeat.module),
        Message::Claim(claim) => Some(claim.claimant),
        Message::Roster(RosterMessage::Gather { epoch, .. }) => Some(epoch.convener),
        Message::Roster(RosterMessage::Plan(roster)) => Some(roster.epoch.convener),
        Message::Eviction(_)
        | Message::Target(_)
        | Message::OtherSessionState(_)
        | Message::Stop(_)
        | Message::Removal(_) => None,
    }
}
