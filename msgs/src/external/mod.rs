//! Messages of other ROS 2 packages that the suite sends or reads, as ROS 2 Jazzy defines them.
//!
//! One module a package; each struct has the name and the fields, in their order, of the package's `.msg` file.

pub mod geometry_msgs;
pub mod nav_msgs;
pub mod sensor_msgs;
pub mod std_msgs;
pub mod tf2_msgs;
pub mod visualization_msgs;
