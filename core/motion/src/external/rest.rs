//! Where a module stands, by what is measured of it again and again.

use formation_model::{MicroUnits, Pose};

/// The greatest number of measurements that the mean weighs alike; beyond it, older ones fade.
const MEASUREMENTS_MAX: i64 = 8;

/// A module that stands still: one measurement may be off by more than a tolerance, the mean of several is not.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    /// The pose last reported to the agent, as measured.
    pub reported: Pose,
    /// The mean of that and of what was measured since.
    pub mean: Pose,
    measurements: i64,
}

impl Rest {
    /// A module that was just reported there.
    pub fn at(pose: Pose) -> Self {
        Self {
            reported: pose,
            mean: pose,
            measurements: 1,
        }
    }

    /// Adds a measurement to the mean.
    pub fn measure(&mut self, pose: &Pose) {
        self.measurements = (self.measurements + 1).min(MEASUREMENTS_MAX);
        let moved = |from: MicroUnits, by: i64| MicroUnits(from.0 + by / self.measurements);
        self.mean = Pose {
            x: moved(self.mean.x, pose.x.0 - self.mean.x.0),
            y: moved(self.mean.y, pose.y.0 - self.mean.y.0),
            theta: moved(self.mean.theta, pose.turn_from(&self.mean).0),
        };
    }
}
