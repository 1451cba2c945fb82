//! Motion, simulated or left to a driver outside. Simulated, a module travels straight to its goal at a set speed.

mod docking;
mod external;

pub use docking::{DockingAction, DockingRequest, DockingResult};
pub use external::{DriveCommand, DriveFault, ExternalDrive, ExternalParameters};

use std::time::Duration;

use nalgebra::{Point2, UnitComplex};

use crate::model::{MicroUnits, Pose};
use crate::protocol::{MotionGoal, MotionReport};

/// A drive without a robot. It obeys the rule that a goal must repeat: without a new one for `patience` it halts.
#[derive(Clone, Debug)]
pub struct SimulatedDrive {
    pose: Pose,
    speed_units_per_s: f64,
    patience: Duration,
    journey: Option<Journey>,
    /// The goal of a journey that was halted, and how long it would still have taken.
    unfinished: Option<(MotionGoal, Duration)>,
}

#[derive(Clone, Debug)]
struct Journey {
    from: Pose,
    goal: MotionGoal,
    began: Duration,
    duration: Duration,
    last_told: Duration,
}

impl SimulatedDrive {
    /// A drive that stands at `pose`; `speed_units_per_s` is at least a millimetre a second, and `patience` is how long
    /// it keeps going without being told again.
    #[must_use]
    pub fn new(pose: Pose, speed_units_per_s: f64, patience: Duration) -> Self {
        Self {
            pose,
            speed_units_per_s: possible(speed_units_per_s),
            patience,
            journey: None,
            unfinished: None,
        }
    }

    /// Goes at another speed from the next goal on.
    pub fn set_speed(&mut self, speed_units_per_s: f64) {
        self.speed_units_per_s = possible(speed_units_per_s);
    }

    /// Where it stands.
    #[must_use]
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// Whether it is on its way.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.journey.is_some()
    }

    /// How long it will still be on its way if it keeps being told; `None` while it stands still.
    #[must_use]
    pub fn time_left(&self, now: Duration) -> Option<Duration> {
        let journey = self.journey.as_ref()?;
        let elapsed = now.saturating_sub(journey.began);
        Some(journey.duration.saturating_sub(elapsed))
    }

    /// Takes a goal, or takes note that the present one still holds.
    pub fn go(&mut self, now: Duration, goal: MotionGoal) {
        if let Some(journey) = &mut self.journey
            && journey.goal.pose == goal.pose
        {
            journey.last_told = now;
            return;
        }
        let left = self.unfinished.take().filter(|(halted, _)| *halted == goal);
        let duration = left.map_or_else(
            || {
                // A goal may come after the roster's poses have gone stale, so the own way counts as well.
                let own = self.pose.distance_to(&goal.pose);
                let seconds = own.max(goal.unit_distance).to_units() / self.speed_units_per_s;
                Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
            },
            |(_, left)| left,
        );
        self.journey = Some(Journey {
            from: self.pose,
            goal,
            began: now,
            duration,
            last_told: now,
        });
    }

    /// Stands still at once.
    pub fn halt(&mut self, now: Duration) -> MotionReport {
        self.advance(now);
        self.break_off(now);
        MotionReport::Halted(self.pose)
    }

    fn break_off(&mut self, now: Duration) {
        if let Some(journey) = self.journey.take() {
            let elapsed = now.saturating_sub(journey.began);
            self.unfinished = Some((journey.goal, journey.duration.saturating_sub(elapsed)));
        }
    }

    /// Lets time pass; `None` while it stands still.
    pub fn advance(&mut self, now: Duration) -> Option<MotionReport> {
        let journey = self.journey.as_ref()?;
        let last = journey.last_told + self.patience;
        let elapsed = now.min(last).saturating_sub(journey.began);
        if elapsed >= journey.duration {
            self.pose = journey.goal.pose;
            self.journey = None;
            self.unfinished = None;
            return Some(MotionReport::Arrived(self.pose));
        }
        let share = elapsed.as_secs_f64() / journey.duration.as_secs_f64();
        self.pose = between(&journey.from, &journey.goal.pose, share);
        if now > last {
            self.break_off(last);
            return Some(MotionReport::Halted(self.pose));
        }
        Some(MotionReport::Pose(self.pose))
    }
}

/// A speed at which something moves at all.
fn possible(speed_units_per_s: f64) -> f64 {
    if speed_units_per_s.is_finite() {
        speed_units_per_s.max(0.001)
    } else {
        1.0
    }
}

/// The pose at `share` (0 to 1) of the straight way, turning by the shorter angle.
fn between(from: &Pose, to: &Pose, share: f64) -> Pose {
    let position = |pose: &Pose| Point2::new(pose.x.to_units(), pose.y.to_units());
    let heading = |pose: &Pose| UnitComplex::new(pose.theta.to_units());
    let point = position(from) + (position(to) - position(from)) * share;
    let angle = heading(from).slerp(&heading(to), share).angle();
    Pose {
        x: MicroUnits::from_units(point.x).unwrap_or(from.x),
        y: MicroUnits::from_units(point.y).unwrap_or(from.y),
        theta: MicroUnits::from_units(angle).unwrap_or(from.theta),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    fn goal(x: f64) -> MotionGoal {
        MotionGoal {
            pose: Pose::from_units(x, 0.0, 0.0).unwrap(),
            unit_distance: MicroUnits::from_units(x).unwrap(),
        }
    }

    #[test]
    fn it_travels_at_its_speed_and_arrives_exactly() {
        let mut drive = SimulatedDrive::new(Pose::default(), 2.0, Duration::from_secs(60));
        drive.go(Duration::ZERO, goal(10.0));
        let Some(MotionReport::Pose(pose)) = drive.advance(Duration::from_secs(1)) else {
            panic!("it is on its way");
        };
        assert_eq!(pose.x, MicroUnits(2_000_000));
        assert_eq!(drive.time_left(at(1)), Some(at(4)));
        assert_eq!(
            drive.advance(at(5)),
            Some(MotionReport::Arrived(goal(10.0).pose))
        );
        assert_eq!(drive.advance(Duration::from_secs(6)), None);
        assert_eq!(drive.time_left(at(6)), None);
    }

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
        assert_eq!(
            drive.advance(at(14)),
            Some(MotionReport::Arrived(goal(10.0).pose))
        );
    }
}
