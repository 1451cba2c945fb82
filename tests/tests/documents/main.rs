//! The documents are true of the repository, and all of its text keeps to one vocabulary and to the rules of layout.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

mod files;
mod references;
mod sources;
mod words;
