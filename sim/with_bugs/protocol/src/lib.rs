//! The protocol with deliberate bugs, one of which a test may choose for an agent: a copy of `core/protocol/src`, in which
//! `build.rs` has applied `bugs.patch`.
//!
//! The protocol itself has no trace of them, and no program can depend on this crate by accident. To add or change a bug:
//! `git apply sim/with_bugs/protocol/bugs.patch`, edit, `git diff -U1 core/protocol >sim/with_bugs/protocol/bugs.patch`,
//! `git restore core/protocol`; its name is in `mutation.rs`.

include!(concat!(env!("OUT_DIR"), "/protocol/lib.rs"));
