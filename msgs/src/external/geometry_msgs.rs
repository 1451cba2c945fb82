//! Poses and transforms.

#![expect(missing_docs, reason = "the fields are those of the package")]

use formation_model::{self as model, ModuleSize};
use serde::{Deserialize, Serialize};

use crate::check::{self, Checked, FieldError};
use crate::error::Fault;
use crate::standard::Header;

/// A position in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// A vector in metres, or in metres or radians a second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// A rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

/// A position and a rotation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    pub position: Point,
    pub orientation: Quaternion,
}

/// A pose in a frame at a time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    pub header: Header,
    pub pose: Pose,
}

/// A pose and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    pub pose: Pose,
    /// Row by row; on the wire the same as the package's array of 36.
    pub covariance: [[f64; 6]; 6],
}

/// A velocity, straight and turning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    pub linear: Vector3,
    pub angular: Vector3,
}

/// A velocity and how sure it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    pub twist: Twist,
    /// Row by row; on the wire the same as the package's array of 36.
    pub covariance: [[f64; 6]; 6],
}

/// Where one frame lies in another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    pub translation: Vector3,
    pub rotation: Quaternion,
}

/// A transform with its frames and time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Transform,
}

impl Default for Quaternion {
    /// No rotation.
    fn default() -> Self {
        Self::from_yaw(0.0)
    }
}

impl Quaternion {
    /// A turn about the vertical axis, in radians counter-clockwise.
    #[must_use]
    pub fn from_yaw(yaw: f64) -> Self {
        let (x, y) = (0.0, 0.0);
        let (z, w) = (yaw / 2.0).sin_cos();
        Self { x, y, z, w }
    }

    /// The turn about the vertical axis in radians, from -pi to pi, whatever its length.
    fn yaw(&self) -> f64 {
        let Self { x, y, z, w } = *self;
        (2.0 * (w * z + x * y)).atan2(w * w + x * x - y * y - z * z)
    }
}

impl Pose {
    /// A pose of the core in metres.
    #[must_use]
    pub fn new(pose: &model::Pose, size: ModuleSize) -> Self {
        let (x, y) = size.position_in_metres(pose);
        Self {
            position: Point { x, y, z: 0.0 },
            orientation: Quaternion::from_yaw(pose.theta.to_units()),
        }
    }
}

impl Transform {
    /// The transform to a pose of the core, in metres.
    #[must_use]
    pub fn new(pose: &model::Pose, size: ModuleSize) -> Self {
        let pose = Pose::new(pose, size);
        let Point { x, y, z } = pose.position;
        Self {
            translation: Vector3 { x, y, z },
            rotation: pose.orientation,
        }
    }
}

/// How far from 1 the length of a rotation may lie: drivers round, but one that is left zero is a mistake.
const ROTATION_SLACK: f64 = 0.01;

impl Pose {
    /// The pose in the plane, in units: height, roll and pitch are left out.
    pub(crate) fn in_plane(&self, size: ModuleSize) -> Checked<model::Pose> {
        let Quaternion { x, y, z, w } = self.orientation;
        let length = (x * x + y * y + z * z + w * w).sqrt();
        // A length that is no number fails as well.
        if !((1.0 - ROTATION_SLACK)..=(1.0 + ROTATION_SLACK)).contains(&length) {
            return Err(FieldError::new("orientation", Fault::NoRotation(length)));
        }
        let position = (self.position.x, self.position.y);
        check::pose(position, self.orientation.yaw(), size)
            .map_err(|error| error.within("position"))
    }
}

interface_types!("geometry_msgs": Point, Pose, PoseStamped, PoseWithCovariance, Quaternion, Transform, TransformStamped, Twist, TwistWithCovariance, Vector3);
