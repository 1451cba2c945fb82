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
pub use modules::{HostedModules, ModuleArguments, ModuleList, require_leader};
pub use motion::{MotionArguments, MotionMode};
pub use network::NetworkArguments;
pub use ros::{
    ArgumentError, Assignment, LogArguments, LogLevel, NameError, NodeIdentity, Origin,
    ParameterAssignments, RemapError, RemapRule, RemapRules, Resource, RosArguments,
};
pub use scenario::read_scenario;
pub use timing::{Seconds, TimingArguments};
