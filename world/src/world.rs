//! The world: bodies, obstacles and walls, and what happens to them as time passes.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use formation_model::{
    Area, BodyShape, DockingAction, DockingRequest, DockingResult, MicroUnits, ModuleId,
    PlanningProblem, Pose as CorePose,
};
use formation_motion::WorldReport;
use rapier2d::dynamics::{RigidBodyBuilder, RigidBodyHandle};
use rapier2d::geometry::ColliderBuilder;
use rapier2d::math::{Pose, Real, Vector};
use rapier2d::pipeline::{ActiveHooks, PhysicsWorld};

use crate::contacts::{Contacts, DockedBodies, mark_of};
use crate::docking::{Attempt, AttemptStage, Contact, Links, Placed, REACH, docking_place};
use crate::options::WorldOptions;
use crate::plane::{Deviation, deviation, from_core, real, to_core};
use crate::robot::Robot;

/// The step of the physics.
const TICK: Duration = Duration::from_micros(8_000);
/// Poses are measured after this many ticks.
const POSE_TICKS: u64 = 6;
/// When more time passes at once, the world stands still for the rest of it: its process did not run.
const ELAPSED_MAX: Duration = Duration::from_millis(200);
/// Slip is drawn after this many ticks.
const SLIP_TICKS: u64 = 12;

/// The mass of a module. Only ratios matter, and all modules are alike.
const MASS: Real = 1.0;
/// The friction between bodies.
const FRICTION: Real = 0.3;
/// The thickness of walls, in units.
const WALL: f64 = 1.0;

/// Robots as rigid squares, driven and docked by forces. Lengths are in units.
///
/// After [`Self::advance`], drain [`Self::poll_pose`] and [`Self::poll_result`].
pub struct World {
    options: WorldOptions,
    physics: PhysicsWorld,
    robots: Vec<Robot>,
    indices: BTreeMap<ModuleId, usize>,
    links: Links,
    contacts: Contacts,
    report: WorldReport,
    /// The time that has passed, also while the world stood still. Goals and requests age by it.
    clock: Duration,
    ticks: u64,
    /// The time that has passed and is less than a tick.
    rest: Duration,
    /// Measured poses, each with the time at which it is published.
    poses: VecDeque<(Duration, ModuleId, CorePose)>,
    results: VecDeque<(ModuleId, DockingResult)>,
}

impl World {
    /// The modules of a scenario as they start, docked as they are, with its obstacles and walls.
    #[must_use]
    pub fn new(problem: &PlanningProblem, options: WorldOptions) -> Self {
        let surroundings = problem.target().surroundings();
        let mut physics = PhysicsWorld {
            gravity: Vector::ZERO,
            ..PhysicsWorld::default()
        };
        physics.integration_parameters.dt = real(TICK.as_secs_f64());
        for area in surroundings.obstacles() {
            insert_box(&mut physics, area);
        }
        for wall in surroundings.arena().iter().flat_map(walls) {
            insert_box(&mut physics, &wall);
        }
        let half = real(surroundings.body_width().to_units() / 2.0);
        let modules = problem.modules();
        let robots = modules.iter().enumerate().map(|(index, module)| {
            let start = from_core(&module.pose);
            let body = RigidBodyBuilder::dynamic().pose(start).can_sleep(false);
            let collider = match surroundings.body() {
                BodyShape::Square => ColliderBuilder::cuboid(half, half),
                BodyShape::Circle => ColliderBuilder::ball(half),
            };
            let collider = collider
                .mass(MASS)
                .friction(FRICTION)
                .user_data(mark_of(index))
                .active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS);
            let (body, _) = physics.insert(body, collider);
            Robot::new(module.id, body, start, &options)
        });
        let robots: Vec<Robot> = robots.collect();
        let ids = modules.iter().map(|module| module.id);
        let indices: BTreeMap<ModuleId, usize> = ids.zip(0..).collect();
        let mut world = Self {
            links: Links::new(robots.len()),
            options,
            physics,
            robots,
            indices,
            contacts: Contacts::default(),
            report: WorldReport::default(),
            clock: Duration::ZERO,
            ticks: 0,
            rest: Duration::ZERO,
            poses: VecDeque::new(),
            results: VecDeque::new(),
        };
        let placed = world.placed();
        for (index, module) in modules.iter().enumerate() {
            let others = module
                .links
                .iter()
                .filter_map(|link| world.indices.get(link));
            for &other in others.filter(|&&other| other > index) {
                let (links, physics) = (&mut world.links, &mut world.physics);
                links.dock(index, other, &placed, physics, |now| *now);
            }
        }
        world
    }

    /// The modules that it plays.
    pub fn modules(&self) -> impl Iterator<Item = ModuleId> {
        self.robots.iter().map(|robot| robot.module)
    }

    /// Handles a goal of a module.
    pub fn handle_goal(&mut self, module: ModuleId, goal: &CorePose) {
        let now = self.clock;
        if let Some(robot) = self.robot(module) {
            robot.take_goal(now, from_core(goal));
        }
    }

    /// Handles a docking request of a module; one that is repeated after a failure begins another attempt.
    pub fn handle_request(&mut self, module: ModuleId, request: DockingRequest) {
        let now = self.now();
        let Some(robot) = self.robot(module) else {
            return;
        };
        let known = robot.attempt.as_ref();
        let known = known.filter(|known| known.request == request);
        match known.map(|known| known.stage) {
            Some(AttemptStage::Trying(_)) => {}
            Some(AttemptStage::Done) => self.answer(module, request.request, Ok(())),
            _ => {
                let stage = AttemptStage::Trying(now);
                robot.begin(Attempt { request, stage });
                let docks = request.action == DockingAction::Dock;
                self.report.docking_attempts += u64::from(docks);
            }
        }
    }

    /// Lets time pass, in whole ticks; the rest is kept for the next call. Goals lose their force by this time even where it
    /// exceeds what the world can catch up with.
    pub fn advance(&mut self, elapsed: Duration) {
        self.clock += elapsed;
        self.rest += elapsed.min(ELAPSED_MAX);
        while self.rest >= TICK {
            self.rest -= TICK;
            self.tick();
        }
    }

    /// The next measured pose that is due, as its module's driver publishes it.
    pub fn poll_pose(&mut self) -> Option<(ModuleId, CorePose)> {
        let now = self.now();
        let &(due, module, pose) = self.poses.front()?;
        if due > now {
            return None;
        }
        self.poses.pop_front();
        Some((module, pose))
    }

    /// The next answer to a docking request.
    pub fn poll_result(&mut self) -> Option<(ModuleId, DockingResult)> {
        self.results.pop_front()
    }

    /// What was counted so far.
    #[must_use]
    pub fn report(&self) -> WorldReport {
        WorldReport {
            folds: self.links.folds,
            ..self.report.clone()
        }
    }

    /// Where a module truly stands.
    #[must_use]
    pub fn true_pose(&self, module: ModuleId) -> Option<CorePose> {
        let index = self.indices.get(&module)?;
        to_core(&self.pose(*index))
    }

    fn now(&self) -> Duration {
        TICK * u32::try_from(self.ticks).unwrap_or(u32::MAX)
    }

    fn robot(&mut self, module: ModuleId) -> Option<&mut Robot> {
        let index = self.indices.get(&module)?;
        self.robots.get_mut(*index)
    }

    fn pose(&self, index: usize) -> Pose {
        *self.physics.bodies[self.robots[index].body].position()
    }

    fn placed(&self) -> Vec<Placed> {
        let robots = self.robots.iter();
        robots
            .map(|robot| Placed {
                body: robot.body,
                goal: robot.goal,
            })
            .collect()
    }

    fn answer(&mut self, module: ModuleId, request: u64, outcome: Result<(), String>) {
        let result = DockingResult { request, outcome };
        self.results.push_back((module, result));
    }

    fn tick(&mut self) {
        self.ticks += 1;
        if self.ticks.is_multiple_of(POSE_TICKS) {
            self.measure();
        }
        if self.ticks.is_multiple_of(SLIP_TICKS) {
            for robot in &mut self.robots {
                robot.drive.draw_slip(&mut robot.random);
            }
        }
        self.attempt_docking();
        let (now, placed) = (self.now(), self.placed());
        self.links.fold(now, &placed, &mut self.physics);
        let bodies: Vec<RigidBodyHandle> = placed.iter().map(|one| one.body).collect();
        self.contacts
            .note_motions(&self.physics, bodies.into_iter());
        self.drive();
        let docked = DockedBodies(&self.links.bodies);
        self.physics.step_with_events(&docked, &());
        self.contacts.count(now, &self.physics, &mut self.report);
    }

    fn measure(&mut self) {
        let due = self.now() + self.options.delay;
        for index in 0..self.robots.len() {
            let at = self.pose(index);
            let robot = &mut self.robots[index];
            let measured = robot.measure(&at, &self.options);
            if robot.random.happens(self.options.loss) {
                self.report.lost_poses += 1;
            } else if let Some(pose) = to_core(&measured) {
                self.poses.push_back((due, robot.module, pose));
            }
        }
    }

    fn drive(&mut self) {
        let now = self.clock;
        for index in 0..self.robots.len() {
            let at = self.pose(index);
            let port = self.port(index, &at);
            let robot = &mut self.robots[index];
            let wanted = robot.wanted(now, &at, port);
            let body = &mut self.physics.bodies[robot.body];
            robot.drive.act(body, wanted, real(TICK.as_secs_f64()));
        }
    }

    /// Where a module that docks is to stand, if its port is in reach of the other module.
    fn port(&self, index: usize, at: &Pose) -> Option<Pose> {
        let attempt = self.robots[index].attempt.as_ref()?;
        let AttemptStage::Trying(_) = attempt.stage else {
            return None;
        };
        let other = *self.indices.get(&attempt.request.other)?;
        let place = self.docking_place(index, other, at);
        deviation(at, &place).is_within(REACH).then_some(place)
    }

    /// Where a module is to stand to dock to another one.
    fn docking_place(&self, index: usize, other: usize, at: &Pose) -> Pose {
        let stands = self.pose(other);
        let goals = self.robots[other].goal.inv_mul(&self.robots[index].goal);
        stands * docking_place(&stands.inv_mul(at), &goals)
    }

    /// Goes on with all attempts to dock and undock.
    fn attempt_docking(&mut self) {
        for index in 0..self.robots.len() {
            let robot = &self.robots[index];
            let Some(Attempt {
                request,
                stage: AttemptStage::Trying(since),
            }) = robot.attempt.clone()
            else {
                continue;
            };
            let (module, number) = (robot.module, request.request);
            let stage = match self.indices.get(&request.other).copied() {
                Some(other) if other != index => self.attempt(index, other, request.action, since),
                _ => {
                    let reason = format!("the world has no other {}", request.other);
                    self.answer(module, number, Err(reason));
                    AttemptStage::Failed
                }
            };
            if stage == AttemptStage::Done {
                self.answer(module, number, Ok(()));
            }
            self.robots[index].attempt = Some(Attempt { request, stage });
        }
    }

    /// Goes on with an attempt that began at `since`. A module learns of a failure by no answer, and repeats its request.
    fn attempt(
        &mut self,
        index: usize,
        other: usize,
        action: DockingAction,
        since: Duration,
    ) -> AttemptStage {
        if action == DockingAction::Undock {
            self.links.undock(index, other, &mut self.physics);
            return AttemptStage::Done;
        }
        if self.links.are_docked(index, other) {
            return AttemptStage::Done;
        }
        let at = self.pose(index);
        let off = deviation(&at, &self.docking_place(index, other, &at));
        let limit = real(self.options.docking_tolerance);
        let tolerance = Deviation {
            distance: limit,
            angle: limit,
        };
        let locks = match Contact::judge(self.now(), since, off, tolerance) {
            Contact::Pending => return AttemptStage::Trying(since),
            Contact::Reached => {
                let random = &mut self.robots[index].random;
                !random.happens(self.options.docking_failure)
            }
            Contact::Missed => false,
        };
        if !locks {
            self.report.docking_failures += 1;
            return AttemptStage::Failed;
        }
        let placed = self.placed();
        let goal = |index: usize| self.robots[index].goal;
        let goals = goal(index.min(other)).inv_mul(&goal(index.max(other)));
        let place = |now: &Pose| docking_place(now, &goals);
        self.links
            .dock(index, other, &placed, &mut self.physics, place);
        AttemptStage::Done
    }
}

/// A fixed body that covers an area.
fn insert_box(physics: &mut PhysicsWorld, area: &Area) {
    let area = area.to_raw();
    let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(real);
    let body = RigidBodyBuilder::fixed().translation(Vector::new(x, y));
    let collider = ColliderBuilder::cuboid(width / 2.0, height / 2.0).friction(FRICTION);
    physics.insert(body, collider);
}

/// The walls around an area.
fn walls(area: &Area) -> [Area; 4] {
    let thickness = MicroUnits::from_units(WALL).unwrap_or(MicroUnits::ONE);
    let ((left, bottom), (right, top)) = (area.low, area.high);
    let (out_left, out_right) = (left - thickness, right + thickness);
    let wall = |low, high| Area { low, high };
    [
        wall((out_left, bottom - thickness), (out_right, bottom)),
        wall((out_left, top), (out_right, top + thickness)),
        wall((out_left, bottom), (left, top)),
        wall((right, bottom), (out_right, top)),
    ]
}

#[cfg(test)]
mod tests;
