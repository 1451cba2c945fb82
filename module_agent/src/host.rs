//! The modules that one process hosts: their agents, their drives, and what they publish together.

mod events;
mod pushes;
mod removals;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    DockingAction, EvictionNotice, Heartbeat, Message, ModuleId, ModulePhase, ModuleState, Pose,
    RosterMessage, Service, SourceId, SpotClaim,
};
use formation_motion::DriveCommand;
use formation_node_support::{stamp, topics};
use formation_protocol::{
    Agent, AgentParameters, Arrived, Command, ComputedPlan, DurableState, Identity, Input, Output,
    PlanJob, RefusalCounts, Replica,
};
use ros_runtime::diagnostics::Report;

use crate::arguments::{DriveMode, Motion};
use crate::drive::Drive;
use crate::drivers::DriverMessage;
use crate::journal::{Journal, KeptMemory, WriteJob};
use crate::module_diagnostics::ModuleDiagnostics;
use pushes::Pushes;
pub(crate) use removals::REMOVE_MODULE;

/// What the process has to publish.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Outgoing {
    /// Latest states of hosted modules: those that are new, or all.
    ModuleStates(Vec<Arc<ModuleState>>),
    /// The heartbeats that fell due together, at most one a module.
    Heartbeats(Vec<Heartbeat>),
    /// What a convener announces.
    Roster(RosterMessage),
    /// A unit's decision.
    Claim(Arc<SpotClaim>),
    /// An eviction, for observers.
    Eviction(EvictionNotice),
    /// The poses that a module's driver is to pass.
    Path(ModuleId, Vec<Pose>),
    /// A command for a module's driver.
    Drive(ModuleId, DriveCommand),
}

/// One hosted module.
struct Hosted {
    identity: Identity,
    drive: Drive,
    /// The path that its driver knows.
    path: Vec<Pose>,
    /// The state that the next sample will carry for this module.
    state: Option<Arc<ModuleState>>,
    /// Whether no sample carried that state yet.
    state_is_new: bool,
    heartbeat: Option<Heartbeat>,
    /// How many refusals the agent reported as events.
    refusals: u64,
    /// How many messages of a second process with the same identifier it reported.
    duplicates: u64,
    /// How often it doubted its clock.
    clock_doubts: u64,
    /// The number of events about reports that bodies were taken away.
    removals: BTreeMap<ModuleId, u64>,
    diagnostics: ModuleDiagnostics,
}

/// The agents of a process; what they publish is gathered into as few samples as possible.
pub(crate) struct Host {
    source: SourceId,
    parameters: AgentParameters,
    motion: Motion,
    /// The voters of the session; empty if a target is to name them.
    voters: Vec<ModuleId>,
    /// How many modules can be hosted.
    room: usize,
    modules: Vec<Hosted>,
    /// The agents of these modules, by the same index.
    replica: Replica,
    /// `None` if what the modules agree on ends with the process.
    journal: Option<Journal>,
    /// Messages from other processes, and from hosted modules to each other, until the modules handle them together.
    arrived: Vec<Arrived>,
    outgoing: Vec<Outgoing>,
    /// The time, as it was last told.
    now: Duration,
    /// When a sample of all states is due, as the last one, which a late subscriber gets, lists only those that were new.
    all_states_due: Option<Duration>,
    /// For how long the clock stood still, if the modules have found that it did: new runs are to begin.
    stood_still: Option<Duration>,
    pushes: Pushes,
    /// What only observers need, until no hosted module plans: others wait for the claims.
    evictions: Vec<EvictionNotice>,
}

impl Host {
    /// Hosts an agent for each module, started at time zero in or out of service, for which `source` publishes. Each continues from what
    /// `memory` has of it.
    pub(crate) fn new(
        source: SourceId,
        modules: impl IntoIterator<Item = (Identity, Service)>,
        parameters: AgentParameters,
        motion: &Motion,
        voters: &[ModuleId],
        memory: KeptMemory,
    ) -> Self {
        let (journal, mut earlier) = match memory {
            KeptMemory::File(journal) => (Some(journal), BTreeMap::new()),
            KeptMemory::Process(earlier) => (None, earlier),
        };
        let mut host = Self {
            source,
            parameters,
            motion: motion.clone(),
            voters: voters.to_vec(),
            room: 0,
            modules: Vec::new(),
            replica: Replica::default(),
            journal,
            arrived: Vec::new(),
            outgoing: Vec::new(),
            now: Duration::ZERO,
            all_states_due: None,
            stood_still: None,
            pushes: Pushes::default(),
            evictions: Vec::new(),
        };
        for (identity, service) in modules {
            let earlier = earlier.remove(&identity.module);
            host.push(Duration::ZERO, identity, service, earlier);
        }
        host.room = topics::room_for_modules(host.modules.len());
        host
    }

    fn push(
        &mut self,
        now: Duration,
        identity: Identity,
        service: Service,
        earlier: Option<DurableState>,
    ) {
        let mut agent = Agent::new(identity.clone(), self.parameters, now)
            .in_service(service)
            .with_position_tolerance(self.motion.external.position_tolerance)
            .with_deviation_limit(self.motion.deviation_limit)
            .started_at(stamp::incarnation().0)
            .published_by(self.source)
            .with_voters(&self.voters)
            .with_plans_of_host()
            .with_shared_samples();
        let journal = self.journal.as_ref();
        let stored = journal.and_then(|journal| journal.state_of(identity.module));
        agent = agent.restored(stored.or(earlier));
        self.replica.add(now, agent);
        self.modules.push(Hosted {
            drive: Drive::new(&identity, &self.motion, self.parameters.lease),
            identity,
            path: Vec::new(),
            state: None,
            state_is_new: false,
            heartbeat: None,
            refusals: 0,
            duplicates: 0,
            clock_doubts: 0,
            removals: BTreeMap::new(),
            diagnostics: ModuleDiagnostics::default(),
        });
    }

    /// Hosts one more module, which gets what the others know of the latched topics.
    ///
    /// # Errors
    /// Says why this process takes no more.
    pub(crate) fn add(&mut self, now: Duration, mut identity: Identity) -> Result<(), String> {
        if self.motion.mode == DriveMode::External {
            return Err(format!(
                "the modules of this process have external drivers, which are set up at its start; start another \
                 process: module_agent --motion external --module {}",
                identity.module.0
            ));
        }
        if self.modules.len() >= self.room {
            return Err(format!(
                "this process keeps the decisions of at most {} modules for late subscribers; start another process",
                self.room
            ));
        }
        if let Some(journal) = &mut self.journal {
            journal.add(&mut identity)?;
        }
        // Alone, a module receives none of its own messages, which the newcomer is to know.
        if let [first] = &self.modules[..] {
            let state = first.state.iter().cloned().map(Message::ModuleState);
            let received = state.map(|message| Arrived {
                source: Some(self.source),
                sender: Some(0),
                message,
            });
            self.arrived.extend(received);
        }
        let index = self.modules.len();
        self.push(now, identity, Service::Active, None);
        self.carry_out(index, now);
        self.pass_reports(index, now);
        Ok(())
    }

    fn index_of(&self, module: ModuleId) -> Option<usize> {
        let mut modules = self.modules.iter();
        modules.position(|hosted| hosted.identity.module == module)
    }

    /// Passes a command to a hosted module.
    pub(crate) fn command(&mut self, now: Duration, module: ModuleId, command: Command) {
        if let Some(index) = self.index_of(module) {
            self.pass(index, now, Input::Command(command));
        }
    }

    /// Whether a hosted module takes a spot when it can, and its phase; `None` for a module that is not hosted.
    pub(crate) fn status_of(&self, module: ModuleId) -> Option<(Service, ModulePhase)> {
        let agent = &self.replica.agents()[self.index_of(module)?];
        Some((agent.service(), agent.phase()))
    }

    /// The hosted modules as they are now, for a host that takes them over.
    pub(crate) fn modules(&self) -> Vec<(Identity, Service)> {
        // A driver goes on for a while without the process.
        let stands = self.motion.mode != DriveMode::External;
        let modules = self.modules.iter().zip(self.replica.agents());
        let modules = modules.map(|(hosted, agent)| {
            let identity = Identity {
                incarnation: agent.run().incarnation,
                pose: agent.pose(),
                links: agent.links().clone(),
                last_plan: agent.last_plan().filter(|_| stands).cloned(),
                ..hosted.identity.clone()
            };
            (identity, agent.service())
        });
        modules.collect()
    }

    /// Takes a message of another process, which the hosted modules handle when time passes.
    pub(crate) fn take_message(&mut self, source: SourceId, message: Message) {
        self.arrived.push(Arrived {
            source: Some(source),
            sender: None,
            message,
        });
    }

    /// A participant has left the graph, after all messages of it that were taken.
    pub(crate) fn handle_departed(&mut self, now: Duration, source: SourceId) {
        self.replica.handle_departed(now, source);
        self.carry_out_all(now);
    }

    /// Passes a message of a driver to its module.
    pub(crate) fn handle_driver(
        &mut self,
        now: Duration,
        module: ModuleId,
        message: DriverMessage,
    ) {
        if let Some(index) = self.index_of(module) {
            self.modules[index].drive.handle_message(now, message);
            self.pass_reports(index, now);
        }
    }

    /// Lets time pass: the messages that have come, drives, and timeouts.
    pub(crate) fn advance(&mut self, now: Duration) {
        self.now = now;
        // What the modules answer to each other waits for the next time, after what the network brings until then.
        let arrived = std::mem::take(&mut self.arrived);
        if !arrived.is_empty() {
            for (index, hosted) in self.modules.iter_mut().enumerate() {
                let others = arrived.iter().filter(|one| one.sender != Some(index));
                hosted.diagnostics.received += u64::try_from(others.count()).unwrap_or(u64::MAX);
            }
            self.replica.handle_messages(now, arrived);
            self.carry_out_all(now);
            self.open_torn_ports(now);
        }
        for index in 0..self.modules.len() {
            if self.modules[index]
                .drive
                .due()
                .is_some_and(|due| due <= now)
            {
                self.modules[index].drive.advance(now);
                self.pass_reports(index, now);
            }
            if self.replica.agents()[index].poll_timeout() <= now {
                self.pass(index, now, Input::Timeout);
            }
        }
    }

    /// The next plan to compute; no other before it is handed in.
    pub(crate) fn next_job(&mut self) -> Option<PlanJob> {
        self.replica.next_job()
    }

    /// Hands in a plan to the modules that wait for it.
    pub(crate) fn handle_computed(&mut self, now: Duration, computed: &Arc<ComputedPlan>) {
        self.replica.handle_computed(now, computed);
        self.carry_out_all(now);
    }

    /// The next contents of the store to write; no others before they are written.
    pub(crate) fn next_write(&mut self) -> Option<WriteJob> {
        self.journal.as_mut()?.next_job()
    }

    /// The store holds the contents of this number: the modules act on what they gave to it.
    pub(crate) fn handle_written(&mut self, now: Duration, number: u64) {
        let journal = self.journal.as_mut();
        for (module, number) in journal.map_or_else(Vec::new, |journal| journal.finish(number)) {
            if let Some(index) = self.index_of(module) {
                self.pass(index, now, Input::Persisted(number));
            }
        }
    }

    /// Answers a request once the store, if there is one, holds what was done.
    pub(crate) fn answer(&mut self, answer: impl FnOnce() + 'static) {
        match &mut self.journal {
            Some(journal) => journal.answer(Box::new(answer)),
            None => answer(),
        }
    }

    /// For how long the clock stood still, if new runs are to begin for that.
    pub(crate) fn stood_still(&self) -> Option<Duration> {
        self.stood_still
    }

    /// What the modules agreed on, for a host that takes them over.
    pub(crate) fn into_memory(mut self) -> KeptMemory {
        if let Some(journal) = self.journal.take() {
            return KeptMemory::File(journal);
        }
        let indices = 0..self.modules.len();
        let memory = |agent: &mut Agent| (agent.module(), agent.memory());
        let memories = indices.map(|index| self.replica.with(index, memory));
        KeptMemory::Process(memories.collect())
    }

    /// When [`Self::advance`] is due next.
    pub(crate) fn due(&self) -> Option<Duration> {
        if !self.arrived.is_empty() {
            return Some(Duration::ZERO);
        }
        let modules = self.modules.iter().zip(self.replica.agents());
        modules
            .flat_map(|(hosted, agent)| [Some(agent.poll_timeout()), hosted.drive.due()])
            .chain([self.all_states_due])
            .flatten()
            .min()
    }

    /// What there is to publish since the last call.
    pub(crate) fn take_outgoing(&mut self) -> Vec<Outgoing> {
        self.gather_states();
        let modules = self.modules.iter_mut();
        let heartbeats: Vec<Heartbeat> = modules
            .filter_map(|hosted| hosted.heartbeat.take())
            .collect();
        if !heartbeats.is_empty() {
            self.outgoing.push(Outgoing::Heartbeats(heartbeats));
        }
        let mut phases = self.replica.agents().iter().map(Agent::phase);
        if !phases.any(|phase| phase == ModulePhase::Planning) {
            let evictions = std::mem::take(&mut self.evictions).into_iter();
            self.outgoing.extend(evictions.map(Outgoing::Eviction));
        }
        std::mem::take(&mut self.outgoing)
    }

    /// Makes one sample of the states that are new, and one of all when it is due.
    fn gather_states(&mut self) {
        let mut new: Vec<Arc<ModuleState>> = Vec::new();
        for hosted in &mut self.modules {
            if std::mem::take(&mut hosted.state_is_new) {
                new.extend(hosted.state.clone());
            }
        }
        let known = self
            .modules
            .iter()
            .filter_map(|hosted| hosted.state.as_ref());
        if new.len() == known.clone().count() {
            self.all_states_due = None;
        } else if !new.is_empty() {
            let due = self.now + self.parameters.heartbeat;
            self.all_states_due.get_or_insert(due);
        }
        let is_due = |due: &mut Duration| *due <= self.now;
        let sample = match self.all_states_due.take_if(is_due) {
            Some(_) => known.cloned().collect(),
            None => new,
        };
        if !sample.is_empty() {
            self.outgoing.push(Outgoing::ModuleStates(sample));
        }
    }

    /// Uses other parameters from now on.
    pub(crate) fn set_parameters(
        &mut self,
        now: Duration,
        parameters: AgentParameters,
        motion: Motion,
    ) {
        self.parameters = parameters;
        self.motion = motion;
        for index in 0..self.modules.len() {
            let set = |agent: &mut Agent| agent.set_parameters(parameters);
            self.replica.with(index, set);
            self.modules[index].drive.set_parameters(&self.motion);
            // What is due may be due earlier now.
            self.pass(index, now, Input::Timeout);
        }
    }

    /// The status of each hosted module.
    pub(crate) fn reports(&self, now: Duration) -> Vec<Report> {
        let modules = self.modules.iter().zip(self.replica.agents());
        let report = |(hosted, agent): (&Hosted, &Agent)| {
            let state = hosted.state.as_deref();
            hosted.diagnostics.report(now, agent, state)
        };
        modules.map(report).collect()
    }

    fn pass(&mut self, index: usize, now: Duration, input: Input) {
        self.replica.with(index, |agent| agent.handle(now, input));
        self.carry_out(index, now);
        self.pass_reports(index, now);
    }

    fn carry_out_all(&mut self, now: Duration) {
        for index in 0..self.modules.len() {
            self.carry_out(index, now);
            self.pass_reports(index, now);
        }
    }

    /// Passes the reports of a drive to its agent, until neither has anything for the other.
    fn pass_reports(&mut self, index: usize, now: Duration) {
        while let Some(report) = self.modules[index].drive.take_report() {
            let input = Input::Motion(report);
            self.replica.with(index, |agent| agent.handle(now, input));
            self.carry_out(index, now);
        }
        let agent = &self.replica.agents()[index];
        let Hosted {
            identity,
            drive,
            path,
            ..
        } = &mut self.modules[index];
        while let Some(fault) = drive.take_fault() {
            tracing::error!(module = identity.module.0, "{fault}");
        }
        while let Some(command) = drive.take_command() {
            let ahead = agent.path_ahead();
            if matches!(command, DriveCommand::Goal(_)) && *path != ahead {
                path.clone_from(&ahead);
                self.outgoing.push(Outgoing::Path(identity.module, ahead));
            }
            self.outgoing
                .push(Outgoing::Drive(identity.module, command));
        }
    }

    /// Carries out the outputs of an agent.
    fn carry_out(&mut self, index: usize, now: Duration) {
        while let Some(output) = self.replica.poll_output(index) {
            let Hosted { drive, .. } = &mut self.modules[index];
            match output {
                Output::Publish(message) => self.publish(index, message),
                Output::Move(goal) => drive.go(now, goal),
                Output::Halt => drive.halt(now),
                Output::Dock(other) => drive.ask(now, DockingAction::Dock, other),
                Output::Undock(other) => drive.ask(now, DockingAction::Undock, other),
                Output::Compute(_) => debug_assert!(false, "the replica answers that"),
                Output::BeginRun { stood_still } => self.stood_still = Some(stood_still),
                Output::Event(event) => self.modules[index].handle_event(&event),
                Output::Persist { number, state } => {
                    let journal = self.journal.as_mut();
                    debug_assert!(journal.is_some(), "only a module with a store gives to it");
                    if let Some(journal) = journal {
                        let run = self.replica.agents()[index].run();
                        journal.persist(run, number, *state);
                    }
                }
            }
        }
        let phase = self.replica.agents()[index].phase();
        self.modules[index].diagnostics.handle_phase(now, phase);
    }

    fn publish(&mut self, index: usize, message: Message) {
        self.modules[index].diagnostics.count_sent(&message);
        match &message {
            Message::ModuleState(state) => {
                // Each state is sent, even when two follow each other at once: observers judge the order of events by
                // the states that they receive.
                if self.modules[index].state_is_new {
                    self.gather_states();
                }
                self.modules[index].state = Some(Arc::clone(state));
                self.modules[index].state_is_new = true;
            }
            Message::Heartbeat(heartbeat) => {
                self.modules[index].heartbeat = Some(heartbeat.clone());
            }
            Message::Roster(roster) => self.outgoing.push(Outgoing::Roster(roster.clone())),
            Message::Claim(claim) => self.outgoing.push(Outgoing::Claim(Arc::clone(claim))),
            Message::Eviction(notice) => {
                // It is for observers: the claim contains it.
                self.evictions.push(*notice);
                return;
            }
            // No agent announces targets, or commands.
            Message::Target(_)
            | Message::OtherSessionState(_)
            | Message::Stop(_)
            | Message::Removal(_) => return,
        }
        if self.modules.len() > 1 {
            self.arrived.push(Arrived {
                source: Some(self.source),
                sender: Some(index),
                message,
            });
        }
    }

    /// How many messages of others each hosted module refused, by kind.
    pub(crate) fn refusals(&self) -> impl Iterator<Item = (ModuleId, &RefusalCounts)> {
        let agents = self.replica.agents().iter();
        agents.map(|agent| (agent.module(), agent.refusals()))
    }
}

#[cfg(test)]
mod tests;
