//! The command-line arguments that the executables share.

mod command_line;
mod network;
mod ros;
mod seconds;
pub mod text_file;

pub use command_line::parse;
pub use network::NetworkArguments;
pub use ros::suggestion;
pub use ros::{
    ArgumentError, Assignment, LogArguments, LogLevel, NameError, NodeIdentity, Origin,
    ParameterAssignments, RemapError, RemapRule, RemapRules, Resource, RosArguments, assigned_in,
};
pub use seconds::{SECONDS, Seconds};
