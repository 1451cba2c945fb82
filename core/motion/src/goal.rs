//! What an agent asks of its drive and docking ports, and what they report.

use formation_model::{MicroUnits, ModuleId, Pose};

/// A goal for the drive. It repeats with every heartbeat while the module may move; a drive stops when it no longer does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MotionGoal {
    /// The pose to reach.
    pub pose: Pose,
    /// The longest distance that a module of the same unit has to travel, so that a block arrives together.
    pub unit_distance: MicroUnits,
    /// The point about which the module turns with its unit; `None` if it goes on a line.
    pub pivot: Option<Pose>,
}

/// A report from a module's drive or docking ports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionReport {
    /// The module is moving and has this pose now.
    Pose(Pose),
    /// The standard deviation of the position in the poses that follow, as the driver states it.
    Deviation(MicroUnits),
    /// The module has reached a goal.
    Arrived {
        /// The goal, which may be an earlier one: a drive that gets a goal again after it has arrived reports that again.
        goal: Pose,
        /// Where the module stands, within the tolerance of the drive.
        pose: Pose,
    },
    /// The module has stopped.
    Halted(Pose),
    /// The module is docked to this module.
    Docked(ModuleId),
    /// The module has undocked from this module.
    Undocked(ModuleId),
    /// The drive or a port cannot carry out its last goal. A module that was to move has not halted by that.
    Failed,
}
