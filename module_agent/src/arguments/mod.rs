//! The arguments of agents.

mod memory;
mod modules;
mod motion;
mod timing;

pub use memory::Memory;
pub(crate) use modules::single_module;
pub use modules::{HostedModules, ModuleArguments, require_leader};
pub use motion::{Motion, MotionMode};
pub use timing::Timing;
