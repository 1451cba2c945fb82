//! The arguments of agents.

mod modules;
mod motion;
mod timing;

pub use modules::{HostedModules, ModuleArguments, ModuleList, require_leader};
pub use motion::{Motion, MotionMode, PoseSource};
pub use timing::Timing;
