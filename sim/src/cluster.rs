//! The cluster: agents with simulated drives, the events between them, and the faults that strike them.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, VecDeque};
use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Duration;

use formation::agent::{
    Agent, AgentParameters, Command, Event, Identity, Input, MotionReport, Output, SourceId,
};
use formation::generate::Random;
use formation::geometry::Pose;
use formation::id::{Digest, Epoch, Incarnation, ModuleId, SpotId};
use formation::message::{Decision, Message, ModulePhase, SpotClaim, TargetAnnouncement};
use formation::motion::SimulatedDrive;
use formation::problem::PlanningProblem;

use crate::network::{Channel, Network, NetworkParameters, Participant, Topic};
use crate::process::{AgentFactory, Process};

/// How a cluster is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClusterParameters {
    /// The agents' time limits.
    pub agent: AgentParameters,
    /// How the network treats messages.
    pub network: NetworkParameters,
    /// The speed of the simulated drives.
    pub speed_units_per_s: f64,
    /// How often a drive reports its pose.
    pub drive_tick: Duration,
    /// The processes start within this time of each other.
    pub start_spread: Duration,
}

impl Default for ClusterParameters {
    fn default() -> Self {
        Self {
            agent: AgentParameters::default(),
            network: NetworkParameters::default(),
            speed_units_per_s: 5.0,
            drive_tick: Duration::from_millis(100),
            start_spread: Duration::from_millis(500),
        }
    }
}

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
    /// A fault struck, or ended.
    Fault(String),
}

enum Happening {
    Start(ModuleId),
    Deliver {
        channel: Channel,
        /// The incarnation of the reader for which it is meant; a restarted reader asks anew.
        reader: Incarnation,
        sample: u64,
        message: Message,
    },
    Timeout(ModuleId, Incarnation),
    DriveTick(ModuleId, Incarnation),
}

struct Scheduled {
    at: Duration,
    order: u64,
    happening: Happening,
}

impl PartialEq for Scheduled {
    fn eq(&self, other: &Self) -> bool {
        (self.at, self.order) == (other.at, other.order)
    }
}
impl Eq for Scheduled {}
impl PartialOrd for Scheduled {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Scheduled {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (self.at, self.order).cmp(&(other.at, other.order))
    }
}

/// What outlives a process: the module's body.
#[derive(Clone)]
struct Remains {
    identity: Identity,
}

/// Many agents under virtual time.
pub struct Cluster {
    agents: AgentFactory,
    parameters: ClusterParameters,
    now: Duration,
    order: u64,
    queue: BinaryHeap<Reverse<Scheduled>>,
    network: Network,
    random: Random,
    processes: BTreeMap<ModuleId, Process>,
    remains: BTreeMap<ModuleId, Remains>,
    announcement: Option<Arc<TargetAnnouncement>>,
    /// The modules whose processes start later than the others.
    late: BTreeMap<ModuleId, Duration>,
    forges_claims: bool,
    samples: u64,
    /// Samples that could not pass a cut, in the order of writing.
    held: BTreeMap<Channel, Vec<(u64, Message)>>,
    /// The newest sample written on a depth-1 channel, so that readers may skip older ones.
    newest: BTreeMap<(Participant, Topic), u64>,
    observations: Vec<(Duration, Observation)>,
    transcript: Option<String>,
}

impl Cluster {
    /// A cluster of the modules of a problem; nothing runs before [`Self::step`].
    #[must_use]
    pub fn new(problem: &PlanningProblem, parameters: ClusterParameters, seed: u64) -> Self {
        Self::of_agents(problem, parameters, seed, AgentFactory::default())
    }

    /// The same, of agents made in another way.
    #[must_use]
    pub fn of_agents(
        problem: &PlanningProblem,
        parameters: ClusterParameters,
        seed: u64,
        agents: AgentFactory,
    ) -> Self {
        let mut random = Random::from_seed(seed);
        let network_seed = random.below(u64::MAX);
        let mut cluster = Self {
            agents,
            parameters,
            now: Duration::ZERO,
            order: 0,
            queue: BinaryHeap::new(),
            network: Network::new(parameters.network, Random::from_seed(network_seed)),
            random,
            processes: BTreeMap::new(),
            remains: BTreeMap::new(),
            announcement: None,
            late: BTreeMap::new(),
            forges_claims: false,
            samples: 0,
            held: BTreeMap::new(),
            newest: BTreeMap::new(),
            observations: Vec::new(),
            transcript: None,
        };
        for module in problem.modules() {
            cluster.remains.insert(
                module.id,
                Remains {
                    identity: Identity {
                        module: module.id,
                        incarnation: Incarnation(0),
                        pose: module.pose,
                        links: module.links.clone(),
                        configuration: module.configuration,
                        leader: module.leader,
                    },
                },
            );
            let spread = u64::try_from(parameters.start_spread.as_micros()).unwrap_or(0);
            let at = Duration::from_micros(cluster.random.below(spread.max(1)));
            cluster.schedule(at, Happening::Start(module.id));
        }
        cluster
    }

    /// Keeps a readable account of the run from now on.
    pub fn keep_transcript(&mut self) {
        self.transcript = Some(String::new());
    }

    /// The readable account so far.
    #[must_use]
    pub fn transcript(&self) -> &str {
        self.transcript.as_deref().unwrap_or_default()
    }

    /// The time in the cluster.
    #[must_use]
    pub fn now(&self) -> Duration {
        self.now
    }

    /// Announces a target, as its publisher would.
    pub fn announce(&mut self, announcement: TargetAnnouncement) {
        let announcement = Arc::new(announcement);
        self.announcement = Some(Arc::clone(&announcement));
        self.broadcast(
            Participant::TargetPublisher,
            Topic::Target,
            &Message::Target(announcement),
        );
    }

    /// Announces the problem's own target to all of its modules.
    pub fn announce_problem(&mut self, problem: &PlanningProblem, revision: u64) {
        self.announce(TargetAnnouncement {
            revision,
            name: String::new(),
            target: Some(Arc::clone(problem.target())),
            parameters: *problem.parameters(),
            expected_modules: u32::try_from(problem.modules().len()).ok(),
        });
    }

    /// What was announced last, if anything.
    #[must_use]
    pub fn announcement(&self) -> Option<&Arc<TargetAnnouncement>> {
        self.announcement.as_ref()
    }

    /// Lets a module's process start no earlier than `at`; for calls before the first step.
    pub fn start_late(&mut self, module: ModuleId, at: Duration) {
        self.late.insert(module, at);
    }

    /// Tells a module to leave the formation or to take part again.
    pub fn command(&mut self, module: ModuleId, command: Command) {
        if self.processes.contains_key(&module) {
            self.fault(format!(
                "{module} is told to {}",
                match command {
                    Command::Retire => "retire",
                    Command::Rejoin => "rejoin",
                }
            ));
            self.input(module, Input::Command(command));
        }
    }

    /// Breaks or mends a module's drive: a broken one fails as soon as it is to go. A new process has a new drive.
    pub fn break_drive(&mut self, module: ModuleId, broken: bool) {
        if let Some(process) = self.processes.get_mut(&module) {
            process.drive_broken = broken;
            self.fault(format!(
                "the drive of {module} is {}",
                if broken { "broken" } else { "mended" }
            ));
        }
    }

    /// From now on, some claims are preceded by a forged one that claims something else for the same turn. It reaches
    /// half of the readers, from a sender that the transport does not tell.
    pub fn forge_claims(&mut self) {
        self.forges_claims = true;
        self.fault("somebody forges claims".to_owned());
    }

    fn forge(&mut self, claim: &SpotClaim) {
        if !self.forges_claims || self.random.below(3) > 0 || claim.decision.selections.is_empty() {
            return;
        }
        let forged = Arc::new(SpotClaim {
            decision: Decision::default(),
            ..claim.clone()
        });
        let readers: Vec<ModuleId> = self.processes.keys().copied().collect();
        for reader in readers {
            if reader != claim.claimant && self.random.below(2) == 0 {
                let message = Message::Claim(Arc::clone(&forged));
                self.input(
                    reader,
                    Input::Message {
                        source: None,
                        message,
                    },
                );
            }
        }
    }

    /// Makes each input keep a process busy for `lag`, for a while.
    pub fn slow_down(&mut self, module: ModuleId, lag: Duration, span: Duration) {
        let until = self.now + span;
        if let Some(process) = self.processes.get_mut(&module) {
            process.slow = Some((until, lag));
            self.fault(format!(
                "{module} needs {} ms for each input",
                lag.as_millis()
            ));
        }
    }

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

    /// Ends a module's process without warning; its body stays, halted and docked as it is.
    pub fn crash(&mut self, module: ModuleId) {
        let Some(mut process) = self.processes.remove(&module) else {
            return;
        };
        let now = process.local(self.now);
        process.drive.halt(now);
        if let Some(remains) = self.remains.get_mut(&module) {
            remains.identity.pose = process.drive.pose();
            remains.identity.links = process.agent.links().clone();
        }
        self.network.forget(module);
        self.held.retain(|channel, _| {
            channel.from != Participant::Module(module) && channel.to != module
        });
        self.fault(format!("{module} crashes"));
    }

    /// Starts a module's process again, as a new incarnation.
    pub fn restart(&mut self, module: ModuleId) {
        // One that has yet to start for the first time starts in its own time.
        if !self.processes.contains_key(&module) && !self.late.contains_key(&module) {
            self.fault(format!("{module} starts again"));
            self.schedule(self.now, Happening::Start(module));
        }
    }

    /// Stops a process for a while; what reaches it waits and comes all at once.
    pub fn pause(&mut self, module: ModuleId, duration: Duration) {
        let until = self.now + duration;
        let incarnation = if let Some(process) = self.processes.get_mut(&module) {
            process.held_until = process.held_until.max(until);
            process.incarnation
        } else {
            return;
        };
        self.fault(format!(
            "{module} stands still for {} ms",
            duration.as_millis()
        ));
        self.schedule(until, Happening::Timeout(module, incarnation));
    }

    /// Cuts these modules off from all others.
    pub fn cut(&mut self, aside: &BTreeSet<ModuleId>) {
        self.network.cut(aside);
        let names: Vec<String> = aside.iter().map(|module| module.0.to_string()).collect();
        self.fault(format!("cut off: {}", names.join(", ")));
    }

    /// Ends the cut; reliable messages that were held are sent again.
    pub fn heal(&mut self) {
        self.network.heal();
        self.fault("the network is whole again".to_owned());
        for (channel, samples) in std::mem::take(&mut self.held) {
            for (sample, message) in samples {
                self.send(channel, sample, message);
            }
        }
    }

    fn fault(&mut self, what: String) {
        self.observe(Observation::Fault(what));
    }

    /// Lets the next thing happen; `false` when nothing is left to happen before `limit`.
    pub fn step(&mut self, limit: Duration) -> bool {
        match self.queue.peek() {
            Some(Reverse(next)) if next.at <= limit => {}
            _ => {
                self.now = self.now.max(limit);
                return false;
            }
        }
        if let Some(Reverse(next)) = self.queue.pop() {
            self.now = next.at;
            self.happen(next.happening);
        }
        true
    }

    /// Runs until `done` holds, or `limit` has come; tells whether it holds.
    pub fn run_until(&mut self, limit: Duration, mut done: impl FnMut(&Self) -> bool) -> bool {
        while !done(self) {
            if !self.step(limit) {
                return done(self);
            }
        }
        true
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

    fn schedule(&mut self, at: Duration, happening: Happening) {
        self.order += 1;
        self.queue.push(Reverse(Scheduled {
            at,
            order: self.order,
            happening,
        }));
    }

    fn happen(&mut self, happening: Happening) {
        match happening {
            Happening::Start(module) => self.start(module),
            Happening::Deliver {
                channel,
                reader,
                sample,
                message,
            } => {
                let skipped = channel.topic.depth() == 1
                    && self
                        .newest
                        .get(&(channel.from, channel.topic))
                        .is_some_and(|&newest| newest > sample)
                    && self.random.below(2) == 0;
                let current = self
                    .processes
                    .get(&channel.to)
                    .map(|process| process.incarnation);
                if !skipped && current == Some(reader) {
                    let source = match channel.from {
                        Participant::TargetPublisher => None,
                        Participant::Module(module) => Some(SourceId(u128::from(module.0))),
                    };
                    self.input(channel.to, Input::Message { source, message });
                }
            }
            Happening::Timeout(module, incarnation) => {
                let due = self.processes.get_mut(&module).is_some_and(|process| {
                    let mine = process.incarnation == incarnation;
                    if mine {
                        process.timeout_at = None;
                    }
                    mine
                });
                if due {
                    self.input(module, Input::Timeout);
                }
            }
            Happening::DriveTick(module, incarnation) => self.tick_drive(module, incarnation),
        }
    }

    fn start(&mut self, module: ModuleId) {
        if let Some(at) = self.late.remove(&module)
            && at > self.now
        {
            self.schedule(at, Happening::Start(module));
            return;
        }
        let Some(remains) = self.remains.get_mut(&module) else {
            return;
        };
        remains.identity.incarnation.0 += 1;
        let identity = remains.identity.clone();
        let incarnation = identity.incarnation;
        let clock_offset = Duration::from_micros(self.random.below(1_000_000_000));
        let drift = i64::try_from(self.random.below(401)).unwrap_or(0) - 200;
        let mut process = Process {
            drive: SimulatedDrive::new(
                identity.pose,
                self.parameters.speed_units_per_s,
                self.parameters.agent.lease,
            ),
            agent: self
                .agents
                .make(identity, self.parameters.agent, Duration::ZERO),
            incarnation,
            driven_by: None,
            clock_offset,
            clock_drift_ppm: drift,
            timeout_at: None,
            ticking: false,
            held_until: Duration::ZERO,
            slow: None,
            waiting: VecDeque::new(),
            drive_broken: false,
            knows_target: false,
            target_revision: 0,
            history: BTreeMap::new(),
        };
        let local = process.local(self.now);
        process.agent = self
            .agents
            .make(remains.identity.clone(), self.parameters.agent, local);
        self.processes.insert(module, process);
        self.catch_up(module);
        self.input(module, Input::Timeout);
    }

    /// Sends a new reader what the writers keep for those who come late.
    fn catch_up(&mut self, reader: ModuleId) {
        let mut kept = Vec::new();
        if let Some(announcement) = &self.announcement {
            let message = Message::Target(Arc::clone(announcement));
            let writer = (Participant::TargetPublisher, Topic::Target);
            let sample = self.newest.get(&writer).copied().unwrap_or_default();
            kept.push((writer.0, writer.1, sample, message));
        }
        for (&writer, process) in &self.processes {
            if writer == reader {
                continue;
            }
            for (&topic, samples) in &process.history {
                for (sample, message) in samples {
                    kept.push((Participant::Module(writer), topic, *sample, message.clone()));
                }
            }
        }
        for (from, topic, sample, message) in kept {
            self.send(
                Channel {
                    from,
                    to: reader,
                    topic,
                },
                sample,
                message,
            );
        }
    }

    fn input(&mut self, module: ModuleId, input: Input) {
        let now = self.now;
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        let is_timeout = matches!(input, Input::Timeout);
        if !is_timeout || process.waiting.is_empty() {
            process.waiting.push_back(input);
        }
        while let Some(process) = self.processes.get_mut(&module) {
            if now < process.held_until {
                // A time-out is no thing that waits: the process looks at its clock when it goes on.
                process
                    .waiting
                    .retain(|input| !matches!(input, Input::Timeout));
                break;
            }
            let Some(input) = process.waiting.pop_front() else {
                break;
            };
            if let Some((until, lag)) = process.slow {
                if now < until {
                    process.held_until = now + lag;
                } else {
                    process.slow = None;
                }
            }
            if let Input::Message {
                message: Message::Target(announcement),
                ..
            } = &input
            {
                process.knows_target = announcement.target.is_some();
                process.target_revision = announcement.revision;
            }
            let local = process.local(now);
            process.agent.handle(local, input);
            self.drain(module);
        }
        self.reschedule_timeout(module);
    }

    fn reschedule_timeout(&mut self, module: ModuleId) {
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        let mut due = process.global(process.agent.poll_timeout());
        if !process.waiting.is_empty() {
            due = process.held_until;
        }
        let at = due.max(process.held_until).max(self.now);
        if process.timeout_at.is_none_or(|scheduled| at < scheduled) {
            process.timeout_at = Some(at);
            let incarnation = process.incarnation;
            self.schedule(at, Happening::Timeout(module, incarnation));
        }
    }

    fn drain(&mut self, module: ModuleId) {
        while let Some(process) = self.processes.get_mut(&module) {
            let Some(output) = process.agent.poll_output() else {
                return;
            };
            let local = process.local(self.now);
            match output {
                Output::Publish(message) => self.publish(module, &message),
                Output::Event(event) => self.observe(Observation::Noted(module, event)),
                Output::Move(goal) => {
                    let plan = process.agent.epoch().zip(process.agent.digest());
                    if process.drive_broken {
                        process
                            .agent
                            .handle(local, Input::Motion(MotionReport::Failed));
                        continue;
                    }
                    process.driven_by = plan;
                    process.drive.go(local, goal);
                    let incarnation = process.incarnation;
                    let starts = !std::mem::replace(&mut process.ticking, true);
                    self.observe(Observation::SetOff(module, plan));
                    if starts {
                        let at = self.now + self.parameters.drive_tick;
                        self.schedule(at, Happening::DriveTick(module, incarnation));
                    }
                }
                Output::Halt => {
                    let report = process.drive.halt(local);
                    process.agent.handle(local, Input::Motion(report));
                }
                Output::Dock(other) => {
                    let report = Input::Motion(MotionReport::Docked(other));
                    process.agent.handle(local, report);
                }
                Output::Undock(other) => {
                    let report = Input::Motion(MotionReport::Undocked(other));
                    process.agent.handle(local, report);
                }
            }
        }
    }

    fn tick_drive(&mut self, module: ModuleId, incarnation: Incarnation) {
        let Some(process) = self.processes.get_mut(&module) else {
            return;
        };
        if process.incarnation != incarnation {
            return;
        }
        let local = process.local(self.now);
        let report = process.drive.advance(local);
        process.ticking = process.drive.is_moving();
        if process.ticking {
            let at = self.now + self.parameters.drive_tick;
            self.schedule(at, Happening::DriveTick(module, incarnation));
        }
        if let Some(report) = report {
            self.input(module, Input::Motion(report));
        }
    }

    fn publish(&mut self, module: ModuleId, message: &Message) {
        let topic = match message {
            Message::Target(_) => Topic::Target,
            Message::ModuleState(_) => Topic::ModuleStates,
            Message::Roster(_) => Topic::Roster,
            Message::Claim(_) => Topic::Claims,
            Message::Eviction(_) => Topic::Evictions,
            Message::Heartbeat(_) => Topic::Heartbeats,
        };
        self.observe(Observation::Published(module, message.clone()));
        self.broadcast(Participant::Module(module), topic, message);
        if let Message::Claim(claim) = message {
            self.forge(claim);
        }
    }

    fn broadcast(&mut self, from: Participant, topic: Topic, message: &Message) {
        self.samples += 1;
        let sample = self.samples;
        self.newest.insert((from, topic), sample);
        if let Participant::Module(writer) = from
            && topic.depth() > 0
            && let Some(process) = self.processes.get_mut(&writer)
        {
            let history = process.history.entry(topic).or_default();
            history.push((sample, message.clone()));
            let excess = history.len().saturating_sub(topic.depth());
            history.drain(..excess);
        }
        let readers: Vec<ModuleId> = self
            .processes
            .keys()
            .copied()
            .filter(|&reader| from != Participant::Module(reader))
            .collect();
        for to in readers {
            self.send(Channel { from, to, topic }, sample, message.clone());
        }
    }

    fn send(&mut self, channel: Channel, sample: u64, message: Message) {
        let Some(reader) = self
            .processes
            .get(&channel.to)
            .map(|process| process.incarnation)
        else {
            return;
        };
        if !self.network.connects(channel.from, channel.to) {
            if channel.topic.is_reliable() {
                let held = self.held.entry(channel).or_default();
                held.push((sample, message));
                let excess = held.len().saturating_sub(channel.topic.depth());
                held.drain(..excess);
            }
            return;
        }
        for at in self.network.arrivals(self.now, channel) {
            self.schedule(
                at,
                Happening::Deliver {
                    channel,
                    reader,
                    sample,
                    message: message.clone(),
                },
            );
        }
    }

    fn observe(&mut self, observation: Observation) {
        if let Some(transcript) = &mut self.transcript {
            let line = crate::transcript::line(self.now, &observation);
            if let Some(line) = line {
                let _ = writeln!(transcript, "{line}");
            }
        }
        self.observations.push((self.now, observation));
    }
}
