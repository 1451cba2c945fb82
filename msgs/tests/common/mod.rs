//! Values to test with, and each type's way over the wire; shared by the test programs of this crate.

#![allow(
    dead_code,
    reason = "each test program that includes this uses a part of it"
)]
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure here fails the test that needs the value"
)]

pub mod codec;
pub mod core_values;
pub mod python;
pub mod samples;
