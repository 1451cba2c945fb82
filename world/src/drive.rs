//! How a robot follows its goal: which velocity it wants, and with what force it seeks it.

use rapier2d::dynamics::RigidBody;
use rapier2d::math::{Pose, Real, Vector};

use crate::options::{DriveKind, WorldOptions};
use crate::plane::{real, turn};
use crate::random::Random;

/// The speed that a robot wants for each unit that it is away from its goal, per second; the same for its heading.
const GAIN: Real = 5.0;
/// The share of its acceleration with which a robot plans to brake, so that some is left against disturbances.
const BRAKING_SHARE: Real = 0.5;
/// Robots turn at this many radians for each unit that they may go: their corners then move about as fast as they do.
const TURN_PER_UNIT: Real = 1.5;
/// Turning is accelerated this much faster, in radians for each unit.
const TURN_ACCELERATION: Real = 4.0;
/// How much better wheels hold sideways than they accelerate.
const GRIP: Real = 3.0;
/// At this distance from its goal, in units, a differential drive has arrived and turns to the goal's heading.
const ARRIVED: Real = 0.01;
/// At this distance it drives again.
const STRAYED: Real = 0.025;

/// A velocity in the frame of the robot: units a second along and across its heading, and radians a second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Twist {
    linear: Vector,
    angular: Real,
}

/// The drive of one robot.
#[derive(Clone, Debug)]
pub(crate) struct Drive {
    kind: DriveKind,
    speed: Real,
    acceleration: Real,
    slip: f64,
    /// The shares of the three parts of its velocity that it loses at present.
    lost: [Real; 3],
    /// Whether a differential drive stands on its goal and turns.
    is_aligning: bool,
}

impl Drive {
    pub fn new(options: &WorldOptions) -> Self {
        Self {
            kind: options.drive,
            speed: real(options.speed),
            acceleration: real(options.acceleration),
            slip: options.slip,
            lost: [0.0; 3],
            is_aligning: false,
        }
    }

    /// Draws how much velocity is lost from now on.
    pub fn draw_slip(&mut self, random: &mut Random) {
        self.lost = [(); 3].map(|()| real(random.share() * self.slip));
    }

    /// The velocity that it wants at `from`.
    pub fn towards(&mut self, from: &Pose, goal: &Pose) -> Twist {
        match self.kind {
            DriveKind::Holonomic => self.directly_towards(from, goal),
            DriveKind::Differential => self.ahead_towards(from, goal),
        }
    }

    fn directly_towards(&self, from: &Pose, goal: &Pose) -> Twist {
        let path = goal.translation - from.translation;
        let linear = path.normalize_or_zero() * self.approach_speed(path.length());
        Twist {
            linear: from.rotation.inverse() * linear,
            angular: self.turn_rate(turn(from.rotation.angle(), goal.rotation.angle())),
        }
    }

    /// Turns to its goal, or away from it if that is nearer, drives, and then turns to the goal's heading.
    fn ahead_towards(&mut self, from: &Pose, goal: &Pose) -> Twist {
        let path = from.inverse_transform_point(goal.translation);
        let distance = path.length();
        let limit = if self.is_aligning { STRAYED } else { ARRIVED };
        self.is_aligning = distance <= limit;
        if self.is_aligning {
            let angle = turn(from.rotation.angle(), goal.rotation.angle());
            let angular = self.turn_rate(angle);
            return Twist {
                angular,
                ..Twist::default()
            };
        }
        let direction = if path.x < 0.0 { -1.0 } else { 1.0 };
        let angle = (direction * path.y).atan2(path.x.abs());
        // It turns in place until its goal lies nearly ahead.
        let share = (1.0 - 4.0 * angle.abs()).max(0.0);
        Twist {
            linear: Vector::new(direction * share * self.approach_speed(distance), 0.0),
            angular: self.turn_rate(angle),
        }
    }

    /// The speed at which a robot can still brake within `distance`.
    fn approach_speed(&self, distance: Real) -> Real {
        let braking = (2.0 * BRAKING_SHARE * self.acceleration * distance).sqrt();
        self.speed.min(GAIN * distance).min(braking)
    }

    fn turn_rate(&self, angle: Real) -> Real {
        let limit = TURN_PER_UNIT * self.speed;
        (GAIN * angle).clamp(-limit, limit)
    }

    /// Seeks the velocity with the force that the drive has, for a time of `dt`; slip lessens what it reaches.
    pub fn act(&self, body: &mut RigidBody, wanted: Twist, dt: Real) {
        let rotation = *body.rotation();
        let [along, across, turning] = self.lost.map(|lost| 1.0 - lost);
        let wanted_linear = wanted.linear * Vector::new(along, across);
        let missing = wanted_linear - rotation.inverse() * body.linvel();
        let limit = self.acceleration * dt;
        let change = match self.kind {
            DriveKind::Holonomic => missing.clamp_length_max(limit),
            DriveKind::Differential => Vector::new(
                missing.x.clamp(-limit, limit),
                missing.y.clamp(-GRIP * limit, GRIP * limit),
            ),
        };
        let impulse = rotation * change * body.mass();
        body.apply_impulse(impulse, true);
        let limit = TURN_ACCELERATION * limit;
        let change = (wanted.angular * turning - body.angvel()).clamp(-limit, limit);
        let inertia = body.mass_properties().local_mprops.principal_inertia();
        body.apply_torque_impulse(change * inertia, true);
    }
}
