//! The arguments of agents.

mod modules;
mod motion;
mod stores;
mod timing;

pub(crate) use modules::single_module;
pub use modules::{HostedModules, ModuleArguments, require_leader};
pub use motion::{DriveMode, Motion};
pub use stores::StoreOptions;
pub use timing::AgentTiming;
