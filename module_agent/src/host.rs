//! The modules that one process hosts: their agents, their drives, and what they have to say together.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use formation::model::{
    EvictionNotice, Heartbeat, Message, ModuleId, ModulePhase, ModuleState, Pose, RosterMessage,
    Service, SpotClaim,
};
use formation::motion::{DockingAction, DriveCommand};
use formation::protocol::{
    Agent, AgentParameters, Command, Event, Identity, Input, Output, RefusalCounts, Severity,
    SourceId,
};

use crate::drive::{Drive, MotionParameters};
use crate::drivers::DriverNews;
use crate::tally::Tally;
use formation_node::topics;
use ros_runtime::diagnostics::Report;
use ros_runtime::traffic::worth_a_line;

/// A message between two hosted modules is handed over at once, but after so many the loop turns to the network
/// again, so that modules in endless talk with each other cannot cut it off.
const LOCAL_MESSAGES_PER_TURN: usize = 65_536;

/// What the process has to publish.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Outgoing {
    /// The latest state of every hosted module.
    ModuleStates(Vec<Arc<ModuleState>>),
    /// The heartbeats that fell due together, at most one a module.
    Heartbeats(Vec<Heartbeat>),
    /// A convener's announcement.
    Roster(RosterMessage),
    /// A unit's decision.
    Claim(Arc<SpotClaim>),
    /// An eviction, for those who watch.
    Eviction(EvictionNotice),
    /// What a module's driver is to do.
    Drive(ModuleId, DriveCommand),
}

struct Seat {
    module: ModuleId,
    identity: Identity,
    agent: Agent,
    drive: Drive,
    /// The state that the next sample will carry for this module.
    state: Option<Arc<ModuleState>>,
    /// Whether no sample carried that state yet.
    state_is_new: bool,
    heartbeat: Option<Heartbeat>,
    /// How many refusals the agent thought worth telling.
    refusals_told: u64,
    duplicates_told: u64,
    tally: Tally,
}

impl Seat {
    fn new(
        identity: Identity,
        service: Service,
        parameters: AgentParameters,
        motion: &MotionParameters,
        now: Duration,
    ) -> Self {
        Self {
            module: identity.module,
            identity: identity.clone(),
            drive: Drive::new(&identity, motion, parameters.lease),
            agent: Agent::new(identity, parameters, now).in_service(service),
            state: None,
            state_is_new: false,
            heartbeat: None,
            refusals_told: 0,
            duplicates_told: 0,
            tally: Tally::default(),
        }
    }
}

/// The agents of a process, and what they say, gathered into as few samples as possible.
pub(crate) struct Host {
    source: SourceId,
    parameters: AgentParameters,
    motion: MotionParameters,
    /// At most so many modules are hosted.
    room: usize,
    seats: Vec<Seat>,
    /// Messages of a hosted module on their way to the others, by the sender's seat.
    local: VecDeque<(usize, Message)>,
    outgoing: Vec<Outgoing>,
}

impl Host {
    /// Hosts an agent for each module, started at time zero in or out of service; `source` is the participant that speaks
    /// for them.
    pub(crate) fn new(
        source: SourceId,
        modules: impl IntoIterator<Item = (Identity, Service)>,
        parameters: AgentParameters,
        motion: &MotionParameters,
    ) -> Self {
        let seats: Vec<Seat> = modules
            .into_iter()
            .map(|(identity, service)| {
                Seat::new(identity, service, parameters, motion, Duration::ZERO)
            })
            .collect();
        Self {
            source,
            parameters,
            motion: motion.clone(),
            room: topics::room_for_modules(seats.len()),
            seats,
            local: VecDeque::new(),
            outgoing: Vec::new(),
        }
    }

    /// Hosts one more module, which is told what the others know of the latched topics.
    ///
    /// # Errors
    /// Says why this process takes no more.
    pub(crate) fn add(&mut self, now: Duration, identity: Identity) -> Result<(), String> {
        if let MotionParameters::External(_) = self.motion {
            return Err(format!(
                "the modules of this process have drivers outside, which are set up at its start; start another process: \
                 module_agent --motion external --module {}",
                identity.module.0
            ));
        }
        if self.seats.len() >= self.room {
            return Err(format!(
                "this process keeps the decisions of at most {} modules for late subscribers; start another process",
                self.room
            ));
        }
        let briefing = self.briefing(identity.module);
        let seat = self.seats.len();
        let (parameters, motion) = (self.parameters, self.motion.clone());
        self.seats.push(Seat::new(
            identity,
            Service::Active,
            parameters,
            &motion,
            now,
        ));
        for (source, message) in briefing {
            self.tell(seat, now, Input::Message { source, message });
        }
        Ok(())
    }

    /// What a module has missed that is hosted from now on.
    fn briefing(&self, newcomer: ModuleId) -> Vec<(Option<SourceId>, Message)> {
        let Some(first) = self.seats.first() else {
            return Vec::new();
        };
        let own = first.state.iter().cloned().map(Message::ModuleState);
        own.map(|own| (Some(self.source), own))
            .chain(first.agent.latched_snapshot())
            .filter(|(_, message)| match message {
                // An earlier run of the newcomer is no news to it.
                Message::ModuleState(state) => state.module != newcomer,
                _ => true,
            })
            .collect()
    }

    /// Tells a hosted module what to do.
    pub(crate) fn command(&mut self, now: Duration, module: ModuleId, command: Command) {
        if let Some(seat) = self.seats.iter().position(|seat| seat.module == module) {
            self.tell(seat, now, Input::Command(command));
        }
    }

    /// Whether a hosted module takes a spot when it can.
    pub(crate) fn service_of(&self, module: ModuleId) -> Option<Service> {
        self.seat_of(module).map(|seat| seat.agent.service())
    }

    /// What a hosted module is doing.
    pub(crate) fn phase_of(&self, module: ModuleId) -> Option<ModulePhase> {
        self.seat_of(module).map(|seat| seat.agent.phase())
    }

    fn seat_of(&self, module: ModuleId) -> Option<&Seat> {
        self.seats.iter().find(|seat| seat.module == module)
    }

    /// Where the hosted modules stand, and all others that live, as far as they said.
    pub(crate) fn standing(&self) -> BTreeMap<ModuleId, Option<Pose>> {
        let peers = self
            .seats
            .iter()
            .flat_map(|seat| seat.agent.living_peers())
            .map(|(module, state)| (module, state.map(|state| state.pose)));
        let own = self
            .seats
            .iter()
            .map(|seat| (seat.module, Some(seat.agent.pose())));
        peers.chain(own).collect()
    }

    /// The hosted modules by number, for people.
    pub(crate) fn named(&self) -> String {
        let numbers: Vec<String> = self
            .seats
            .iter()
            .map(|seat| seat.module.0.to_string())
            .collect();
        numbers.join(", ")
    }

    /// The hosted modules as they are by now, for a host that takes them over.
    pub(crate) fn modules(&self) -> Vec<(Identity, Service)> {
        self.seats
            .iter()
            .map(|seat| {
                let identity = Identity {
                    pose: seat.agent.pose(),
                    links: seat.agent.links().clone(),
                    ..seat.identity.clone()
                };
                (identity, seat.agent.service())
            })
            .collect()
    }

    /// Hands a message of another process to every hosted module.
    pub(crate) fn receive(&mut self, now: Duration, source: SourceId, message: &Message) {
        for seat in 0..self.seats.len() {
            self.tell(
                seat,
                now,
                Input::Message {
                    source: Some(source),
                    message: message.clone(),
                },
            );
        }
    }

    /// Hands what a driver says to its module.
    pub(crate) fn hear_driver(&mut self, now: Duration, module: ModuleId, news: DriverNews) {
        let Some(seat) = self.seats.iter().position(|seat| seat.module == module) else {
            return;
        };
        self.seats[seat].drive.hear(now, news);
        self.tell_reports(seat, now);
    }

    /// Lets time pass: timeouts, drives, and what the hosted modules have to tell each other.
    pub(crate) fn advance(&mut self, now: Duration) {
        for seat in 0..self.seats.len() {
            if self.seats[seat].drive.due().is_some_and(|due| due <= now) {
                self.seats[seat].drive.advance(now);
                self.tell_reports(seat, now);
            }
            if self.seats[seat].agent.poll_timeout() <= now {
                self.tell(seat, now, Input::Timeout);
            }
        }
        for _ in 0..LOCAL_MESSAGES_PER_TURN {
            let Some((sender, message)) = self.local.pop_front() else {
                break;
            };
            for seat in (0..self.seats.len()).filter(|&seat| seat != sender) {
                self.tell(
                    seat,
                    now,
                    Input::Message {
                        source: Some(self.source),
                        message: message.clone(),
                    },
                );
            }
        }
    }

    /// When [`Self::advance`] is due next.
    pub(crate) fn due(&self) -> Option<Duration> {
        if !self.local.is_empty() {
            return Some(Duration::ZERO);
        }
        self.seats
            .iter()
            .flat_map(|seat| [Some(seat.agent.poll_timeout()), seat.drive.due()])
            .flatten()
            .min()
    }

    /// What there is to publish since the last call.
    pub(crate) fn take_outgoing(&mut self) -> Vec<Outgoing> {
        self.gather_states();
        let heartbeats: Vec<Heartbeat> = self
            .seats
            .iter_mut()
            .filter_map(|seat| seat.heartbeat.take())
            .collect();
        if !heartbeats.is_empty() {
            self.outgoing.push(Outgoing::Heartbeats(heartbeats));
        }
        std::mem::take(&mut self.outgoing)
    }

    /// Makes one sample of the states, if any of them is new.
    fn gather_states(&mut self) {
        if !self.seats.iter().any(|seat| seat.state_is_new) {
            return;
        }
        let states = self
            .seats
            .iter_mut()
            .filter_map(|seat| {
                seat.state_is_new = false;
                seat.state.clone()
            })
            .collect();
        self.outgoing.push(Outgoing::ModuleStates(states));
    }

    /// Waits and moves by other parameters from now on.
    pub(crate) fn set_parameters(
        &mut self,
        now: Duration,
        parameters: AgentParameters,
        motion: &MotionParameters,
    ) {
        self.parameters = parameters;
        self.motion = motion.clone();
        for seat in 0..self.seats.len() {
            self.seats[seat].agent.set_parameters(parameters);
            self.seats[seat].drive.set_parameters(motion);
            // What is due may be due earlier now.
            self.tell(seat, now, Input::Timeout);
        }
    }

    /// How each hosted module is doing.
    pub(crate) fn reports(&self, now: Duration) -> Vec<Report> {
        self.seats
            .iter()
            .map(|seat| seat.tally.report(now, &seat.agent, seat.state.as_deref()))
            .collect()
    }

    fn tell(&mut self, seat: usize, now: Duration, input: Input) {
        if let Input::Message { .. } = input {
            self.seats[seat].tally.received += 1;
        }
        self.seats[seat].agent.handle(now, input);
        self.obey(seat, now);
        self.tell_reports(seat, now);
    }

    /// Tells the agent whatever its drive reports, until the two have nothing more to say to each other.
    fn tell_reports(&mut self, seat: usize, now: Duration) {
        while let Some(report) = self.seats[seat].drive.take_report() {
            self.seats[seat].agent.handle(now, Input::Motion(report));
            self.obey(seat, now);
        }
        let Seat { module, drive, .. } = &mut self.seats[seat];
        while let Some(fault) = drive.take_fault() {
            tracing::error!(module = module.0, "{fault}");
        }
        while let Some(command) = drive.take_command() {
            self.outgoing.push(Outgoing::Drive(*module, command));
        }
    }

    /// Does what the agent wants done.
    fn obey(&mut self, seat: usize, now: Duration) {
        while let Some(output) = self.seats[seat].agent.poll_output() {
            let drive = &mut self.seats[seat].drive;
            match output {
                Output::Publish(message) => self.publish(seat, message),
                Output::Move(goal) => drive.go(now, goal),
                Output::Halt => drive.halt(now),
                Output::Dock(other) => drive.ask(now, DockingAction::Dock, other),
                Output::Undock(other) => drive.ask(now, DockingAction::Undock, other),
                Output::Event(event) => self.note(seat, &event),
            }
        }
        let seat = &mut self.seats[seat];
        seat.tally.observe_phase(now, seat.agent.phase());
    }

    fn publish(&mut self, seat: usize, message: Message) {
        self.seats[seat].tally.count_sent(&message);
        match &message {
            Message::ModuleState(state) => {
                // Each state goes out, even when two follow each other at once: observers judge the order of
                // events by the states that they see.
                if self.seats[seat].state_is_new {
                    self.gather_states();
                }
                self.seats[seat].state = Some(Arc::clone(state));
                self.seats[seat].state_is_new = true;
            }
            Message::Heartbeat(heartbeat) => self.seats[seat].heartbeat = Some(*heartbeat),
            Message::Roster(roster) => self.outgoing.push(Outgoing::Roster(roster.clone())),
            Message::Claim(claim) => self.outgoing.push(Outgoing::Claim(Arc::clone(claim))),
            Message::Eviction(notice) => self.outgoing.push(Outgoing::Eviction(*notice)),
            // No agent announces targets.
            Message::Target(_) => return,
        }
        if self.seats.len() > 1 {
            self.local.push_back((seat, message));
        }
    }

    fn note(&mut self, seat: usize, event: &Event) {
        let seat = &mut self.seats[seat];
        seat.tally.note(event);
        let module = seat.module.0;
        // What others can cause at will must not flood the log.
        let told = match event {
            Event::Refused { .. } => Some(&mut seat.refusals_told),
            Event::DuplicateModule(_) => Some(&mut seat.duplicates_told),
            _ => None,
        };
        if let Some(told) = told {
            *told += 1;
            if !worth_a_line(*told) {
                return;
            }
        }
        match event.severity() {
            Severity::Info => tracing::info!(module, "{event}"),
            Severity::Warning => tracing::warn!(module, "{event}"),
            Severity::Error => tracing::error!(module, "{event}"),
        }
    }

    /// How many messages of others each hosted module refused, by kind.
    pub(crate) fn refusals(&self) -> impl Iterator<Item = (ModuleId, &RefusalCounts)> {
        let seats = self.seats.iter();
        seats.map(|seat| (seat.module, seat.agent.refusals()))
    }
}

#[cfg(test)]
mod tests;
