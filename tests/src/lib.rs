//! What tests across the suite share: our programs as processes, and another vendor's DDS as a peer.
//!
//! A failure in here fails the test that calls it, so this panics where a library would return an error.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

mod domain;
mod fleet;
mod hiroz;
mod namespaces;
mod parameter_file;
mod peer;
mod programs;
mod python;
mod rclpy;
mod ros_tool;
mod scenario_file;
mod tools;
mod trace;
mod transcript;

pub use domain::Domain;
pub use fleet::{Fleet, FleetTiming, Judge, Judged};
pub use hiroz::HirozPeer;
pub use namespaces::{Namespace, Network, room_for_many_processes};
pub use parameter_file::parameter_section;
pub use peer::Peer;
pub use programs::{Finished, Running, program, root, scenario_path};
pub use python::Python;
pub use rclpy::Rclpy;
pub use ros_tool::RosTool;
pub use rustix::process::Signal;
pub use scenario_file::{EIGHT, ScenarioFile};
pub use tools::{Tool, on_path, report, tool_or_skip};
pub use trace::{Overlap, overlaps};
pub use transcript::{Line, Transcript};
