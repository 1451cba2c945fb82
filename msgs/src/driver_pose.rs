//! The poses that drivers publish, in either of two message types.

use formation_model::{self as model, MicroUnits, ModuleSize};

use crate::check::{self, Checked, FieldError};
use crate::error::{Fault, MessageError};
use crate::external::geometry_msgs::PoseStamped;
use crate::external::nav_msgs::Odometry;
use crate::standard::{Header, Time};
use crate::topic;

/// In units; greater ones say no more.
const DEVIATION_MAX: f64 = 1_000.0;

/// A message with the pose of a module.
pub trait DriverPose {
    /// The pose in the plane, given in `frame_id` and metres, in units of `size`.
    ///
    /// # Errors
    /// The pose is given in another frame, is no number, or lies too far away.
    fn in_frame(&self, frame_id: &str, size: ModuleSize) -> Result<model::Pose, MessageError>;

    /// When it was measured, by the clock of the driver.
    fn stamp(&self) -> Time;

    /// The standard deviation of the position, along the axis on which it is greatest, in units of `size`; `None` if the message states
    /// none, or what no covariance can be.
    fn deviation(&self, size: ModuleSize) -> Option<MicroUnits>;
}

impl DriverPose for PoseStamped {
    fn in_frame(&self, frame_id: &str, size: ModuleSize) -> Result<model::Pose, MessageError> {
        same_frame(&self.header, frame_id)
            .and_then(|()| {
                self.pose
                    .in_plane(size)
                    .map_err(|error| error.within("pose"))
            })
            .map_err(|error| error.on(topic::POSE))
    }

    fn stamp(&self) -> Time {
        self.header.stamp
    }

    fn deviation(&self, _: ModuleSize) -> Option<MicroUnits> {
        None
    }
}

impl DriverPose for Odometry {
    fn in_frame(&self, frame_id: &str, size: ModuleSize) -> Result<model::Pose, MessageError> {
        same_frame(&self.header, frame_id)
            .and_then(|()| {
                let pose = self.pose.pose.in_plane(size);
                pose.map_err(|error| error.within("pose.pose"))
            })
            .map_err(|error| error.on(topic::ODOMETRY))
    }

    fn stamp(&self) -> Time {
        self.header.stamp
    }

    fn deviation(&self, size: ModuleSize) -> Option<MicroUnits> {
        let [[x, across, ..], [other, y, ..], ..] = self.pose.covariance;
        // The greater eigenvalue of the block of x and y.
        let middle = f64::midpoint(x, y);
        let largest = middle + (x - middle).hypot(f64::midpoint(across, other));
        let is_covariance = x >= 0.0 && y >= 0.0 && largest > 0.0 && largest.is_finite();
        let units = is_covariance.then(|| largest.sqrt() / size.metres())?;
        MicroUnits::from_units(units.min(DEVIATION_MAX)).ok()
    }
}

fn same_frame(header: &Header, wanted: &str) -> Checked<()> {
    check::name("header.frame_id", &header.frame_id)?;
    if header.frame_id == wanted {
        return Ok(());
    }
    Err(FieldError::new(
        "header.frame_id",
        Fault::WrongFrame {
            given: header.frame_id.clone(),
            wanted: wanted.to_owned(),
        },
    ))
}
