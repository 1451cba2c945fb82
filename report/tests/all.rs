//! The tests of pictures and pages as their readers get them.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, and so do its helpers"
)]

mod animation;
mod page;
mod pictures;
mod support;
