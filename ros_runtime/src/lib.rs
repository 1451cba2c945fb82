//! A ROS 2 node without a ROS 2 installation. This crate knows nothing of formations.
//!
//! Every process is one [`session::Session`]: one DDS participant, one node, and as few endpoints as it needs.

pub mod action;
pub mod arguments;
pub mod diagnostics;
pub mod environment;
pub mod facilities;
pub mod goals;
pub mod inbox;
pub mod inlet;
pub mod interfaces;
pub mod lifetime;
pub mod logging;
pub mod outcome;
pub mod outlet;
pub mod parameters;
mod pulse;
pub mod rosout;
pub mod service;
pub mod service_mapping;
pub mod session;
pub mod settings;
pub mod stamp;
mod standstill;
pub mod topic;
pub mod traffic;
