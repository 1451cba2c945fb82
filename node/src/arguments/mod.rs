//! The command-line arguments that the executables share.

mod command_line;
mod judging;
mod modules;
mod motion;
mod network;
mod ros;
mod scenario;
mod text_file;
mod timing;

pub use command_line::parse;
pub use judging::JudgingArguments;
pub(crate) use judging::{judging_declarations, judging_parameters};
pub use modules::{HostedModules, ModuleArguments, ModuleList, require_leader};
pub use motion::{MotionArguments, MotionMode};
pub(crate) use motion::{motion_declarations, motion_parameters};
pub use network::NetworkArguments;
pub(crate) use ros::suggestion;
pub use ros::{
    ArgumentError, Assignment, LogArguments, LogLevel, NameError, NodeIdentity, Origin,
    ParameterAssignments, RemapError, RemapRule, RemapRules, Resource, RosArguments,
};
pub use scenario::read_scenario;
pub(crate) use timing::{SECONDS, agent_declarations, agent_parameters};
pub use timing::{Seconds, TimingArguments};
