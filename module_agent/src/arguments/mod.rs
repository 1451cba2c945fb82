//! The command-line arguments of agents.

mod modules;
mod motion;
mod timing;

pub use modules::{HostedModules, ModuleArguments, ModuleList, require_leader};
pub use motion::{MotionArguments, MotionMode};
pub(crate) use motion::{motion_declarations, motion_parameters};
pub use timing::TimingArguments;
pub(crate) use timing::{agent_declarations, agent_parameters};
