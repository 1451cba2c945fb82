//! The tests of simulated formations.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod attacks;
mod bodies;
mod breaks;
mod exploration;
mod explorer;
mod faults;
mod forming;
mod lapse;
mod majority_model;
mod mutations;
mod observed;
mod paths;
mod planning;
mod recovery;
mod removals;
mod same_numbers;
mod service;
mod stop;
mod stores;
mod support;
mod transcripts;
mod withdrawn_goals;
