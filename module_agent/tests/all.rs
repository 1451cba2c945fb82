//! The tests of the process that hosts modules.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod arguments;
mod parameter_services;
mod process;
