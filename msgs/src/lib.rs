//! The messages of the formation suite, as they stand on the wire.
//!
//! The package is two things at once: a ROS 2 interface package (`msg/`, `srv/` and `action/`, built by colcon) and
//! the same types in Rust. Each struct here has the name of a `.msg` file, or of a section of a `.srv` or `.action`
//! file, and its fields in the order of that file; the file says what each field means and in which unit.
//!
//! Whatever arrives is raw. `TryFrom` makes validated data of [`formation::model`] of it, or a [`MessageError`]
//! that names the topic, the field and the reason; `From<&_>` goes the other way. Going out and in again changes
//! nothing. Neither way panics, and nothing grows beyond a constant factor of the bytes that arrived.

pub mod bounds;
mod check;
mod claim;
mod docking;
mod driver_pose;
mod epoch;
mod error;
pub mod external;
mod form_configuration;
mod heartbeat;
mod module_state;
mod progress;
mod roster;
mod services;
mod standard;
mod target;
pub mod topic;
mod verdict;

pub use claim::{Eviction, EvictionRecord, SpotClaim, SpotSelection};
pub use docking::{DockingRequest, DockingResult};
pub use driver_pose::DriverPose;
pub use epoch::{Epoch, QuorumBasis};
pub use error::{Fault, MessageError};
pub use form_configuration::{
    FormConfigurationFeedback, FormConfigurationGoal, FormConfigurationResult,
};
pub use heartbeat::{Heartbeat, ModuleHeartbeat};
pub use module_state::{CausalMark, ModuleState, ModuleStates};
pub use progress::Progress;
pub use roster::{Roster, RosterMember};
pub use services::{
    AddModuleRequest, AddModuleResponse, QueryStatusRequest, QueryStatusResponse,
    RetireModuleRequest, RetireModuleResponse, WithdrawTargetRequest, WithdrawTargetResponse,
};
pub use standard::{Duration, Header, Time};
pub use target::{Edge, PlannerParameters, Spot, TargetConfiguration};
pub use verdict::Verdict;

/// Stands for "none" where an identifier is optional.
pub const NONE: u32 = formation::model::NO_ID;

/// Names a type as ROS 2 does: `PACKAGE/msg/NAME`. A section of a service or an action
/// is named after both, as `NAME_Request` is.
pub trait InterfaceType {
    /// The package that defines the type.
    const PACKAGE: &str;
    /// The type within the package.
    const NAME: &str;
}

macro_rules! interface_types {
    ($package:literal: $($name:ident),+ $(,)?) => {
        $(impl InterfaceType for $name {
            const PACKAGE: &str = $package;
            const NAME: &str = stringify!($name);
        })+
    };
}

interface_types!("builtin_interfaces": Duration, Time);
interface_types!("std_msgs": Header);
interface_types!(
    "formation_msgs":
    CausalMark,
    DockingRequest,
    DockingResult,
    Edge,
    Epoch,
    Eviction,
    EvictionRecord,
    Heartbeat,
    ModuleHeartbeat,
    ModuleState,
    ModuleStates,
    PlannerParameters,
    Progress,
    QuorumBasis,
    Roster,
    RosterMember,
    Spot,
    SpotClaim,
    SpotSelection,
    TargetConfiguration,
    Verdict,
);

macro_rules! sections {
    ($($type:ident = $name:literal),+ $(,)?) => {
        $(impl InterfaceType for $type {
            const PACKAGE: &str = "formation_msgs";
            const NAME: &str = $name;
        })+
    };
}

sections!(
    AddModuleRequest = "AddModule_Request",
    AddModuleResponse = "AddModule_Response",
    FormConfigurationFeedback = "FormConfiguration_Feedback",
    FormConfigurationGoal = "FormConfiguration_Goal",
    FormConfigurationResult = "FormConfiguration_Result",
    QueryStatusRequest = "QueryStatus_Request",
    QueryStatusResponse = "QueryStatus_Response",
    RetireModuleRequest = "RetireModule_Request",
    RetireModuleResponse = "RetireModule_Response",
    WithdrawTargetRequest = "WithdrawTarget_Request",
    WithdrawTargetResponse = "WithdrawTarget_Response",
);

mod external_types {
    use super::InterfaceType;
    use super::external::geometry_msgs::{
        Point, Pose, PoseStamped, PoseWithCovariance, Quaternion, Transform, TransformStamped,
        Twist, TwistWithCovariance, Vector3,
    };
    use super::external::nav_msgs::Odometry;
    use super::external::sensor_msgs::CompressedImage;
    use super::external::std_msgs::ColorRGBA;
    use super::external::tf2_msgs::TFMessage;
    use super::external::visualization_msgs::{Marker, MarkerArray, MeshFile, UVCoordinate};

    interface_types!(
        "geometry_msgs":
        Point,
        Pose,
        PoseStamped,
        PoseWithCovariance,
        Quaternion,
        Transform,
        TransformStamped,
        Twist,
        TwistWithCovariance,
        Vector3,
    );
    interface_types!("nav_msgs": Odometry);
    interface_types!("sensor_msgs": CompressedImage);
    interface_types!("std_msgs": ColorRGBA);
    interface_types!("tf2_msgs": TFMessage);
    interface_types!("visualization_msgs": Marker, MarkerArray, MeshFile, UVCoordinate);
}
