//! The tests of the harness and of its plots.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod harness;
mod plots;
mod published;
mod support;
