//! What an observer sees of a cluster.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::{
    Digest, Epoch, ModuleId, ModulePhase, ModuleRun, Pose, SpotId, TargetAnnouncement,
};
use formation_protocol::Agent;

use super::Cluster;
use crate::network::Participant;
use crate::observation::Observation;
use crate::transcript::Transcript;

/// The state of one module, as an observer sees it that can look into every process.
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
    /// Whether its drive moves.
    pub moving: bool,
    /// Where its body is.
    pub pose: Pose,
}

/// What an observer has seen.
#[derive(Default)]
pub(super) struct Record {
    pub(super) observations: Vec<(Duration, Observation)>,
    pub(super) keeps_transcript: bool,
    pub(super) transcript: Transcript,
}

impl Cluster {
    /// The running modules in groups that can reach each other; the target's publisher is with the first.
    #[must_use]
    pub fn parts(&self) -> Vec<BTreeSet<ModuleId>> {
        let mut parts = vec![BTreeSet::new(); 2];
        for &module in self.processes.keys() {
            let near = self
                .transport
                .network
                .connects(Participant::TargetPublisher, module);
            parts[usize::from(!near)].insert(module);
        }
        parts
    }

    /// The last announcement that this run of a module's process received.
    #[must_use]
    pub fn received_announcement(&self, module: ModuleId) -> Option<&TargetAnnouncement> {
        self.processes.get(&module)?.announcement.as_deref()
    }

    /// The run of a module's process, if it is running.
    #[must_use]
    pub fn run_of(&self, module: ModuleId) -> Option<ModuleRun> {
        Some(self.agent(module)?.run())
    }

    /// The run of a module under the number that its process had at the start.
    pub(super) fn process_run_of(&self, module: ModuleId) -> Option<ModuleRun> {
        Some(self.processes.get(&module)?.run)
    }

    /// Whether a module has a store.
    #[must_use]
    pub fn has_store(&self, module: ModuleId) -> bool {
        self.bodies.get(&module).is_some_and(|body| body.has_store)
    }

    /// The modules whose processes are running.
    #[must_use]
    pub fn running(&self) -> BTreeSet<ModuleId> {
        self.processes.keys().copied().collect()
    }

    /// The agent of a running module.
    #[must_use]
    pub fn agent(&self, module: ModuleId) -> Option<&Agent> {
        self.hosting.agent(module)
    }

    /// The modules that a module is docked to; a body keeps its links when its process ends.
    #[must_use]
    pub fn links(&self, module: ModuleId) -> Option<&BTreeSet<ModuleId>> {
        let body = self.bodies.get(&module).map(|body| &body.links);
        self.agent(module).map(Agent::links).or(body)
    }

    /// The state of a module, if it is running.
    #[must_use]
    pub fn standing(&self, module: ModuleId) -> Option<Standing> {
        let process = self.processes.get(&module)?;
        let agent = self.agent(module)?;
        Some(Standing {
            phase: agent.phase(),
            epoch: agent.epoch(),
            digest: agent.digest(),
            spot: agent
                .plan()
                .and_then(|plan| plan.assignments.get(&module).copied()),
            moving: process.drive.is_moving(),
            pose: process.body(),
        })
    }

    /// All modules, whether or not their processes run.
    #[must_use]
    pub fn modules(&self) -> BTreeSet<ModuleId> {
        self.bodies.keys().copied().collect()
    }

    /// The modules of which a run received a state, or knew from its store.
    #[must_use]
    pub fn seen_by(&self, run: ModuleRun) -> BTreeSet<ModuleId> {
        let process = self.renumbered.get(&run).unwrap_or(&run);
        self.sightings.get(process).cloned().unwrap_or_default()
    }

    /// Where a module's body is: where its drive is, or where its last process left it. `None` once it was taken away.
    #[must_use]
    pub fn body(&self, module: ModuleId) -> Option<Pose> {
        if let Some(process) = self.processes.get(&module) {
            return Some(process.body());
        }
        let body = self.bodies.get(&module)?;
        (!self.taken_away.contains(&module)).then_some(body.pose)
    }

    /// Whether a module's drive moves.
    #[must_use]
    pub fn is_moving(&self, module: ModuleId) -> bool {
        let process = self.processes.get(&module);
        process.is_some_and(|process| process.drive.is_moving())
    }

    /// Whether a module's driver fell silent on its way, so that its agent never knows that it stands.
    #[must_use]
    pub fn is_lost(&self, module: ModuleId) -> bool {
        let process = self.processes.get(&module);
        process.is_some_and(|process| process.is_lost)
    }

    /// The plan on which a module moves; `None` while its drive or its machine stands still, or only moves on after its last goal.
    #[must_use]
    pub fn plan_in_motion(&self, module: ModuleId) -> Option<(Epoch, Digest)> {
        let process = self.processes.get(&module)?;
        let goes_on = process.drive.is_moving() && !process.clock.stands_still_at(self.now());
        let is_driven = goes_on && !process.is_coasting;
        process.driven_by.filter(|_| is_driven)
    }

    /// Whether a module's machine was suspended, and no heartbeat has come that shows it. Heartbeats that waited for it show nothing;
    /// without any others it moves on for a lease at most.
    pub(crate) fn has_just_woken(&self, module: ModuleId) -> bool {
        let process = self.processes.get(&module);
        let limit = self.parameters.agent.lease + self.parameters.agent.heartbeat;
        process
            .and_then(|process| process.suspension)
            .is_some_and(|last| !last.is_shown && self.now() <= last.until + limit)
    }

    /// The plan of the last goal that a running module's drive received.
    #[must_use]
    pub fn last_plan_in_motion(&self, module: ModuleId) -> Option<(Epoch, Digest)> {
        self.processes.get(&module)?.driven_by
    }

    /// The number of messages published so far.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.transport.samples
    }

    /// The observations since the last call, with their times.
    pub fn take_observations(&mut self) -> Vec<(Duration, Observation)> {
        std::mem::take(&mut self.record.observations)
    }

    /// Whether all running modules are in one epoch, hold one plan for it, and have carried it out.
    ///
    /// A spare that came when no spot was open is no member of the roster and holds no plan; it knows the epoch.
    #[must_use]
    pub fn has_formed(&self) -> bool {
        let mut plans = BTreeSet::new();
        let agents = || self.processes.keys().filter_map(|&one| self.agent(one));
        for agent in agents() {
            match (agent.phase(), agent.digest()) {
                (ModulePhase::Settled | ModulePhase::Spare, Some(digest)) => {
                    plans.insert((agent.epoch(), digest));
                }
                (ModulePhase::Spare, None) => {}
                _ => return false,
            }
        }
        let epoch = plans.first().and_then(|&(epoch, _)| epoch);
        plans.len() == 1 && agents().all(|agent| agent.epoch() == epoch)
    }

    pub(super) fn observe(&mut self, observation: Observation) {
        let now = self.now();
        if self.record.keeps_transcript {
            self.record.transcript.add(now, &observation);
        }
        self.record.observations.push((now, observation));
    }
}
