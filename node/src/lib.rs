//! The ROS 2 shell of the formation suite.
//!
//! The core decides; this crate carries. It is the only one that knows DDS: it joins the ROS 2 graph, turns samples
//! into the core's messages and back, keeps time, and ends in order. Every process is one [`session::Session`]: one
//! DDS participant, one node, and as few endpoints as it needs, however many modules it hosts.

mod action;
pub mod agents;
pub mod announcer;
pub mod arguments;
pub mod diagnostics;
mod drive;
mod drivers;
pub mod environment;
mod facilities;
mod goals;
mod host;
mod inbox;
mod inlet;
pub mod interfaces;
pub mod lifetime;
pub mod logging;
mod membership;
pub mod outcome;
mod outlet;
pub mod parameters;
mod pulse;
pub mod rosout;
pub mod service;
pub mod service_mapping;
pub mod session;
pub mod settings;
mod speakers;
pub mod stamp;
mod standstill;
mod tally;
pub mod topics;
pub mod traffic;
pub mod verdict_report;
pub mod verification;
pub mod visualisation;

pub use drive::MotionParameters;
pub use drivers::{ExternalMotion, PoseSource};
