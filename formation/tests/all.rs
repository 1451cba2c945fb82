//! The tests of the launcher as its users meet it.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod check;
mod compare;
mod experiments;
mod explain;
mod generate;
mod incomplete;
mod manual;
mod outputs;
mod plan;
mod run;
mod scenario_files;
mod show;
mod simulate;
mod streams;
mod verifier_lines;
