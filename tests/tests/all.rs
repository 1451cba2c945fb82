//! The tests across crates: real processes, and parties that we did not write.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod action;
mod documents;
mod external_motion;
mod faults;
mod formations;
mod fresh_clients;
mod late_joiners;
mod launch_files;
mod observers;
mod off_lattice;
mod packages;
mod physical_world;
mod policies;
mod python_files;
mod rclpy;
mod recording;
mod report;
mod ros_tools;
mod rtps;
mod runs;
mod security;
mod services;
mod several_machines;
mod studio;
mod studio_page;
mod terminal;
mod tutorials;
mod visualiser;
#[cfg(feature = "zenoh")]
mod zenoh;
#[cfg(feature = "zenoh")]
mod zenoh_deeds;
#[cfg(feature = "zenoh")]
mod zenoh_hiroz;
#[cfg(feature = "zenoh")]
mod zenoh_security;
