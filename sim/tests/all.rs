//! The tests of simulated formations.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod attacks;
mod exploration;
mod explorer;
mod faults;
mod forming;
mod mutations;
mod observed;
mod recovery;
mod service;
mod support;
mod transcripts;
