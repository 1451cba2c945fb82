//! Identifiers, each with its own type, so that a spot cannot be passed where a module is expected.

use std::fmt;

use serde::{Deserialize, Serialize};

/// What a program can say to people about any identifier.
pub trait Identifier: Copy {
    /// What it identifies, in the singular.
    const NOUN: &'static str;

    /// Its number.
    fn number(self) -> u32;
}

macro_rules! identifier {
    ($(#[$documentation:meta])* $name:ident, $word:literal) => {
        $(#[$documentation])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub u32);

        impl Identifier for $name {
            const NOUN: &'static str = $word;

            fn number(self) -> u32 {
                self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(formatter, concat!($word, " {}"), self.0)
            }
        }
    };
}

identifier!(
    /// Identifies one module for its whole life, across restarts.
    ModuleId,
    "module"
);
identifier!(
    /// Identifies one spot of the target configuration.
    SpotId,
    "spot"
);
identifier!(
    /// Identifies one initial configuration.
    ConfigurationId,
    "configuration"
);

/// The identifier that means "none" in messages; no module, spot or configuration may have it.
pub const NO_ID: u32 = u32::MAX;

/// Distinguishes the runs of a module's process: the wall-clock time of its start in microseconds.
///
/// A larger incarnation is a later start of the same module.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct Incarnation(pub u64);

/// One run of one module's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ModuleRun {
    /// The module.
    pub module: ModuleId,
    /// The start of its process.
    pub incarnation: Incarnation,
}

impl ModuleId {
    /// The run of this module's process that this start began.
    #[must_use]
    pub const fn run(self, incarnation: Incarnation) -> ModuleRun {
        ModuleRun {
            module: self,
            incarnation,
        }
    }
}

/// One attempt to agree on a plan; ordered by number, then by convener.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Epoch {
    /// Counts the attempts, from 1.
    pub number: u64,
    /// The module that opened the epoch.
    pub convener: ModuleId,
}

impl fmt::Display for Epoch {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "epoch {}.{}", self.number, self.convener.0)
    }
}

/// The first eight bytes of a SHA-256 over a roster and every decision made on it. Two agents with equal digests hold the
/// same plan for the same epoch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Digest(pub u64);

impl fmt::Display for Digest {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:016x}", self.0)
    }
}

/// The sender of a message as the transport identifies it: one value a participant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SourceId(pub u128);
