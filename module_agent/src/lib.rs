//! A process that hosts modules: their agents, their drives, and what they publish together.

pub mod agents;
pub mod arguments;
mod drive;
mod drivers;
mod host;
mod membership;
mod tally;

pub use drive::MotionParameters;
pub use drivers::{ExternalMotion, PoseSource};
