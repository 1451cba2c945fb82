//! The tests of the target publisher as a process.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod action;
mod interoperation;
mod process;
