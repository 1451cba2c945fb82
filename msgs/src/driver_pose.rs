//! The poses that drivers publish, in either of two message types.

use formation_model::{self as model, ModuleSize};

use crate::check::{self, Checked, FieldError};
use crate::error::{Fault, MessageError};
use crate::external::geometry_msgs::PoseStamped;
use crate::external::nav_msgs::Odometry;
use crate::standard::{Header, Time};
use crate::topic;

/// A message with the pose of a module.
pub trait DriverPose {
    /// The pose in the plane, given in `frame_id` and metres, in units of `size`.
    ///
    /// # Errors
    /// The pose is given in another frame, is no number, or lies too far away.
    fn in_frame(&self, frame_id: &str, size: ModuleSize) -> Result<model::Pose, MessageError>;

    /// When it was measured, by the clock of the driver.
    fn stamp(&self) -> Time;
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
