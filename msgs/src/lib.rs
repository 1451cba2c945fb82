//! The messages of the formation suite, as they stand on the wire.
//!
//! The package is two things at once: a ROS 2 interface package (`msg/`, `srv/` and `action/`, built by colcon) and
//! the same types in Rust. Each struct here has the name of a `.msg` file, or of a section of a `.srv` or `.action`
//! file, and its fields in the order of that file; the file says what each field means and in which unit.
//!
//! Whatever arrives is raw. [`IntoCore`] makes validated data of [`formation_model`] of it, or a [`MessageError`]
//! that names the topic, the field and the reason; constructors go the other way. Messages are in metres and the core is in
//! units, so both take a [`formation_model::ModuleSize`]. Going out and in again changes nothing. Neither way panics,
//! and nothing grows beyond a constant factor of the bytes that arrived.

/// The numbers of an enumerated field: the constants of its message, each with its name in errors, and the conversions from
/// and to the core's type.
macro_rules! enumeration {
    ($message:ident $field:literal: $to_wire:ident, $from_wire:ident => $core:ident {
        $first:ident $first_name:ident $first_number:literal = $first_variant:ident,
        $($constant:ident $name:ident $number:literal = $variant:ident,)*
    }) => {
        #[expect(missing_docs, reason = "the .msg file documents the constants")]
        impl $message {
            pub const $first: u8 = $first_number;
            $(pub const $constant: u8 = $number;)*
        }

        pub(crate) fn $to_wire(value: $core) -> u8 {
            match value {
                $core::$first_variant => $first_number,
                $($core::$variant => $number,)*
            }
        }

        pub(crate) fn $from_wire(value: u8) -> $crate::check::Checked<$core> {
            match value {
                $first_number => Ok($core::$first_variant),
                $($number => Ok($core::$variant),)*
                value => {
                    let known = concat!(
                        stringify!($first_name), " ", $first_number
                        $(, ", ", stringify!($name), " ", $number)*
                    );
                    Err($crate::check::FieldError::unknown($field, value, known))
                }
            }
        }
    };
}

/// Conversions of what arrives into validated data, each with the topic that errors name; messages `with lengths` need the
/// size of modules.
macro_rules! validated {
    ($($raw:ty => $core:ty, $topic:path $(, $with_lengths:ident)?;)+) => {
        $(impl IntoCore<$core> for $raw {
            fn into_core(self, size: model::ModuleSize) -> Result<$core, MessageError> {
                validated!(@ self, size $(, $with_lengths)?).map_err(|error| error.on($topic))
            }
        })+
    };
    (@ $message:ident, $size:ident) => {{
        let _ = $size;
        $message.validated()
    }};
    (@ $message:ident, $size:ident, with_lengths) => {
        $message.validated($size)
    };
}

/// The names of types. A section of a service or an action has the name of its file before its own.
macro_rules! interface_types {
    ($package:literal: $($name:ident $(= $full_name:literal)?),+ $(,)?) => {
        $(impl $crate::InterfaceType for $name {
            const PACKAGE: &str = $package;
            const NAME: &str = interface_types!(@ $name $($full_name)?);
        })+
    };
    (@ $name:ident) => {
        stringify!($name)
    };
    (@ $name:ident $full_name:literal) => {
        $full_name
    };
}

/// The text of a file of the package, with the name of its interface.
macro_rules! interface_file {
    ($kind:literal, $name:ident) => {
        (
            concat!("formation_msgs/", $kind, "/", stringify!($name)),
            include_str!(concat!("../", $kind, "/", stringify!($name), ".", $kind)),
        )
    };
}

macro_rules! define {
    (
        msg { $($message:ident $(=> $core:ty, $topic:ident $(, $with_lengths:ident)?)?;)+ }
        srv { $($service:ident: $($part:ident = $part_name:literal),+;)+ }
        action { $($action:ident: $($section:ident = $section_name:literal),+;)+ }
    ) => {
        interface_types!("formation_msgs": $($message),+);
        interface_types!("formation_msgs": $($($part = $part_name),+),+);
        interface_types!("formation_msgs": $($($section = $section_name),+),+);

        $($(validated! { $message => $core, topic::$topic $(, $with_lengths)?; })?)+

        /// The interfaces of the package: the name of each, such as `formation_msgs/msg/Spot`, and the text of its file, for
        /// programs that compute type hashes from them.
        pub const INTERFACES: &[(&str, &str)] = &[
            $(interface_file!("msg", $message),)+
            $(interface_file!("srv", $service),)+
            $(interface_file!("action", $action),)+
        ];
    };
}

/// Calls a macro with the interfaces of the package: each message, with the data of the core that it becomes and its topic if it
/// is validated; and the sections of each service and action. Whatever there is for each of them follows from this.
#[doc(hidden)]
#[macro_export]
macro_rules! interfaces {
    ($with:ident) => {
        $with! {
            msg {
                Area;
                Body;
                CausalMark;
                DockingRequest => (model::ModuleId, model::DockingRequest), DOCKING;
                DockingResult => (model::ModuleId, model::DockingResult), DOCKING_RESULT;
                Edge;
                Epoch;
                Eviction => model::EvictionNotice, EVICTIONS;
                EvictionRecord;
                Heartbeat => Vec<model::Heartbeat>, HEARTBEATS, with_lengths;
                ModuleHeartbeat;
                ModuleState => model::ModuleState, MODULE_STATES, with_lengths;
                ModuleStates => Vec<model::ModuleState>, MODULE_STATES, with_lengths;
                OperatorCommand => Vec<model::Message>, COMMANDS;
                PlannerParameters;
                PolicyOption;
                Progress;
                Removal;
                Roster => model::RosterMessage, ROSTER, with_lengths;
                RosterMember;
                Spot;
                SpotClaim => model::SpotClaim, CLAIMS;
                SpotSelection;
                Stop;
                TargetConfiguration => model::TargetAnnouncement, TARGET, with_lengths;
                Verdict;
                WorldReport;
            }
            srv {
                AddModule: AddModuleRequest = "AddModule_Request", AddModuleResponse = "AddModule_Response";
                PushModule: PushModuleRequest = "PushModule_Request", PushModuleResponse = "PushModule_Response";
                QueryStatus: QueryStatusRequest = "QueryStatus_Request", QueryStatusResponse = "QueryStatus_Response";
                RemoveModule: RemoveModuleRequest = "RemoveModule_Request", RemoveModuleResponse = "RemoveModule_Response";
                RetireModule: RetireModuleRequest = "RetireModule_Request", RetireModuleResponse = "RetireModule_Response";
                StopFormation: StopFormationRequest = "StopFormation_Request", StopFormationResponse = "StopFormation_Response";
                WithdrawTarget: WithdrawTargetRequest = "WithdrawTarget_Request", WithdrawTargetResponse = "WithdrawTarget_Response";
            }
            action {
                FormConfiguration:
                    FormConfigurationGoal = "FormConfiguration_Goal",
                    FormConfigurationResult = "FormConfiguration_Result",
                    FormConfigurationFeedback = "FormConfiguration_Feedback";
            }
        }
    };
}

mod body;
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
mod operator;
mod progress;
mod roster;
mod services;
mod session;
mod standard;
mod target;
pub mod topic;
mod verdict;
mod world_report;

use formation_model as model;

pub use body::Body;
pub use check::PROTOCOL_VERSION;
pub use claim::{Eviction, EvictionRecord, SpotClaim, SpotSelection};
pub use docking::{DockingRequest, DockingResult};
pub use driver_pose::DriverPose;
pub use epoch::Epoch;
pub use error::{Fault, MessageError};
pub use form_configuration::{
    FormConfigurationFeedback, FormConfigurationGoal, FormConfigurationResult,
};
pub use heartbeat::{Heartbeat, ModuleHeartbeat};
pub use module_state::{CausalMark, ModuleState, ModuleStates};
pub use operator::{OperatorCommand, Removal, Stop};
pub use progress::Progress;
pub use roster::{Roster, RosterMember};
pub use services::{
    AddModuleRequest, AddModuleResponse, PushModuleRequest, PushModuleResponse, QueryStatusRequest,
    QueryStatusResponse, RemoveModuleRequest, RemoveModuleResponse, RetireModuleRequest,
    RetireModuleResponse, StopFormationRequest, StopFormationResponse, WithdrawTargetRequest,
    WithdrawTargetResponse,
};
pub use session::{InSession, SessionId};
pub use standard::{Duration, Header, Time};
pub use target::{Area, Edge, PlannerParameters, PolicyOption, Spot, TargetConfiguration};
pub use verdict::Verdict;
pub use world_report::WorldReport;

/// Stands for "none" where an identifier is optional.
pub const NONE: u32 = model::NO_ID;

/// A message, which becomes validated data of the core.
pub trait IntoCore<T> {
    /// The message as data of the core. Lengths in metres become units of `size`.
    ///
    /// # Errors
    /// Names the field that is wrong, or that the message is for modules of another size.
    fn into_core(self, size: model::ModuleSize) -> Result<T, MessageError>;
}

/// Names a type as ROS 2 does: `PACKAGE/msg/NAME`. A section of a service or an action
/// is named after both, as `NAME_Request` is.
pub trait InterfaceType {
    /// The package that defines the type.
    const PACKAGE: &str;
    /// The type within the package.
    const NAME: &str;
}

interface_types!("builtin_interfaces": Duration, Time);
interface_types!("std_msgs": Header);
interfaces!(define);
