//! The tests of simulated formations that give no agent a bug; `with_bugs.rs` has the others.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod agreement_model;
mod carried;
mod departures;
mod exits;
mod faults;
mod first_motion;
mod forming;
mod given;
mod lapse;
mod one_way_links;
mod planning;
mod service;
mod silent_drivers;
mod stop;
#[allow(dead_code, reason = "the tests with deliberate bugs use it as well")]
mod support;
mod suspended;
mod swaps;
mod transcripts;
