//! The tests of the planner, with the verifier as a judge.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod baselines;
mod degenerate;
mod given;
mod limits;
mod oracles;
mod paper;
mod planning;
mod properties;
mod scenario_text;
mod spread;
mod support;
mod theorems;
mod verified_plans;
mod walls;
