//! Shapes for RViz, Foxglove and their like.

#![expect(
    missing_docs,
    reason = "the fields and constants are those of the package"
)]

use serde::{Deserialize, Serialize};

use super::geometry_msgs::{Point, Pose, Vector3};
use super::sensor_msgs::CompressedImage;
use super::std_msgs::ColorRGBA;
use crate::standard::{Duration, Header};

/// One shape, known by its namespace and number.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    pub header: Header,
    pub ns: String,
    pub id: i32,
    pub r#type: i32,
    pub action: i32,
    pub pose: Pose,
    pub scale: Vector3,
    pub color: ColorRGBA,
    pub lifetime: Duration,
    pub frame_locked: bool,
    pub points: Vec<Point>,
    pub colors: Vec<ColorRGBA>,
    pub texture_resource: String,
    pub texture: CompressedImage,
    pub uv_coordinates: Vec<UVCoordinate>,
    pub text: String,
    pub mesh_resource: String,
    pub mesh_file: MeshFile,
    pub mesh_use_embedded_materials: bool,
}

impl Marker {
    pub const ARROW: i32 = 0;
    pub const CUBE: i32 = 1;
    pub const CYLINDER: i32 = 3;
    pub const LINE_STRIP: i32 = 4;
    pub const LINE_LIST: i32 = 5;
    pub const TEXT_VIEW_FACING: i32 = 9;
    pub const ADD: i32 = 0;
    pub const DELETE: i32 = 2;
    pub const DELETEALL: i32 = 3;
}

/// Many shapes at once.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    pub markers: Vec<Marker>,
}

impl MarkerArray {
    /// Multiplies every length of the shapes.
    #[must_use]
    pub fn scaled(mut self, by: f64) -> Self {
        for marker in &mut self.markers {
            let Marker {
                pose,
                scale,
                points,
                ..
            } = marker;
            for point in points.iter_mut().chain([&mut pose.position]) {
                for length in [&mut point.x, &mut point.y, &mut point.z] {
                    *length *= by;
                }
            }
            for length in [&mut scale.x, &mut scale.y, &mut scale.z] {
                *length *= by;
            }
        }
        self
    }
}

/// Where in a texture a vertex lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UVCoordinate {
    pub u: f32,
    pub v: f32,
}

/// A mesh that travels with its marker.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshFile {
    pub filename: String,
    pub data: Vec<u8>,
}

interface_types!("visualization_msgs": Marker, MarkerArray, MeshFile, UVCoordinate);
