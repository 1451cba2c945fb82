//! What tests across the suite share: our programs as processes, and another vendor's DDS as a peer.
//!
//! A failure in here fails the test that calls it, so this panics where a library would return an error.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

mod fleet;
mod namespaces;
mod parameter_file;
mod peer;
mod programs;
mod python;
mod ros_tool;
mod scenario_file;
mod transcript;

pub use fleet::{Fleet, Judge, Judged, Timing};
pub use namespaces::{Namespace, Network};
pub use parameter_file::parameter_section;
pub use peer::Peer;
pub use programs::{Finished, Running, alone, program, root, scenario_path};
pub use python::Python;
pub use ros_tool::RosTool;
pub use scenario_file::{EIGHT, ScenarioFile};
pub use transcript::{Line, Transcript};
