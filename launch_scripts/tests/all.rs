//! The tests of the launcher as its users meet it.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod check;
mod experiments;
mod explain;
mod generate;
mod manual;
mod outputs;
mod plan;
mod run;
mod show;
mod simulate;
mod verifier_lines;
