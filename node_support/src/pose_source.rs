//! Which of two messages has the pose of a robot.

use ros_runtime::words::Words;

/// Which message of a driver has the pose of its module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PoseSource {
    /// `geometry_msgs/msg/PoseStamped` on `module_N/pose`.
    #[default]
    Pose,
    /// `nav_msgs/msg/Odometry` on `module_N/odom`.
    Odometry,
}

impl Words for PoseSource {
    const WORDS: &'static [(&'static str, Self)] =
        &[("pose", Self::Pose), ("odom", Self::Odometry)];
}
