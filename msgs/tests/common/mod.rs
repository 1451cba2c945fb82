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
pub mod hostile;
pub mod python;
pub mod samples;
pub mod surroundings;

use proptest::prelude::ProptestConfig;

/// How many cases a test tries: `FORMATION_FUZZ_CASES` of them where that is set, as `tests/soak_fuzz.sh` does.
pub fn cases(usual: u32) -> ProptestConfig {
    let cases = std::env::var("FORMATION_FUZZ_CASES").ok();
    let cases = cases.map_or(usual, |cases| cases.parse().unwrap());
    ProptestConfig::with_cases(cases)
}
