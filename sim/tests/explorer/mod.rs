//! A search through every schedule of a small cluster, up to a bound.
//!
//! A schedule is the order in which messages are delivered and timers run out. The plain one delivers messages at once, in
//! the order in which they were sent, and lets a timer run out when none is left. A *deviation* delivers a message before
//! one that was sent earlier on another channel, loses a heartbeat, or lets the next timer run out although messages are
//! on their way. Every schedule with at most so many deviations is searched, each with at most one fault at any step: a
//! crash, a crash and a restart, or one module cut off for a while (delay-bounded scheduling: Emmi, Qadeer and
//! Rakamaric, 2011). States that were met before are not searched again.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::fmt::{self, Write as _};
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use formation::agent::{
    Agent, AgentParameters, Identity, Input, MotionGoal, MotionReport, Output, SourceId,
};
use formation::geometry::Pose;
use formation::id::{Digest, Epoch, Incarnation, ModuleId, SpotId};
use formation::message::{
    Heartbeat, Message, ModulePhase, ModuleState, RosterMessage, TargetAnnouncement,
};
use formation::problem::PlanningProblem;
use formation_sim::AgentFactory;

const MODULES: usize = 3;
/// How long a drive takes.
const JOURNEY: Duration = Duration::from_millis(700);
/// How long a module is cut off, and how long a crashed one takes to start again.
const CUT: Duration = Duration::from_secs(7);
const DOWN: Duration = Duration::from_secs(1);
/// After the last disturbance, everything must have ended within this time.
const PATIENCE: Duration = Duration::from_secs(120);
/// What has ended must stay so for longer than it takes to miss somebody.
const CALM: Duration = Duration::from_secs(6);

/// How far to search.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// How often a schedule may deviate from the plain one.
    pub deviations: u8,
    /// Whether one fault may strike.
    pub fault: bool,
    /// Deviations and faults come within this time of the start.
    pub until: Duration,
}

/// What a search came to.
#[derive(Debug, Default)]
pub struct Searched {
    /// How many different states were met.
    pub states: usize,
    /// How many steps were taken from them.
    pub steps: usize,
    /// How many of the states were ends.
    pub ends: usize,
    /// The first violation, and the steps that led to it.
    pub violation: Option<(String, String)>,
}

/// One choice.
#[derive(Clone, Copy, Debug)]
enum Step {
    Deliver(usize),
    Lose(usize),
    RunTimer,
    Crash(usize),
    CrashAndRestart(usize),
    CutOff(usize),
}

struct Trail {
    before: Option<Rc<Trail>>,
    line: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Agenda {
    Restart(usize),
    Heal,
}

#[derive(Clone)]
struct Flight {
    from: Option<usize>,
    to: usize,
    topic: u8,
    message: Message,
    hash: u64,
}

type PlanKey = (Epoch, Digest);

/// The goal, when it is reached, when the drive was last told, and the plan that sent it.
type Journey = (MotionGoal, Duration, Duration, Option<PlanKey>);

#[derive(Clone)]
struct Actor {
    agent: Agent,
    incarnation: Incarnation,
    pose: Pose,
    drive: Option<Journey>,
    hash: u64,
}

/// What an observer has seen, as far as later judgements depend on it.
#[derive(Clone, Debug, Default)]
struct Evidence {
    rosters: BTreeMap<Epoch, Vec<ModuleId>>,
    shown: BTreeMap<PlanKey, BTreeMap<ModuleId, Duration>>,
    begun: BTreeSet<PlanKey>,
    /// The epoch that each module showed last, and since when.
    in_epoch: BTreeMap<ModuleId, (Option<Epoch>, Duration)>,
    settled: BTreeMap<(Epoch, Digest, SpotId), ModuleId>,
}

impl Evidence {
    /// Whether these modules are more than half of the last roster for which all members showed one digest, or just half
    /// with the lowest of them. The first roster needs more than half of all.
    fn allows(&self, members: &[ModuleId]) -> bool {
        let agreed = self.rosters.iter().rev().find(|(epoch, roster)| {
            let mut plans = self.shown.iter().filter(|((of, _), _)| of == *epoch);
            plans.any(|(_, shown)| roster.iter().all(|member| shown.contains_key(member)))
        });
        let Some((_, roster)) = agreed else {
            return members.len() * 2 > MODULES;
        };
        let present = roster
            .iter()
            .filter(|member| members.contains(member))
            .count()
            * 2;
        let lowest = roster
            .first()
            .is_some_and(|lowest| members.contains(lowest));
        present > roster.len() || (present == roster.len() && lowest)
    }
}

#[derive(Clone)]
struct World {
    now: Duration,
    actors: [Option<Rc<Actor>>; MODULES],
    flights: Vec<Rc<Flight>>,
    held: Vec<Rc<Flight>>,
    cut: Option<usize>,
    agenda: Option<(Duration, Agenda)>,
    deviations: u8,
    fault: bool,
    disturbed: Duration,
    /// What each module last published on its latched topics, for those that start later.
    latched: BTreeMap<(usize, u8), Vec<Message>>,
    heartbeats: BTreeMap<usize, Heartbeat>,
    states: BTreeMap<usize, Arc<ModuleState>>,
    ended_since: Option<Duration>,
    evidence: Rc<Evidence>,
    violation: Option<String>,
    trail: Option<Rc<Trail>>,
}

/// Agents and their surroundings.
pub struct Explorer {
    problem: PlanningProblem,
    parameters: AgentParameters,
    agents: AgentFactory,
    target: Arc<TargetAnnouncement>,
}

struct HashingWriter(DefaultHasher);

impl fmt::Write for HashingWriter {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}

fn hash_of(value: &impl fmt::Debug) -> u64 {
    let mut writer = HashingWriter(DefaultHasher::new());
    write!(writer, "{value:?}").unwrap();
    writer.0.finish()
}

fn topic_of(message: &Message) -> u8 {
    match message {
        Message::Target(_) => 0,
        Message::ModuleState(_) => 1,
        Message::Roster(_) => 2,
        Message::Claim(_) => 3,
        Message::Eviction(_) => 4,
        Message::Heartbeat(_) => 5,
    }
}

const HEARTBEATS: u8 = 5;
const CLAIMS: u8 = 3;

fn id(index: usize) -> ModuleId {
    ModuleId(u32::try_from(index).unwrap() + 1)
}

impl Explorer {
    /// Three modules, numbered from 1, and time limits that keep schedules short.
    pub fn new(problem: PlanningProblem, agents: AgentFactory) -> Self {
        let target = Arc::new(TargetAnnouncement {
            revision: 1,
            name: String::new(),
            target: Some(Arc::clone(problem.target())),
            parameters: *problem.parameters(),
            expected_modules: Some(3),
        });
        let seconds = Duration::from_secs;
        let parameters = AgentParameters {
            heartbeat: seconds(1),
            suspicion: seconds(4),
            lease: Duration::from_millis(2_200),
            convene: seconds(1),
            gather: seconds(1),
            gather_limit: seconds(6),
            stuck: seconds(5),
            motion_limit: seconds(12),
            ..AgentParameters::default()
        };
        Self {
            problem,
            parameters: parameters.validated().unwrap(),
            agents,
            target,
        }
    }

    /// Searches depth first, and stops at the first violation.
    pub fn search(&self, bound: Bound) -> Searched {
        let mut searched = Searched::default();
        let mut met = HashSet::new();
        let mut stack = vec![self.start(bound)];
        while let Some(world) = stack.pop() {
            if !met.insert(world.hash()) {
                continue;
            }
            searched.states += 1;
            if world.has_ended(bound) {
                searched.ends += 1;
                continue;
            }
            for step in world.choices(bound) {
                searched.steps += 1;
                let mut next = world.clone();
                self.take(&mut next, step);
                if let Some(violation) = next.violation {
                    searched.violation = Some((violation, told(next.trail.as_ref())));
                    return searched;
                }
                stack.push(next);
            }
        }
        searched
    }

    fn start(&self, bound: Bound) -> World {
        let mut world = World {
            now: Duration::ZERO,
            actors: [None, None, None],
            flights: Vec::new(),
            held: Vec::new(),
            cut: None,
            agenda: None,
            deviations: bound.deviations,
            fault: bound.fault,
            disturbed: Duration::ZERO,
            latched: BTreeMap::new(),
            heartbeats: BTreeMap::new(),
            states: BTreeMap::new(),
            ended_since: None,
            evidence: Rc::default(),
            violation: None,
            trail: None,
        };
        for index in 0..MODULES {
            // Heartbeats at one instant would make every order of them a deviation.
            world.now = Duration::from_millis(100 * index as u64);
            self.launch(&mut world, index, Incarnation(1), None);
        }
        world
    }

    fn launch(
        &self,
        world: &mut World,
        index: usize,
        incarnation: Incarnation,
        body: Option<(Pose, BTreeSet<ModuleId>)>,
    ) {
        let module = self.problem.module(id(index)).unwrap();
        let (pose, links) = body.unwrap_or((module.pose, module.links.clone()));
        let identity = Identity {
            module: module.id,
            incarnation,
            pose,
            links,
            configuration: module.configuration,
            leader: module.leader,
        };
        let agent = self.agents.make(identity, self.parameters, world.now);
        world.actors[index] = Some(Rc::new(Actor {
            agent,
            incarnation,
            pose,
            drive: None,
            hash: 0,
        }));
        let target = Message::Target(Arc::clone(&self.target));
        world.send(None, index, &target);
        let latched: Vec<(usize, Message)> = world
            .latched
            .iter()
            .filter(|((from, _), _)| *from != index)
            .flat_map(|((from, _), messages)| messages.iter().map(|one| (*from, one.clone())))
            .collect();
        for (from, message) in latched {
            world.send(Some(from), index, &message);
        }
        self.input(world, index, Input::Timeout);
    }

    fn take(&self, world: &mut World, step: Step) {
        let now = world.now.as_secs_f64();
        let line = match step {
            Step::Deliver(flight) | Step::Lose(flight) => {
                let flight = &world.flights[flight];
                let verb = if matches!(step, Step::Lose(_)) {
                    "lost"
                } else {
                    "delivered"
                };
                let from = flight.from.map_or(0, |from| from + 1);
                format!(
                    "{now:.1} s {verb} from {from} to {}: {}",
                    flight.to + 1,
                    flight.topic
                )
            }
            Step::RunTimer => format!("{now:.1} s the next timer runs out"),
            other => format!("{now:.1} s {other:?}"),
        };
        world.trail = Some(Rc::new(Trail {
            before: world.trail.take(),
            line,
        }));
        match step {
            Step::Deliver(index) => {
                if index > 0 {
                    world.deviate();
                }
                let flight = world.flights.remove(index);
                let source = flight.from.map(|from| SourceId(from as u128));
                let message = flight.message.clone();
                self.input(world, flight.to, Input::Message { source, message });
            }
            Step::Lose(index) => {
                world.deviate();
                world.flights.remove(index);
            }
            Step::RunTimer => {
                if !world.flights.is_empty() {
                    world.deviate();
                }
                self.run_timer(world);
            }
            Step::Crash(index) => {
                world.strike();
                world.remove(index);
            }
            Step::CrashAndRestart(index) => {
                world.strike();
                // The body keeps its pose and links; what the process knew is gone.
                world.agenda = Some((world.now + DOWN, Agenda::Restart(index)));
                world.flights.retain(|flight| flight.to != index);
            }
            Step::CutOff(index) => {
                world.strike();
                world.cut = Some(index);
                world.agenda = Some((world.now + CUT, Agenda::Heal));
            }
        }
        world.judge();
    }

    fn run_timer(&self, world: &mut World) {
        let actor_due = (0..MODULES)
            .filter(|&index| !world.is_down(index))
            .filter_map(|index| Some((world.actors[index].as_ref()?.due(), index)))
            .min();
        if let Some((at, agenda)) = world.agenda
            && actor_due.is_none_or(|(due, _)| at <= due)
        {
            world.now = world.now.max(at);
            world.agenda = None;
            world.disturbed = world.now;
            match agenda {
                Agenda::Heal => {
                    world.cut = None;
                    let held = std::mem::take(&mut world.held);
                    world.flights.extend(held);
                }
                Agenda::Restart(index) => {
                    let old = world.actors[index].take().unwrap();
                    world.remove(index);
                    let body = (old.pose, old.agent.links().clone());
                    self.launch(world, index, Incarnation(old.incarnation.0 + 1), Some(body));
                }
            }
            return;
        }
        let Some((due, index)) = actor_due else {
            return;
        };
        world.now = world.now.max(due);
        let now = world.now;
        let actor = Rc::make_mut(world.actors[index].as_mut().unwrap());
        let input = match actor.drive {
            Some((goal, arrives, told, _)) if arrives <= now => {
                actor.drive = None;
                // A drive stops when goals cease to repeat.
                if arrives > told + self.parameters.lease {
                    Input::Motion(MotionReport::Halted(actor.pose))
                } else {
                    actor.pose = goal.pose;
                    Input::Motion(MotionReport::Arrived(goal.pose))
                }
            }
            _ => Input::Timeout,
        };
        self.input(world, index, input);
    }

    fn input(&self, world: &mut World, index: usize, input: Input) {
        let now = world.now;
        let mut inputs = vec![input];
        while let Some(input) = inputs.pop() {
            let Some(actor) = world.actors[index].as_mut() else {
                return;
            };
            let actor = Rc::make_mut(actor);
            actor.agent.handle(now, input);
            let mut published = Vec::new();
            let mut moved = None;
            while let Some(output) = actor.agent.poll_output() {
                match output {
                    Output::Publish(message) => published.push(message),
                    Output::Move(goal) => {
                        let plan = actor.agent.epoch().zip(actor.agent.digest());
                        let arrives = match actor.drive {
                            Some((same, arrives, ..)) if same.pose == goal.pose => arrives,
                            _ => now + JOURNEY,
                        };
                        actor.drive = Some((goal, arrives, now, plan));
                        moved = Some(plan);
                    }
                    Output::Halt => {
                        actor.drive = None;
                        let report = MotionReport::Halted(actor.pose);
                        actor.agent.handle(now, Input::Motion(report));
                    }
                    Output::Dock(other) => {
                        let report = MotionReport::Docked(other);
                        actor.agent.handle(now, Input::Motion(report));
                    }
                    Output::Undock(other) => {
                        let report = MotionReport::Undocked(other);
                        actor.agent.handle(now, Input::Motion(report));
                    }
                    Output::Event(_) => {}
                }
            }
            actor.hash = hash_of(&(
                actor.agent.fingerprint(),
                actor.incarnation,
                actor.pose,
                &actor.drive,
            ));
            for message in published {
                world.publish(index, &message);
            }
            if let Some(plan) = moved {
                world.set_off(index, plan, self.parameters.lease);
            }
        }
    }
}

fn told(trail: Option<&Rc<Trail>>) -> String {
    let mut lines = Vec::new();
    let mut next = trail;
    while let Some(trail) = next {
        lines.push(trail.line.as_str());
        next = trail.before.as_ref();
    }
    lines.reverse();
    lines.join("\n")
}

impl Actor {
    fn due(&self) -> Duration {
        let timeout = self.agent.poll_timeout();
        self.drive
            .map_or(timeout, |(_, arrives, ..)| arrives.min(timeout))
    }
}

impl World {
    fn hash(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.now.hash(&mut hasher);
        for actor in &self.actors {
            actor.as_ref().map(|actor| actor.hash).hash(&mut hasher);
        }
        for flights in [&self.flights, &self.held] {
            flights.len().hash(&mut hasher);
            for flight in flights {
                (flight.from, flight.to, flight.hash).hash(&mut hasher);
            }
        }
        (self.cut, self.agenda, self.deviations, self.fault).hash(&mut hasher);
        (self.disturbed, self.ended_since).hash(&mut hasher);
        hash_of(&self.evidence).hash(&mut hasher);
        hasher.finish()
    }

    fn is_down(&self, index: usize) -> bool {
        matches!(self.agenda, Some((_, Agenda::Restart(down))) if down == index)
    }

    fn remove(&mut self, index: usize) {
        self.actors[index] = None;
        self.flights.retain(|flight| flight.to != index);
        self.latched.retain(|(from, _), _| *from != index);
        self.heartbeats.remove(&index);
        self.states.remove(&index);
        Rc::make_mut(&mut self.evidence).in_epoch.remove(&id(index));
    }

    fn deviate(&mut self) {
        self.deviations -= 1;
        self.disturbed = self.now;
    }

    fn strike(&mut self) {
        self.fault = false;
        self.disturbed = self.now;
    }

    fn choices(&self, bound: Bound) -> Vec<Step> {
        let mut steps = Vec::new();
        let in_time = self.now < bound.until;
        let deviates = self.deviations > 0 && in_time;
        let mut channels = BTreeSet::new();
        for (index, flight) in self.flights.iter().enumerate() {
            let first = channels.insert((flight.from, flight.to, flight.topic));
            if index == 0 || (deviates && first) {
                steps.push(Step::Deliver(index));
            }
            if deviates && flight.topic == HEARTBEATS {
                steps.push(Step::Lose(index));
            }
        }
        if self.flights.is_empty() || deviates {
            steps.push(Step::RunTimer);
        }
        if self.fault && in_time {
            for index in 0..MODULES {
                steps.push(Step::Crash(index));
                steps.push(Step::CrashAndRestart(index));
                steps.push(Step::CutOff(index));
            }
        }
        steps
    }

    fn send(&mut self, from: Option<usize>, to: usize, message: &Message) {
        if self.actors[to].is_none() || self.is_down(to) {
            return;
        }
        let topic = topic_of(message);
        let flight = Rc::new(Flight {
            from,
            to,
            topic,
            message: message.clone(),
            hash: hash_of(message),
        });
        let severed = self
            .cut
            .is_some_and(|cut| from.is_some() && (from == Some(cut)) != (to == cut));
        if !severed {
            self.flights.push(flight);
        } else if topic != HEARTBEATS {
            // Only the latest of a latched topic gets through when the cut ends; of claims, all.
            if topic != CLAIMS {
                self.held
                    .retain(|held| (held.from, held.to, held.topic) != (from, to, topic));
            }
            self.held.push(flight);
        }
    }

    fn publish(&mut self, index: usize, message: &Message) {
        let topic = topic_of(message);
        if topic != HEARTBEATS {
            let latched = self.latched.entry((index, topic)).or_default();
            if topic != CLAIMS {
                latched.clear();
            }
            latched.push(message.clone());
        }
        self.note(index, message);
        for to in (0..MODULES).filter(|&to| to != index) {
            self.send(Some(index), to, message);
        }
    }

    fn note(&mut self, index: usize, message: &Message) {
        let (now, module) = (self.now, id(index));
        let evidence = Rc::make_mut(&mut self.evidence);
        match message {
            Message::Heartbeat(heartbeat) => {
                self.heartbeats.insert(index, *heartbeat);
                let entry = evidence
                    .in_epoch
                    .entry(module)
                    .or_insert((heartbeat.epoch, now));
                if entry.0 > heartbeat.epoch {
                    self.violation = Some(format!("{module} went back from {:?}", entry.0));
                }
                if entry.0 != heartbeat.epoch {
                    *entry = (heartbeat.epoch, now);
                }
                if let Some(plan) = heartbeat.epoch.zip(heartbeat.digest) {
                    evidence
                        .shown
                        .entry(plan)
                        .or_default()
                        .entry(module)
                        .or_insert(now);
                }
            }
            Message::Roster(RosterMessage::Plan(roster)) => {
                let members: Vec<_> = roster
                    .members
                    .iter()
                    .map(|member| member.module.id)
                    .collect();
                if !evidence.allows(&members) {
                    self.violation = Some(format!("a minority plans {}", roster.epoch));
                }
                if evidence.rosters.insert(roster.epoch, members).is_some() {
                    self.violation = Some(format!("two rosters for {}", roster.epoch));
                }
                // What came long before no longer matters.
                while evidence.rosters.len() > 4 {
                    evidence.rosters.pop_first();
                }
                let oldest = evidence.rosters.keys().next().copied();
                evidence
                    .shown
                    .retain(|(epoch, _), _| Some(*epoch) >= oldest);
                evidence.begun.retain(|(epoch, _)| Some(*epoch) >= oldest);
                evidence
                    .settled
                    .retain(|(epoch, ..), _| Some(*epoch) >= oldest);
            }
            Message::ModuleState(state) => {
                self.states.insert(index, Arc::clone(state));
                if let (ModulePhase::Settled, Some(epoch), Some(digest), Some(spot)) =
                    (state.phase, state.epoch, state.digest, state.spot)
                {
                    let holder = *evidence
                        .settled
                        .entry((epoch, digest, spot))
                        .or_insert(module);
                    if holder != module {
                        self.violation = Some(format!("{holder} and {module} both on {spot}"));
                    }
                }
            }
            _ => {}
        }
    }

    /// A drive is told to go, or to go on.
    fn set_off(&mut self, index: usize, plan: Option<PlanKey>, lease: Duration) {
        let module = id(index);
        let now = self.now;
        let Some(plan) = plan else {
            self.violation = Some(format!("{module} moves without a plan"));
            return;
        };
        for (other, actor) in self.actors.iter().enumerate() {
            let Some((_, arrives, told, others)) = actor.as_ref().and_then(|actor| actor.drive)
            else {
                continue;
            };
            let still_going = arrives > now && told + lease >= now && !self.is_down(other);
            if still_going && other != index && others != Some(plan) {
                self.violation = Some(format!(
                    "{module} and {} move on different plans",
                    id(other)
                ));
            }
        }
        let evidence = Rc::make_mut(&mut self.evidence);
        let shown = evidence.shown.get(&plan).cloned().unwrap_or_default();
        let members = evidence.rosters.get(&plan.0).cloned().unwrap_or_default();
        if members.is_empty() || members.iter().any(|member| !shown.contains_key(member)) {
            self.violation = Some(format!("{module} moves before all have agreed"));
            return;
        }
        let last = shown.values().max().copied().unwrap_or_default();
        if evidence.begun.insert(plan) && now < last + lease {
            self.violation = Some(format!("{module} sets off before the lease has passed"));
        }
        // Heartbeats take no time here unless a timer overtakes them, which a second covers.
        let margin = Duration::from_secs(1);
        for member in members {
            if let Some(&(epoch, since)) = evidence.in_epoch.get(&member)
                && epoch != Some(plan.0)
                && now > since + lease + margin
            {
                self.violation = Some(format!("{module} moves long after {member} left"));
            }
        }
    }

    /// Notes whether everything has come to its end, and whether it should have by now.
    fn judge(&mut self) {
        let live: Vec<usize> = (0..MODULES)
            .filter(|&index| self.actors[index].is_some())
            .collect();
        let plans: BTreeSet<_> = live
            .iter()
            .filter_map(|index| self.heartbeats.get(index))
            .map(|heartbeat| (heartbeat.epoch, heartbeat.digest))
            .collect();
        let spots: BTreeSet<_> = live
            .iter()
            .filter_map(|index| self.states.get(index))
            .filter(|state| state.phase == ModulePhase::Settled)
            .filter(|state| plans.contains(&(state.epoch, state.digest)))
            .filter_map(|state| state.spot)
            .collect();
        let ended = self.agenda.is_none() && plans.len() == 1 && spots.len() == live.len();
        self.ended_since = match self.ended_since {
            Some(since) if ended => Some(since),
            _ => ended.then_some(self.now),
        };
        if !ended && self.agenda.is_none() && self.now > self.disturbed + PATIENCE {
            let phases: Vec<_> = live
                .iter()
                .filter_map(|index| self.heartbeats.get(index))
                .map(|heartbeat| (heartbeat.module.0, heartbeat.phase))
                .collect();
            self.violation = Some(format!("no end: {phases:?}"));
        }
    }

    fn has_ended(&self, bound: Bound) -> bool {
        let undisturbed = self.now >= bound.until || (self.deviations == 0 && !self.fault);
        self.ended_since
            .is_some_and(|since| undisturbed && self.now >= since.max(self.disturbed) + CALM)
    }
}
