//! The data that all parts share: identifiers, fixed-point numbers, poses, graphs, targets, problems, scenarios, messages
//! and plans.
//!
//! Raw input becomes a validated type here, and nowhere else.

mod area;
mod area_union;
pub mod blocked_spots;
pub mod body;
mod closed_roster;
mod covered_area;
mod cut_nodes;
mod decision;
pub mod digest;
mod docking;
mod field_error;
mod fixed;
mod geometry;
mod id;
mod limits;
mod map;
mod message;
mod module_size;
mod motion_plan;
mod paper_options;
mod parameters;
mod plan;
pub mod polyline;
mod problem;
mod roster;
mod scenario;
mod scenario_file;
mod spot;
mod stage;
mod surroundings;
mod target;
pub mod text;
mod topology;
pub mod turning;
mod yaml;

pub use area::*;
pub use body::{BlockedSpot, BodyReport, Whereabouts};
pub use closed_roster::ClosedRoster;
pub use cut_nodes::cut_nodes;
pub use decision::*;
pub use docking::*;
pub use field_error::FieldError;
pub use fixed::*;
pub use geometry::*;
pub use id::*;
pub use limits::*;
pub use message::*;
pub use module_size::*;
pub use motion_plan::*;
pub use paper_options::*;
pub use parameters::*;
pub use plan::*;
pub use polyline::{POLYLINE_POSES_MAX, Polyline, PolylineError};
pub use problem::*;
pub use roster::*;
pub use scenario::*;
pub use spot::*;
pub use stage::*;
pub use surroundings::*;
pub use target::*;
pub use topology::*;
pub use yaml::YamlError;
