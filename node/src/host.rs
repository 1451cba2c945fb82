//! The modules that one process hosts: their agents, their drives, and what they have to say together.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use formation::agent::{
    Agent, AgentParameters, Event, Identity, Input, Output, RefusalCounts, Severity, SourceId,
};
use formation::id::ModuleId;
use formation::message::{
    EvictionNotice, Heartbeat, Message, ModuleState, RosterMessage, SpotClaim,
};
use formation::motion::{DockingAction, DriveCommand};

use crate::diagnostics::Report;
use crate::drive::{Drive, MotionParameters};
use crate::drivers::DriverNews;
use crate::tally::Tally;
use crate::traffic::worth_a_line;

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

/// The agents of a process, and what they say, gathered into as few samples as possible.
pub(crate) struct Host {
    source: SourceId,
    seats: Vec<Seat>,
    /// Messages of a hosted module on their way to the others, by the sender's seat.
    local: VecDeque<(usize, Message)>,
    outgoing: Vec<Outgoing>,
}

impl Host {
    /// Hosts an agent for each identity, started at time zero; `source` is the participant that speaks for them.
    pub(crate) fn new(
        source: SourceId,
        identities: impl IntoIterator<Item = Identity>,
        parameters: AgentParameters,
        motion: &MotionParameters,
    ) -> Self {
        let seats = identities
            .into_iter()
            .map(|identity| Seat {
                module: identity.module,
                drive: Drive::new(&identity, motion, parameters.lease),
                agent: Agent::new(identity, parameters, Duration::ZERO),
                state: None,
                state_is_new: false,
                heartbeat: None,
                refusals_told: 0,
                duplicates_told: 0,
                tally: Tally::default(),
            })
            .collect();
        Self {
            source,
            seats,
            local: VecDeque::new(),
            outgoing: Vec::new(),
        }
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

    /// Where a hosted module stands by now, and what it is docked to.
    pub(crate) fn bring_up_to_date(&self, identity: &mut Identity) {
        if let Some(seat) = self
            .seats
            .iter()
            .find(|seat| seat.module == identity.module)
        {
            identity.pose = seat.agent.pose();
            identity.links = seat.agent.links().clone();
        }
    }

    /// How many messages of others each hosted module refused, by kind.
    pub(crate) fn refusals(&self) -> impl Iterator<Item = (ModuleId, &RefusalCounts)> {
        let seats = self.seats.iter();
        seats.map(|seat| (seat.module, seat.agent.refusals()))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use formation::id::Incarnation;
    use formation::message::{ModulePhase, TargetAnnouncement};
    use formation::scenario::Scenario;

    use super::*;

    const SCENARIO: &str = "
target: {spots: [{id: 1, x: 5.0, y: 5.0}, {id: 2, x: 6.0, y: 5.0}, {id: 3, x: 7.0, y: 5.0}], edges: [[1, 2], [2, 3]]}
configurations:
  - {id: 7, leader: 5, modules: [{id: 4, x: 1.0, y: 2.0}, {id: 5, x: 2.0, y: 2.0}], edges: [[4, 5]]}
singletons: [{id: 17, x: 3.0, y: 9.5, theta: 1.2}]
";
    const TARGET_PUBLISHER: SourceId = SourceId(1);
    const OTHER_PROCESS: SourceId = SourceId(2);

    fn host(modules: &[u32]) -> (Host, Message) {
        let scenario = Scenario::from_yaml(SCENARIO).unwrap();
        let problem = scenario.problem();
        let identities = problem
            .modules()
            .iter()
            .filter(|module| modules.contains(&module.id.0))
            .map(|module| Identity {
                module: module.id,
                incarnation: Incarnation(1),
                pose: module.pose,
                links: module.links.clone(),
                configuration: module.configuration,
                leader: module.leader,
            });
        let source = SourceId(u128::from(modules[0]) + 100);
        let motion = MotionParameters::Simulated {
            speed_units_per_s: 5.0,
        };
        let host = Host::new(source, identities, AgentParameters::default(), &motion);
        let target = Message::Target(Arc::new(TargetAnnouncement {
            revision: 1,
            name: String::new(),
            target: Some(Arc::clone(problem.target())),
            parameters: *problem.parameters(),
            expected_modules: Some(3),
        }));
        (host, target)
    }

    /// What the processes say to each other and to whoever watches, until all is still for `idle` or the time is up.
    fn run(hosts: &mut [Host], limit: Duration) -> Vec<Outgoing> {
        let mut said = Vec::new();
        let mut now = Duration::ZERO;
        while now < limit {
            for speaker in 0..hosts.len() {
                hosts[speaker].advance(now);
                let outgoing = hosts[speaker].take_outgoing();
                let source = hosts[speaker].source;
                for listener in (0..hosts.len()).filter(|&listener| listener != speaker) {
                    for message in outgoing.iter().flat_map(messages_of) {
                        hosts[listener].receive(now, source, &message);
                    }
                }
                said.extend(outgoing);
            }
            now = hosts
                .iter()
                .filter_map(Host::due)
                .min()
                .map_or(limit, |due| due.max(now + Duration::from_millis(1)));
        }
        said
    }

    fn messages_of(outgoing: &Outgoing) -> Vec<Message> {
        match outgoing.clone() {
            Outgoing::ModuleStates(states) => {
                states.into_iter().map(Message::ModuleState).collect()
            }
            Outgoing::Heartbeats(heartbeats) => {
                heartbeats.into_iter().map(Message::Heartbeat).collect()
            }
            Outgoing::Roster(roster) => vec![Message::Roster(roster)],
            Outgoing::Claim(claim) => vec![Message::Claim(claim)],
            Outgoing::Eviction(notice) => vec![Message::Eviction(notice)],
            Outgoing::Drive(..) => Vec::new(),
        }
    }

    fn states_of(said: &[Outgoing]) -> Vec<&Vec<Arc<ModuleState>>> {
        said.iter()
            .filter_map(|outgoing| match outgoing {
                Outgoing::ModuleStates(states) => Some(states),
                _ => None,
            })
            .collect()
    }

    fn assert_all_settle(groups: &[&[u32]]) {
        let mut hosts: Vec<Host> = Vec::new();
        for group in groups {
            let (mut host, target) = host(group);
            host.receive(Duration::ZERO, TARGET_PUBLISHER, &target);
            hosts.push(host);
        }
        let said = run(&mut hosts, Duration::from_secs(30));
        let mut settled = BTreeMap::new();
        for state in states_of(&said).into_iter().flatten() {
            if state.phase == ModulePhase::Settled {
                settled.insert(state.module.0, state.spot.map(|spot| spot.0));
            }
        }
        let spots: std::collections::BTreeSet<_> = settled.values().copied().collect();
        assert_eq!(settled.len(), 3, "{groups:?}: {settled:?}");
        assert_eq!(spots, [Some(1), Some(2), Some(3)].into(), "{groups:?}");
    }

    #[test]
    fn modules_form_the_target_however_they_are_spread_over_processes() {
        assert_all_settle(&[&[4, 5, 17]]);
        assert_all_settle(&[&[4, 17], &[5]]);
        assert_all_settle(&[&[4], &[5], &[17]]);
    }

    #[test]
    fn every_sample_lists_all_hosted_modules_and_no_state_is_skipped() {
        let (mut host, target) = host(&[4, 5, 17]);
        host.receive(Duration::ZERO, TARGET_PUBLISHER, &target);
        let said = run(&mut [host], Duration::from_secs(30));
        let mut latest: BTreeMap<u32, u64> = BTreeMap::new();
        for states in states_of(&said) {
            let modules: Vec<u32> = states.iter().map(|state| state.module.0).collect();
            assert_eq!(modules, [4, 5, 17]);
            for state in states {
                let last = latest.entry(state.module.0).or_insert(state.sequence);
                assert!(
                    state.sequence - *last <= 1,
                    "{}: {} follows {last}",
                    state.module,
                    state.sequence
                );
                *last = state.sequence;
            }
        }
        assert!(latest.values().all(|&sequence| sequence > 5), "{latest:?}");
    }

    #[test]
    fn heartbeats_that_fall_due_together_share_a_sample() {
        let (host, _) = host(&[4, 5, 17]);
        let said = run(&mut [host], Duration::from_secs(5));
        let beats: Vec<usize> = said
            .iter()
            .filter_map(|outgoing| match outgoing {
                Outgoing::Heartbeats(heartbeats) => Some(heartbeats.len()),
                _ => None,
            })
            .collect();
        assert_eq!(beats, [3; 10], "two a second, each for all three");
    }

    #[test]
    fn a_message_that_an_agent_refuses_is_counted_for_it() {
        let (mut host, target) = host(&[4, 5]);
        let now = Duration::from_secs(1);
        host.advance(now);
        host.receive(now, TARGET_PUBLISHER, &target);
        let Message::Target(announcement) = &target else {
            unreachable!("it was made as a target");
        };
        let mut other = announcement.as_ref().clone();
        other.expected_modules = Some(9);
        host.receive(now, OTHER_PROCESS, &Message::Target(Arc::new(other)));
        for (module, refusals) in host.refusals() {
            assert_eq!(refusals.to_string(), "contradicting_target 1", "{module}");
        }
    }
}
