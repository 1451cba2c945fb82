//! The tests of messages on the wire.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod agents;
mod common;
mod decoding;
mod external;
mod given;
mod hostile_values;
mod interfaces;
mod refusals;
mod round_trip;
mod verdicts;
