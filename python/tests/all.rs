//! The Python package, with the extension module of this build.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

mod package;
mod ros;
