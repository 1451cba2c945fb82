//! One robot: its body, its goal, and what it measures.

use std::time::Duration;

use formation_model::ModuleId;
use rapier2d::dynamics::RigidBodyHandle;
use rapier2d::math::{Pose, Vector};

use crate::docking::Attempt;
use crate::drive::{Drive, Twist};
use crate::options::WorldOptions;
use crate::random::Random;

/// A robot stops this long after the last goal; goals repeat every 0.5 s.
const PATIENCE: Duration = Duration::from_millis(1_500);

/// One robot.
#[derive(Debug)]
pub(crate) struct Robot {
    pub module: ModuleId,
    pub body: RigidBodyHandle,
    pub random: Random,
    pub drive: Drive,
    /// The latest goal, or where it stood at the start.
    pub goal: Pose,
    /// When the latest goal came.
    goal_received: Option<Duration>,
    /// What its measurements are off by at present.
    error: Pose,
    /// What it does with its ports.
    pub attempt: Option<Attempt>,
}

impl Robot {
    pub fn new(
        module: ModuleId,
        body: RigidBodyHandle,
        start: Pose,
        options: &WorldOptions,
    ) -> Self {
        Self {
            module,
            body,
            random: Random::of_module(options.seed, module),
            drive: Drive::new(options),
            goal: start,
            goal_received: None,
            error: Pose::IDENTITY,
            attempt: None,
        }
    }

    pub fn take_goal(&mut self, now: Duration, goal: Pose) {
        self.goal = goal;
        self.goal_received = Some(now);
    }

    /// Begins an attempt of its port, for which it leaves its goal.
    pub fn begin(&mut self, attempt: Attempt) {
        self.goal_received = None;
        self.attempt = Some(attempt);
    }

    /// Measures where it stands.
    pub fn measure(&mut self, at: &Pose, options: &WorldOptions) -> Pose {
        let (x, y) = self.random.normal_pair(options.noise);
        let (turn, _) = self.random.normal_pair(options.heading_noise);
        self.error = Pose::new(Vector::new(x, y), turn);
        self.measured(at)
    }

    /// Where it takes itself to be, at `at`: wheels count well between two measurements.
    fn measured(&self, at: &Pose) -> Pose {
        let Pose {
            rotation,
            translation,
        } = self.error;
        Pose::from_parts(at.translation + translation, rotation * at.rotation)
    }

    /// The velocity that it wants. A port that is in reach of another leads it; otherwise its goal does, while it repeats.
    pub fn wanted(&mut self, now: Duration, at: &Pose, port: Option<Pose>) -> Twist {
        if let Some(place) = port {
            return self.drive.towards(at, &place);
        }
        let holds = |received| now.saturating_sub(received) <= PATIENCE;
        if self.goal_received.is_some_and(holds) {
            let (from, goal) = (self.measured(at), self.goal);
            self.drive.towards(&from, &goal)
        } else {
            Twist::default()
        }
    }
}
