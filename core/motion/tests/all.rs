//! The tests of paths.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod dense;
mod exits;
mod motion_paths;
mod motion_starts;
mod motion_stops;
mod obstacles;
mod rows;
mod support;
mod swaps;
mod walled;
