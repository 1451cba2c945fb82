//! The command line of a node.

mod command_line;
mod network;
mod ros;

pub use command_line::{completions, parse, read_bounded, text_of};
pub use network::NetworkArguments;
pub use ros::{
    LogArguments, LogLevel, Namespace, NodeIdentity, Origin, ParameterAssignment,
    ParameterAssignments, RemapRule, RemapRules, Resource, RosArguments,
};
