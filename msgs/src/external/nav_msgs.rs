//! Odometry and paths.

use serde::{Deserialize, Serialize};

use super::geometry_msgs::{PoseStamped, PoseWithCovariance, TwistWithCovariance};
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

/// The poses that a robot is to pass, in that order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the package")]
pub struct Path {
    pub header: Header,
    pub poses: Vec<PoseStamped>,
}

interface_types!("nav_msgs": Odometry, Path);
