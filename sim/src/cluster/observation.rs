//! What an observer sees of a cluster.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation::model::{
    Digest, Epoch, Incarnation, Message, ModuleId, ModulePhase, Pose, SpotId, TargetAnnouncement,
};
use formation::protocol::{Agent, Event};

use super::Cluster;
use crate::faults::Strike;
use crate::network::Participant;

/// What an observer that sees into every module knows of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Standing {
    /// What it is doing.
    pub phase: ModulePhase,
    /// The epoch in which it is.
    pub epoch: Option<Epoch>,
    /// The digest of its plan.
    pub digest: Option<Digest>,
    /// The spot that its plan gives it.
    pub spot: Option<SpotId>,
    /// Whether its drive is on its way.
    pub moving: bool,
    /// Where its drive is.
    pub pose: Pose,
}

/// Something that happened, for transcripts and checks.
#[derive(Clone, Debug)]
pub enum Observation {
    /// A module published a message.
    Published(ModuleId, Message),
    /// An agent noted an event.
    Noted(ModuleId, Event),
    /// A drive set off or was told to go on, on this plan. Its module may have left the plan by the time this is read.
    SetOff(ModuleId, Option<(Epoch, Digest)>),
    /// The publisher of the target announced this.
    Announced(Arc<TargetAnnouncement>),
    /// A fault struck, or ended.
    Fault(Strike),
}

impl Cluster {
    /// The running modules in groups that can hear each other; the target's publisher is with the first.
    #[must_use]
    pub fn parts(&self) -> Vec<BTreeSet<ModuleId>> {
        let mut parts = vec![BTreeSet::new(); 2];
        for &module in self.processes.keys() {
            let near = self.network.connects(Participant::TargetPublisher, module);
            parts[usize::from(!near)].insert(module);
        }
        parts
    }

    /// Whether the publisher's last word to this run of a module's process was a target.
    #[must_use]
    pub fn knows_target(&self, module: ModuleId) -> bool {
        self.processes
            .get(&module)
            .is_some_and(|process| process.knows_target)
    }

    /// The revision of the publisher's last word to this run of a module's process; 0 before any.
    #[must_use]
    pub fn target_revision(&self, module: ModuleId) -> u64 {
        self.processes
            .get(&module)
            .map_or(0, |process| process.target_revision)
    }

    /// Which run of its process a module is in.
    #[must_use]
    pub fn incarnation(&self, module: ModuleId) -> Option<Incarnation> {
        Some(self.processes.get(&module)?.incarnation)
    }

    /// The modules whose processes run.
    #[must_use]
    pub fn running(&self) -> BTreeSet<ModuleId> {
        self.processes.keys().copied().collect()
    }

    /// The agent of a running module.
    #[must_use]
    pub fn agent(&self, module: ModuleId) -> Option<&Agent> {
        self.processes.get(&module).map(|process| &process.agent)
    }

    /// What a module is doing, if it runs.
    #[must_use]
    pub fn standing(&self, module: ModuleId) -> Option<Standing> {
        let process = self.processes.get(&module)?;
        let agent = &process.agent;
        Some(Standing {
            phase: agent.phase(),
            epoch: agent.epoch(),
            digest: agent.digest(),
            spot: agent
                .plan()
                .and_then(|plan| plan.assignments.get(&module).copied()),
            moving: process.drive.is_moving(),
            pose: process.drive.pose(),
        })
    }

    /// The plan on which a module is on its way; `None` while its drive stands still.
    #[must_use]
    pub fn plan_in_motion(&self, module: ModuleId) -> Option<(Epoch, Digest)> {
        let process = self.processes.get(&module)?;
        process.driven_by.filter(|_| process.drive.is_moving())
    }

    /// How many messages were published so far.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// What happened since this was last asked, with its time.
    pub fn take_observations(&mut self) -> Vec<(Duration, Observation)> {
        std::mem::take(&mut self.observations)
    }

    /// Whether all running modules are in one epoch, hold one plan for it, and have carried it out.
    ///
    /// A spare that came when no spot was open is no member of the roster and holds no plan; it knows the epoch.
    #[must_use]
    pub fn has_formed(&self) -> bool {
        let mut plans = BTreeSet::new();
        for process in self.processes.values() {
            let agent = &process.agent;
            match (agent.phase(), agent.digest()) {
                (ModulePhase::Settled | ModulePhase::Spare, Some(digest)) => {
                    plans.insert((agent.epoch(), digest));
                }
                (ModulePhase::Spare, None) => {}
                _ => return false,
            }
        }
        let epoch = plans.first().and_then(|&(epoch, _)| epoch);
        plans.len() == 1
            && self
                .processes
                .values()
                .all(|process| process.agent.epoch() == epoch)
    }

    pub(super) fn observe(&mut self, observation: Observation) {
        if let Some(transcript) = &mut self.transcript {
            transcript.add(self.now, &observation);
        }
        self.observations.push((self.now, observation));
    }
}
