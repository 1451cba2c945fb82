//! A process that hosts modules: their agents, their drives, and what they publish together.
//!
//! [`ModuleProcess::run`] is the whole life of such a process.

pub mod arguments;
mod drive;
mod drivers;
mod host;
mod journal;
mod membership;
mod module_diagnostics;
mod process;
mod replays;
mod store;
mod worker;

pub use process::ModuleProcess;
