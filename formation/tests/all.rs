//! The tests of the core as a whole.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod baselines;
mod degenerate;
mod duplicate_module;
mod limits;
mod motion_paths;
mod motion_starts;
mod motion_stops;
mod obstacles;
mod oracles;
mod paper;
mod planning;
mod properties;
mod scenario_text;
mod support;
mod theorems;
mod verified_plans;
