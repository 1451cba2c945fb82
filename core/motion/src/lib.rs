//! Motion of a module: planned along paths; simulated at a set speed, or by a driver outside the process.

mod differential;
mod docking_queue;
mod external;
mod fault;
mod goal;
pub mod paths;
mod planned;
mod world_report;

pub use differential::{TURNING_BODY_WIDTH_MAX, check_differential_drives};
pub use external::{DEVIATION_LIMIT, DriveCommand, ExternalDrive, ExternalParameters};
pub use fault::DriveFault;
pub use goal::{MotionGoal, MotionReport};
pub use planned::PlannedMotion;
pub use world_report::WorldReport;

use std::time::Duration;

use formation_model::Pose;

/// An arc that ends nearer to its goal than this leads there.
const ARC_ERROR_UNITS: f64 = 0.02;

/// A simulated drive. Like a real one it needs its goal repeated: after `patience` without a repetition it halts.
#[derive(Clone, Debug)]
pub struct SimulatedDrive {
    pose: Pose,
    speed_units_per_s: f64,
    patience: Duration,
    journey: Option<Journey>,
    /// The goal of a journey that was halted, and the time that it would still have taken.
    unfinished: Option<(MotionGoal, Duration)>,
}

#[derive(Clone, Debug)]
struct Journey {
    from: Pose,
    goal: MotionGoal,
    /// The point about which it turns, if an arc about that leads to the goal from where it is.
    pivot: Option<Pose>,
    began: Duration,
    duration: Duration,
    /// The time of the last command to go.
    repeated: Duration,
}

impl SimulatedDrive {
    /// A drive that stands at `pose`. The speed is in units per second, at least 0.001. `patience` is the longest time
    /// between two commands to go.
    pub fn new(pose: Pose, speed_units_per_s: f64, patience: Duration) -> Self {
        Self {
            pose,
            speed_units_per_s: valid_speed(speed_units_per_s),
            patience,
            journey: None,
            unfinished: None,
        }
    }

    /// Changes the speed from the next goal on.
    pub fn set_speed(&mut self, speed_units_per_s: f64) {
        self.speed_units_per_s = valid_speed(speed_units_per_s);
    }

    /// The current pose.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// The pose at a time, before anything that is due then.
    #[must_use]
    pub fn pose_at(&self, now: Duration) -> Pose {
        let mut drive = self.clone();
        drive.advance(now);
        drive.pose
    }

    /// Whether the module is moving.
    pub fn is_moving(&self) -> bool {
        self.journey.is_some()
    }

    /// When the module arrives, or halts because its goal does not repeat; `None` while it stands still.
    pub fn due(&self) -> Option<Duration> {
        let journey = self.journey.as_ref()?;
        let arrival = journey.began.saturating_add(journey.duration);
        let patience = self.patience.saturating_add(Duration::from_micros(1));
        let end_of_patience = journey.repeated.saturating_add(patience);
        Some(arrival.min(end_of_patience))
    }

    /// The time until arrival, if the goal is repeated until then; `None` while the module stands still.
    pub fn time_left(&self, now: Duration) -> Option<Duration> {
        let journey = self.journey.as_ref()?;
        let elapsed = now.saturating_sub(journey.began);
        Some(journey.duration.saturating_sub(elapsed))
    }

    /// Starts towards a goal, or repeats the present one.
    pub fn go(&mut self, now: Duration, goal: MotionGoal) {
        if let Some(journey) = &mut self.journey
            && journey.goal.pose == goal.pose
        {
            journey.repeated = now;
            return;
        }
        let left = self.unfinished.take().filter(|(halted, _)| *halted == goal);
        let duration = left.map_or_else(
            || {
                // A goal that was on its way when the module arrived there moves it no more.
                if self.pose == goal.pose {
                    return Duration::ZERO;
                }
                // The roster's poses can be outdated when the goal arrives, so the drive's own distance counts as well.
                let own = self.pose.distance_to(&goal.pose);
                let seconds = own.max(goal.unit_distance).to_units() / self.speed_units_per_s;
                Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
            },
            |(_, left)| left,
        );
        self.journey = Some(Journey {
            from: self.pose,
            pivot: goal
                .pivot
                .filter(|pivot| leads_to(&self.pose, pivot, &goal.pose)),
            goal,
            began: now,
            duration,
            repeated: now,
        });
    }

    /// An outside hand puts the module there. On its way, it goes on to its goal from where it is now.
    pub fn put(&mut self, now: Duration, pose: Pose) -> impl Iterator<Item = MotionReport> {
        let before = self.advance(now);
        let before = before.filter(|report| !matches!(report, MotionReport::Pose(_)));
        self.pose = pose;
        self.unfinished = None;
        if let Some(journey) = self.journey.take() {
            let seconds = pose.distance_to(&journey.goal.pose).to_units() / self.speed_units_per_s;
            self.journey = Some(Journey {
                from: pose,
                pivot: None,
                began: now,
                duration: Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX),
                ..journey
            });
        }
        before.into_iter().chain([MotionReport::Pose(pose)])
    }

    /// Stops at once.
    pub fn halt(&mut self, now: Duration) -> MotionReport {
        self.advance(now);
        self.break_off(now);
        MotionReport::Halted(self.pose)
    }

    fn break_off(&mut self, now: Duration) {
        if let Some(left) = self.time_left(now) {
            self.unfinished = self.journey.take().map(|journey| (journey.goal, left));
        }
    }

    /// Moves up to the current time; `None` while the module stands still.
    /// Enforces A4.
    pub fn advance(&mut self, now: Duration) -> Option<MotionReport> {
        let journey = self.journey.as_ref()?;
        let last = journey.repeated + self.patience;
        let elapsed = now.min(last).saturating_sub(journey.began);
        if elapsed >= journey.duration {
            self.pose = journey.goal.pose;
            self.journey = None;
            self.unfinished = None;
            return Some(MotionReport::Arrived {
                goal: self.pose,
                pose: self.pose,
            });
        }
        let share = elapsed.as_secs_f64() / journey.duration.as_secs_f64();
        self.pose = between(&journey.from, &journey.goal.pose, journey.pivot, share);
        if now > last {
            self.break_off(last);
            return Some(MotionReport::Halted(self.pose));
        }
        Some(MotionReport::Pose(self.pose))
    }
}

/// The speed, raised to the least one at which the module moves; 1 if it is not finite.
fn valid_speed(speed_units_per_s: f64) -> f64 {
    if speed_units_per_s.is_finite() {
        speed_units_per_s.max(0.001)
    } else {
        1.0
    }
}

/// Whether the arc about a pivot that turns a module into the heading of its goal leads to that goal.
fn leads_to(from: &Pose, pivot: &Pose, goal: &Pose) -> bool {
    let end = between(from, goal, Some(*pivot), 1.0);
    end.distance_to(goal).to_units() < ARC_ERROR_UNITS
}

/// The pose at `share` (0 to 1) of the line, or of the arc about the pivot; the heading turns by the smaller
/// angle.
fn between(from: &Pose, goal: &Pose, pivot: Option<Pose>, share: f64) -> Pose {
    let (start, end) = (from.to_isometry(), goal.to_isometry());
    let turned = start.rotation.slerp(&end.rotation, share);
    let point = match pivot {
        None => start
            .translation
            .vector
            .lerp(&end.translation.vector, share),
        Some(pivot) => {
            let pivot = pivot.to_isometry().translation.vector;
            let turn = start.rotation.rotation_to(&turned);
            pivot + turn * (start.translation.vector - pivot)
        }
    };
    let heading = turned.angle();
    let pose = Pose::from_units(point.x, point.y, heading);
    debug_assert!(pose.is_ok(), "the pose lies between two valid ones");
    pose.unwrap_or(*from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::MicroUnits;

    fn at(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    fn goal(x: f64) -> MotionGoal {
        MotionGoal {
            pose: Pose::from_units(x, 0.0, 0.0).unwrap(),
            unit_distance: MicroUnits::from_units(x).unwrap(),
            pivot: None,
        }
    }

    fn arrived(goal: MotionGoal) -> MotionReport {
        MotionReport::Arrived {
            goal: goal.pose,
            pose: goal.pose,
        }
    }

    #[test]
    fn it_has_arrived_at_a_goal_where_it_stands() {
        let mut drive = SimulatedDrive::new(Pose::default(), 2.0, Duration::from_secs(60));
        drive.go(at(1), goal(10.0));
        assert_eq!(drive.advance(at(6)), Some(arrived(goal(10.0))));
        drive.go(at(7), goal(10.0));
        assert_eq!(drive.due(), Some(at(7)));
        assert_eq!(drive.advance(at(7)), Some(arrived(goal(10.0))));
    }

    #[test]
    fn it_travels_at_its_speed_and_arrives_exactly() {
        let mut drive = SimulatedDrive::new(Pose::default(), 2.0, Duration::from_secs(60));
        drive.go(Duration::ZERO, goal(10.0));
        let Some(MotionReport::Pose(pose)) = drive.advance(Duration::from_secs(1)) else {
            panic!("it is moving");
        };
        assert_eq!(pose.x, MicroUnits(2_000_000));
        assert_eq!(drive.time_left(at(1)), Some(at(4)));
        assert_eq!(drive.advance(at(5)), Some(arrived(goal(10.0))));
        assert_eq!(drive.advance(Duration::from_secs(6)), None);
        assert_eq!(drive.time_left(at(6)), None);
    }

    #[test]
    fn docked_modules_turn_about_their_pivot() {
        let from = Pose::from_units(3.0, 1.0, 0.0).unwrap();
        let mut drive = SimulatedDrive::new(from, 1.0, Duration::from_secs(60));
        let quarter = std::f64::consts::FRAC_PI_2;
        let goal = MotionGoal {
            pose: Pose::from_units(1.0, 3.0, quarter).unwrap(),
            unit_distance: MicroUnits(4_000_000),
            pivot: Some(Pose::from_units(1.0, 1.0, 0.0).unwrap()),
        };
        drive.go(Duration::ZERO, goal);
        drive.advance(at(2));
        let middle = Pose::from_units(1.0 + 2.0_f64.sqrt(), 1.0 + 2.0_f64.sqrt(), quarter / 2.0);
        assert!(drive.pose().distance_to(&middle.unwrap()) < MicroUnits(10));
        assert_eq!(drive.due(), Some(at(4)));
        assert_eq!(drive.advance(at(4)), Some(arrived(goal)));
    }

    #[test]
    fn a_module_that_is_carried_on_its_way_goes_on_from_where_it_is() {
        let from = Pose::from_units(3.0, 1.0, 0.0).unwrap();
        let mut drive = SimulatedDrive::new(from, 1.0, Duration::from_secs(60));
        let goal = MotionGoal {
            pose: Pose::from_units(1.0, 3.0, std::f64::consts::FRAC_PI_2).unwrap(),
            unit_distance: MicroUnits(4_000_000),
            pivot: Some(Pose::from_units(1.0, 1.0, 0.0).unwrap()),
        };
        drive.go(Duration::ZERO, goal);
        let there = Pose::from_units(1.0, -1.0, 0.0).unwrap();
        let reports: Vec<MotionReport> = drive.put(at(1), there).collect();
        assert_eq!(reports, [MotionReport::Pose(there)]);
        drive.go(at(2), goal);
        drive.advance(at(3));
        let way = (drive.pose().x, drive.pose().y.0);
        assert_eq!(way, (MicroUnits(1_000_000), 1_000_000));
        assert_eq!(drive.advance(at(5)), Some(arrived(goal)));
        // After a halt as well, and although the goal names a pivot.
        drive.put(at(6), there).for_each(drop);
        drive.go(at(6), goal);
        drive.advance(at(8));
        assert_eq!(drive.pose().x, MicroUnits(1_000_000));
    }

    /// Shows A4.
    #[test]
    fn it_halts_when_its_goal_does_not_repeat() {
        let mut drive = SimulatedDrive::new(Pose::default(), 1.0, Duration::from_secs(1));
        drive.go(Duration::ZERO, goal(10.0));
        let halted = drive.advance(at(5));
        assert_eq!(
            halted,
            Some(MotionReport::Halted(
                Pose::from_units(1.0, 0.0, 0.0).unwrap()
            ))
        );
        drive.go(at(5), goal(10.0));
        for second in 6..14 {
            assert!(matches!(
                drive.advance(at(second)),
                Some(MotionReport::Pose(_))
            ));
            drive.go(at(second), goal(10.0));
        }
        assert_eq!(drive.advance(at(14)), Some(arrived(goal(10.0))));
    }
}
