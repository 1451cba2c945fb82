//! Odometry.

use serde::{Deserialize, Serialize};

use super::geometry_msgs::{PoseWithCovariance, TwistWithCovariance};
use crate::standard::Header;

/// Where a robot estimates to be, and how fast it moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the package")]
pub struct Odometry {
    pub header: Header,
    pub child_frame_id: String,
    pub pose: PoseWithCovariance,
    pub twist: TwistWithCovariance,
}

interface_types!("nav_msgs": Odometry);
