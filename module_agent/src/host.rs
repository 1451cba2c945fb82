//! The modules that one process hosts: their agents, their drives, and what they publish together.

mod events;
mod handled_states;
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
    Agent, AgentParameters, Command, ComputedPlan, DurableState, Identity, Input, Output, PlanJob,
    RefusalCounts, SharedPlans,
};
use ros_runtime::diagnostics::Report;

use crate::arguments::{DriveMode, Motion};
use crate::drive::Drive;
use crate::drivers::DriverMessage;
use crate::journal::{Journal, KeptMemory, WriteJob};
use crate::module_diagnostics::ModuleDiagnostics;
use handled_states::HandledStates;
use pushes::Pushes;
pub(crate) use removals::REMOVE_MODULE;

/// What the process has to publish.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Outgoing {
    /// The latest state of every hosted module.
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

/// A message that the hosted modules are to handle.
struct Arrived {
    source: SourceId,
    /// The index of the hosted module that sent it, if one did.
    sender: Option<usize>,
    message: Message,
}

/// One hosted module.
struct Hosted {
    identity: Identity,
    agent: Agent,
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
    plans: SharedPlans,
    /// `None` if what the modules agree on ends with the process.
    journal: Option<Journal>,
    /// Messages from other processes, and from hosted modules to each other, until the modules handle them together.
    arrived: Vec<Arrived>,
    handled_states: HandledStates,
    outgoing: Vec<Outgoing>,
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
            plans: SharedPlans::default(),
            journal,
            arrived: Vec::new(),
            handled_states: HandledStates::default(),
            outgoing: Vec::new(),
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
        self.modules.push(Hosted {
            drive: Drive::new(&identity, &self.motion, self.parameters.lease),
            identity,
            agent,
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
        let missed = self.latched_snapshot(identity.module);
        let index = self.modules.len();
        self.push(now, identity, Service::Active, None);
        self.pass_messages(index, now, missed);
        Ok(())
    }

    /// The messages of the latched topics that a module has missed which is hosted from now on.
    fn latched_snapshot(&self, newcomer: ModuleId) -> Vec<(Option<SourceId>, Message)> {
        let Some(first) = self.modules.first() else {
            return Vec::new();
        };
        let own = first.state.iter().cloned().map(Message::ModuleState);
        own.map(|own| (Some(self.source), own))
            .chain(first.agent.latched_snapshot())
            .filter(|(_, message)| match message {
                // The newcomer needs no state of its own earlier run.
                Message::ModuleState(state) => state.module != newcomer,
                _ => true,
            })
            .collect()
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
        let agent = &self.modules[self.index_of(module)?].agent;
        Some((agent.service(), agent.phase()))
    }

    /// The hosted modules as they are now, for a host that takes them over.
    pub(crate) fn modules(&self) -> Vec<(Identity, Service)> {
        let modules = self.modules.iter().map(|hosted| {
            let identity = Identity {
                incarnation: hosted.agent.run().incarnation,
                pose: hosted.agent.pose(),
                links: hosted.agent.links().clone(),
                ..hosted.identity.clone()
            };
            (identity, hosted.agent.service())
        });
        modules.collect()
    }

    /// Takes a message of another process, which every hosted module handles when time passes, unless it is a state that came
    /// before.
    pub(crate) fn take_message(&mut self, source: SourceId, message: Message) {
        if let Message::ModuleState(state) = &message
            && !self.handled_states.note(source, state)
        {
            return;
        }
        self.arrived.push(Arrived {
            source,
            sender: None,
            message,
        });
    }

    /// A participant has left the graph, after all messages of it that were taken.
    pub(crate) fn handle_departed(&mut self, now: Duration, source: SourceId) {
        for index in 0..self.modules.len() {
            self.pass(index, now, Input::Departed(source));
        }
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
        // What the modules answer to each other waits for the next time, after what the network brings until then.
        let arrived = std::mem::take(&mut self.arrived);
        if !arrived.is_empty() {
            for index in 0..self.modules.len() {
                let others = arrived.iter().filter(|one| one.sender != Some(index));
                let messages = others.map(|one| (Some(one.source), one.message.clone()));
                self.pass_messages(index, now, messages);
            }
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
            if self.modules[index].agent.poll_timeout() <= now {
                self.pass(index, now, Input::Timeout);
            }
        }
    }

    /// The next plan to compute; no other before it is handed in.
    pub(crate) fn next_job(&mut self) -> Option<PlanJob> {
        self.plans.next_job()
    }

    /// Hands in a plan to the modules that wait for it.
    pub(crate) fn handle_computed(&mut self, now: Duration, computed: &Arc<ComputedPlan>) {
        for module in self.plans.finish(Arc::clone(computed)) {
            if let Some(index) = self.index_of(module) {
                self.pass(index, now, Input::Computed(Arc::clone(computed)));
            }
        }
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
        let modules = self.modules.iter_mut();
        let memories = modules.map(|hosted| (hosted.identity.module, hosted.agent.memory()));
        KeptMemory::Process(memories.collect())
    }

    /// When [`Self::advance`] is due next.
    pub(crate) fn due(&self) -> Option<Duration> {
        if !self.arrived.is_empty() {
            return Some(Duration::ZERO);
        }
        let modules = self.modules.iter();
        modules
            .flat_map(|hosted| [Some(hosted.agent.poll_timeout()), hosted.drive.due()])
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
        let mut phases = self.modules.iter().map(|hosted| hosted.agent.phase());
        if !phases.any(|phase| phase == ModulePhase::Planning) {
            let evictions = std::mem::take(&mut self.evictions).into_iter();
            self.outgoing.extend(evictions.map(Outgoing::Eviction));
        }
        std::mem::take(&mut self.outgoing)
    }

    /// Makes one sample of the states, if any of them is new.
    fn gather_states(&mut self) {
        if !self.modules.iter().any(|hosted| hosted.state_is_new) {
            return;
        }
        let states = self.modules.iter_mut().filter_map(|hosted| {
            hosted.state_is_new = false;
            hosted.state.clone()
        });
        let states = states.collect();
        self.outgoing.push(Outgoing::ModuleStates(states));
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
            let hosted = &mut self.modules[index];
            hosted.agent.set_parameters(parameters);
            hosted.drive.set_parameters(&self.motion);
            // What is due may be due earlier now.
            self.pass(index, now, Input::Timeout);
        }
    }

    /// The status of each hosted module.
    pub(crate) fn reports(&self, now: Duration) -> Vec<Report> {
        let report = |hosted: &Hosted| {
            hosted
                .diagnostics
                .report(now, &hosted.agent, hosted.state.as_deref())
        };
        self.modules.iter().map(report).collect()
    }

    fn pass_messages(
        &mut self,
        index: usize,
        now: Duration,
        messages: impl IntoIterator<Item = (Option<SourceId>, Message)>,
    ) {
        let Hosted {
            agent, diagnostics, ..
        } = &mut self.modules[index];
        let count = |_: &(Option<SourceId>, Message)| diagnostics.received += 1;
        agent.handle_messages(now, messages.into_iter().inspect(count));
        self.carry_out(index, now);
        self.pass_reports(index, now);
    }

    fn pass(&mut self, index: usize, now: Duration, input: Input) {
        self.modules[index].agent.handle(now, input);
        self.carry_out(index, now);
        self.pass_reports(index, now);
    }

    /// Passes the reports of a drive to its agent, until neither has anything for the other.
    fn pass_reports(&mut self, index: usize, now: Duration) {
        while let Some(report) = self.modules[index].drive.take_report() {
            self.modules[index].agent.handle(now, Input::Motion(report));
            self.carry_out(index, now);
        }
        let Hosted {
            identity,
            agent,
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
        while let Some(output) = self.modules[index].agent.poll_output() {
            let Hosted {
                identity,
                agent,
                drive,
                ..
            } = &mut self.modules[index];
            match output {
                Output::Publish(message) => self.publish(index, message),
                Output::Move(goal) => drive.go(now, goal),
                Output::Halt => drive.halt(now),
                Output::Dock(other) => drive.ask(now, DockingAction::Dock, other),
                Output::Undock(other) => drive.ask(now, DockingAction::Undock, other),
                Output::Compute(job) => {
                    if let Some(computed) = self.plans.ask(identity.module, job) {
                        agent.handle(now, Input::Computed(computed));
                    }
                }
                Output::BeginRun { stood_still } => self.stood_still = Some(stood_still),
                Output::Event(event) => self.modules[index].handle_event(&event),
                Output::Persist { number, state } => {
                    let journal = self.journal.as_mut();
                    debug_assert!(journal.is_some(), "only a module with a store gives to it");
                    if let Some(journal) = journal {
                        journal.persist(agent.run(), number, *state);
                    }
                }
            }
        }
        let Hosted {
            agent, diagnostics, ..
        } = &mut self.modules[index];
        diagnostics.handle_phase(now, agent.phase());
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
                source: self.source,
                sender: Some(index),
                message,
            });
        }
    }

    /// How many messages of others each hosted module refused, by kind.
    pub(crate) fn refusals(&self) -> impl Iterator<Item = (ModuleId, &RefusalCounts)> {
        let agents = self.modules.iter().map(|hosted| &hosted.agent);
        agents.map(|agent| (agent.module(), agent.refusals()))
    }
}

#[cfg(test)]
mod tests;
