//! Robots whose localisation is noisy, late and jumps: a verdict says of contacts what is true.
//!
//! This shares nothing with the simulator: agents with the drives of external robots, a robot that goes by its measured pose, and the
//! bodies where they are, compared every hundredth of a second.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use formation_generate::{GeneratorParameters, Grouping, Random, generate_apart};
use formation_model::{
    DockingAction, DockingResult, Message, ModuleId, PlanningProblem, Pose, Scenario, SourceId,
    TargetAnnouncement,
};
use formation_motion::{DriveCommand, ExternalDrive, ExternalParameters};
use formation_protocol::{Agent, Input, Mutation, Output};
use formation_verify::{Observer, ObserverParameters, Outcome, Violation};

use crate::support::agent;

const TICK: Duration = Duration::from_millis(10);
const POSE_INTERVAL: Duration = Duration::from_millis(50);
/// A robot goes on for this long when its goal does not repeat.
const PATIENCE: Duration = Duration::from_millis(1_500);
const SPEED_UNITS_PER_S: f64 = 1.0;
const TURN_RADIANS_PER_S: f64 = 2.0;
const LIMIT: Duration = Duration::from_secs(150);
/// Bodies are 0.9 units wide.
const HALF_WIDTH: f64 = 0.45;
/// The verifier takes the pose of each of two bodies for right within 0.05 units, and each may be measured off by as much: a deeper
/// overlap cannot be explained away.
const SURE: f64 = 0.2;

/// Robots form with this much noise and the default tolerances: half of what a module may be off its goal.
const WITHIN_TOLERANCE: f64 = 0.01;

/// x, y and heading.
type Place = [f64; 3];

fn place(pose: &Pose) -> Place {
    [pose.x, pose.y, pose.theta].map(|part| part.to_units())
}

struct Robot {
    body: Place,
    measured: Place,
    goal: Option<(Place, Duration)>,
    jump: Option<(Duration, Duration, [f64; 2])>,
}

struct Localisation {
    deviation: f64,
    delay: Duration,
}

impl Robot {
    /// The way that it goes towards its goal, by where it believes to be.
    fn step(&self, now: Duration) -> Option<Place> {
        let (goal, _) = self
            .goal
            .filter(|&(_, at)| now.saturating_sub(at) <= PATIENCE)?;
        let seconds = TICK.as_secs_f64();
        let left = [goal[0] - self.measured[0], goal[1] - self.measured[1]];
        let distance = left[0].hypot(left[1]);
        let share = (SPEED_UNITS_PER_S * seconds / distance.max(1e-9)).min(1.0);
        let turn = goal[2] - self.measured[2];
        let turn = turn.sin().atan2(turn.cos());
        let turned = turn.clamp(-TURN_RADIANS_PER_S * seconds, TURN_RADIANS_PER_S * seconds);
        Some([left[0] * share, left[1] * share, turned])
    }

    /// What its localisation shows.
    fn measure(&self, now: Duration, noise: &Localisation, random: &mut Random) -> Place {
        let mut gaussian = || {
            let uniform = |random: &mut Random| random.below(2_001) as f64 / 1_000.0 - 1.0;
            // The sum of three has a deviation of one.
            (0..3).map(|_| uniform(random)).sum::<f64>() * noise.deviation
        };
        let mut shown = [
            self.body[0] + gaussian(),
            self.body[1] + gaussian(),
            self.body[2],
        ];
        if let Some((from, until, by)) = self.jump
            && from <= now
            && now < until
        {
            shown[0] += by[0];
            shown[1] += by[1];
        }
        shown
    }
}

/// By how much two square bodies overlap along the axis on which they do so least; negative if they are apart.
fn depth(one: &Place, other: &Place) -> f64 {
    let axes = |place: &Place| {
        let (sine, cosine) = place[2].sin_cos();
        [[cosine, sine], [-sine, cosine]]
    };
    let reach = |place: &Place, axis: &[f64; 2]| {
        let along = axes(place).map(|side| (side[0] * axis[0] + side[1] * axis[1]).abs());
        (along[0] + along[1]) * HALF_WIDTH
    };
    let all = axes(one).into_iter().chain(axes(other));
    let along = all.map(|axis| {
        let apart = (other[0] - one[0]) * axis[0] + (other[1] - one[1]) * axis[1];
        reach(one, &axis) + reach(other, &axis) - apart.abs()
    });
    along.fold(f64::INFINITY, f64::min)
}

struct World {
    now: Duration,
    agents: BTreeMap<ModuleId, (Agent, ExternalDrive)>,
    robots: BTreeMap<ModuleId, Robot>,
    messages: BTreeMap<(Duration, u64), (ModuleId, Option<SourceId>, Message)>,
    poses: BTreeMap<(Duration, u64), (ModuleId, Place)>,
    results: Vec<(ModuleId, DockingResult)>,
    order: u64,
    observer: Observer,
    random: Random,
    /// The deepest overlap of two bodies that are not docked.
    deepest: f64,
}

impl World {
    fn new(problem: &PlanningProblem, bug: Option<Mutation>, seed: u64) -> Self {
        let mut world = Self {
            now: Duration::ZERO,
            agents: BTreeMap::new(),
            robots: BTreeMap::new(),
            messages: BTreeMap::new(),
            poses: BTreeMap::new(),
            results: Vec::new(),
            order: 0,
            observer: Observer::new(ObserverParameters {
                time_limit: LIMIT,
                ..ObserverParameters::default()
            }),
            random: Random::from_seed(seed),
            deepest: f64::NEG_INFINITY,
        };
        for module in problem.modules() {
            let agent = agent(module);
            let agent = match bug {
                Some(bug) => agent.mutated(bug),
                None => agent,
            };
            let drive = ExternalDrive::new(module.pose, ExternalParameters::default(), 1);
            world.agents.insert(module.id, (agent, drive));
            let body = place(&module.pose);
            let robot = Robot {
                body,
                measured: body,
                goal: None,
                jump: None,
            };
            world.robots.insert(module.id, robot);
        }
        let announcement = Message::Target(
            TargetAnnouncement {
                revision: 1,
                name: String::new(),
                target: Some(problem.target().clone()),
                parameters: *problem.parameters(),
                expected_modules: u32::try_from(problem.modules().len()).ok(),
                voters: Vec::new(),
            }
            .into(),
        );
        world.publish(None, &announcement);
        world
    }

    fn publish(&mut self, from: Option<ModuleId>, message: &Message) {
        let source = from.map(|module| SourceId(u128::from(module.0)));
        let is_lossy = matches!(message, Message::Heartbeat(_));
        self.observer.handle(self.now, message);
        let readers: Vec<ModuleId> = self.agents.keys().copied().collect();
        for reader in readers.into_iter().filter(|&reader| Some(reader) != from) {
            if is_lossy && self.random.below(10) == 0 {
                continue;
            }
            self.order += 1;
            let at = self.now + Duration::from_millis(1 + self.random.below(30));
            let sent = (reader, source, message.clone());
            self.messages.insert((at, self.order), sent);
        }
    }

    fn input(&mut self, module: ModuleId, input: Input) {
        let (agent, _) = self.agents.get_mut(&module).unwrap();
        agent.handle(self.now, input);
        self.carry_out(module);
    }

    fn carry_out(&mut self, module: ModuleId) {
        loop {
            let now = self.now;
            let (agent, drive) = self.agents.get_mut(&module).unwrap();
            if let Some(output) = agent.poll_output() {
                match output {
                    Output::Publish(message) => self.publish(Some(module), &message),
                    Output::Move(goal) => drive.go(now, &goal),
                    Output::Halt => drive.halt(now),
                    Output::Dock(other) => drive.ask(now, DockingAction::Dock, other),
                    Output::Undock(other) => drive.ask(now, DockingAction::Undock, other),
                    _ => {}
                }
                continue;
            }
            if let Some(report) = drive.poll_report() {
                agent.handle(now, Input::Motion(report));
                continue;
            }
            let Some(command) = drive.poll_command() else {
                return;
            };
            match command {
                DriveCommand::Goal(goal) => {
                    self.robots.get_mut(&module).unwrap().goal = Some((place(&goal), now));
                }
                DriveCommand::Docking(request) => {
                    let result = DockingResult {
                        request: request.request,
                        outcome: Ok(()),
                    };
                    self.results.push((module, result));
                }
            }
        }
    }

    fn tick(&mut self, noise: &Localisation) {
        self.now += TICK;
        let now = self.now;
        let modules: Vec<ModuleId> = self.agents.keys().copied().collect();
        self.step_groups();
        if now.as_millis().is_multiple_of(POSE_INTERVAL.as_millis()) {
            for &module in &modules {
                let shown = self.robots[&module].measure(now, noise, &mut self.random);
                self.order += 1;
                self.poses
                    .insert((now + noise.delay, self.order), (module, shown));
            }
        }
        while let Some(next) = self.poses.first_entry().filter(|next| next.key().0 <= now) {
            let (module, shown) = next.remove();
            self.robots.get_mut(&module).unwrap().measured = shown;
            let pose = Pose::from_units(shown[0], shown[1], shown[2]).unwrap();
            self.agents
                .get_mut(&module)
                .unwrap()
                .1
                .handle_pose(now, pose);
            self.carry_out(module);
        }
        for (module, result) in std::mem::take(&mut self.results) {
            let (_, drive) = self.agents.get_mut(&module).unwrap();
            drive.handle_docking_result(now, result);
            self.carry_out(module);
        }
        while let Some(next) = self
            .messages
            .first_entry()
            .filter(|next| next.key().0 <= now)
        {
            let (module, source, message) = next.remove();
            self.input(module, Input::Message { source, message });
        }
        for module in modules {
            let (agent, drive) = self.agents.get_mut(&module).unwrap();
            let is_due = agent.poll_timeout() <= now;
            drive.advance(now);
            if is_due {
                agent.handle(now, Input::Timeout);
            }
            self.carry_out(module);
        }
        self.compare_bodies();
    }

    /// Docked robots move as one body, by the mean of what they want, if all of them do.
    fn step_groups(&mut self) {
        let groups = self.groups();
        let mut wanted: BTreeMap<ModuleId, Vec<Option<Place>>> = BTreeMap::new();
        for (module, robot) in &self.robots {
            wanted
                .entry(groups[module])
                .or_default()
                .push(robot.step(self.now));
        }
        for (module, robot) in &mut self.robots {
            let all: Option<Vec<Place>> = wanted[&groups[module]].iter().copied().collect();
            let Some(all) = all else {
                continue;
            };
            for part in 0..3 {
                let way = all.iter().map(|way| way[part]).sum::<f64>() / all.len() as f64;
                robot.body[part] += way;
                robot.measured[part] += way;
            }
        }
    }

    /// One module of the docked part to which each belongs.
    fn groups(&self) -> BTreeMap<ModuleId, ModuleId> {
        let mut group: BTreeMap<ModuleId, ModuleId> =
            self.agents.keys().map(|&it| (it, it)).collect();
        for (&module, (agent, _)) in &self.agents {
            for &other in agent.links() {
                let (one, other) = (group[&module], group[&other]);
                group
                    .values_mut()
                    .filter(|it| **it == other)
                    .for_each(|it| *it = one);
            }
        }
        group
    }

    fn compare_bodies(&mut self) {
        let group = self.groups();
        let robots: Vec<(ModuleId, Place)> = self
            .robots
            .iter()
            .map(|(&it, robot)| (it, robot.body))
            .collect();
        for (index, (one, body)) in robots.iter().enumerate() {
            for (other, at) in &robots[index + 1..] {
                if group[one] != group[other] {
                    self.deepest = self.deepest.max(depth(body, at));
                }
            }
        }
    }

    fn has_formed(&self) -> bool {
        use formation_model::ModulePhase::{Settled, Spare};
        let mut phases = self.agents.values().map(|(agent, _)| agent.phase());
        phases.all(|phase| matches!(phase, Settled | Spare))
    }
}

struct End {
    outcome: Outcome,
    has_formed: bool,
    /// The deviation of the noise.
    deviation: f64,
    /// The deepest overlap of two bodies that were not docked.
    deepest: f64,
    jumps: bool,
    /// Whether the verdict speaks of a contact, or accuses a module without a bug of having come too early.
    touches: bool,
}

impl End {
    fn check(&self, seed: u64) {
        assert!(!self.touches || self.deepest > 0.0, "{seed}");
        let is_failed = self.outcome == Outcome::Failed;
        assert!(
            self.deepest <= SURE || is_failed,
            "{seed}: {}",
            self.deepest
        );
    }
}

fn run(seed: u64, bug: Option<Mutation>) -> End {
    let mut random = Random::from_seed(seed);
    let modules = 3 + random.index(8);
    let parameters = GeneratorParameters::new(modules, modules, seed).grouped(Grouping::Singletons);
    let raw = generate_apart(&parameters).unwrap();
    let problem = Scenario::try_from(raw).unwrap().problem().clone();
    let mut world = World::new(&problem, bug, seed);
    let noise = Localisation {
        deviation: random.below(21) as f64 / 1_000.0,
        delay: Duration::from_millis(random.below(41)),
    };
    let jumps = random.below(2) == 0;
    if jumps {
        for _ in 0..=random.below(3) {
            let robots: BTreeSet<ModuleId> = world.robots.keys().copied().collect();
            let module = *robots.iter().nth(random.index(robots.len())).unwrap();
            let from = Duration::from_millis(3_000 + random.below(12_000));
            let by = [0, 1].map(|_| random.below(4_001) as f64 / 1_000.0 - 2.0);
            let until = from + Duration::from_millis(50 + random.below(1_500));
            world.robots.get_mut(&module).unwrap().jump = Some((from, until, by));
        }
    }
    let mut formed_at = None;
    while world.now < LIMIT && formed_at.is_none_or(|at| world.now < at + Duration::from_secs(8)) {
        world.tick(&noise);
        let is_formed = world.has_formed();
        formed_at = formed_at
            .or(is_formed.then_some(world.now))
            .filter(|_| is_formed);
    }
    let verdict = world.observer.final_verdict(world.now);
    let touches = verdict.violations.iter().any(|violation| match violation {
        Violation::BodiesOverlap { .. } | Violation::TwoBodies { .. } => true,
        Violation::WaitNotKept { .. } => bug.is_none(),
        _ => false,
    });
    End {
        outcome: verdict.outcome,
        has_formed: formed_at.is_some(),
        deviation: noise.deviation,
        deepest: world.deepest,
        jumps,
        touches,
    }
}

/// Runs with up to 0.02 units of noise and 40 ms of delay, half of them with jumps of up to two units for up to a second and a half.
#[test]
fn of_a_hundred_noisy_runs_none_is_called_a_contact_and_few_are_not_judged() {
    let (mut calm, mut not_judged) = (0, 0);
    let (mut within_tolerance, mut formed) = (0, 0);
    for seed in 0..100 {
        let end = run(seed, None);
        end.check(seed);
        if end.deviation <= WITHIN_TOLERANCE {
            within_tolerance += 1;
            formed += usize::from(end.has_formed);
            assert!(end.deepest <= 0.0, "{seed}: {}", end.deepest);
        }
        if !end.jumps {
            calm += 1;
            not_judged += usize::from(end.outcome == Outcome::NotJudged);
        }
    }
    assert!(not_judged * 20 <= calm, "{not_judged} of {calm}");
    assert!(within_tolerance >= 50, "{within_tolerance}");
    assert!(
        formed + 1 >= within_tolerance,
        "{formed} of {within_tolerance}"
    );
}

#[test]
fn each_contact_that_is_deeper_than_the_stated_uncertainty_fails() {
    let mut contacts = 0;
    for seed in 0..60 {
        let end = run(seed, Some(Mutation::SkipWaits));
        // A pose that jumps is off by more than is stated.
        if !end.jumps {
            end.check(seed);
            contacts += usize::from(end.deepest > SURE);
        }
    }
    assert!(contacts >= 3, "{contacts}");
}
