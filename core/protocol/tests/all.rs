//! The tests of one agent alone.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod duplicate_module;
mod pins;
mod removals;
mod replica;
mod stuck;
