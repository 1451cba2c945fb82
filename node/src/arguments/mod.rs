//! The command-line arguments that the executables share.

mod judging;
mod modules;
mod network;
mod scenario;
mod timing;

pub use judging::JudgingArguments;
pub use modules::{HostedModules, ModuleArguments, ModuleList, require_leader};
pub use network::NetworkArguments;
pub use scenario::read_scenario;
pub use timing::{MotionArguments, Seconds, TimingArguments};
