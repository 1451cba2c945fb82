//! Helpers of the tests of paths: cases, and bodies that follow a plan.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

pub mod bodies;
pub mod exact;
pub mod motion;
#[path = "../../../planner/tests/support/numbers.rs"]
mod numbers;
pub mod stops;
pub mod walls;

pub use numbers::Numbers;
