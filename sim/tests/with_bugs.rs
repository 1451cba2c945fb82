//! The tests of simulated formations that also give agents deliberate bugs, to show that they would find real ones. They belong to
//! the package in `sim/with_bugs`.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

extern crate formation_sim_with_bugs as formation_sim;

mod attacks;
mod bodies;
mod breaks;
mod exploration;
mod explorer;
mod localisation;
mod mutations;
mod observed;
mod paths;
mod recovery;
mod removals;
mod same_numbers;
mod stores;
#[allow(dead_code, reason = "the tests of the simulator use it as well")]
mod support;
mod transcripts;
mod withdrawn_goals;
