//! Why messages are refused; each is counted by kind and stops nobody.

use std::collections::BTreeMap;
use std::fmt;

/// Why a message was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Refusal {
    /// It belongs to an epoch that is over.
    StaleEpoch,
    /// It comes from a run of the process that is over, or repeats an older state.
    StaleIncarnation,
    /// It names a living module but comes from another process.
    WrongSource,
    /// It comes from a second process under a living module's identifier.
    DuplicateModule,
    /// It speaks for a module that is no member of the roster.
    UnknownModule,
    /// It claims a turn that is another unit's.
    WrongClaimant,
    /// Its decision differs from this module's own recomputation.
    DifferentDecision,
    /// It announces another target under a known revision.
    ContradictingTarget,
    /// Its roster contradicts itself or what this module announced of itself.
    BadRoster,
    /// Its roster lacks a majority of an earlier one.
    NoQuorum,
    /// Its epoch is too far ahead to be true.
    ImplausibleEpoch,
    /// It came early and there is no room to keep it.
    BufferFull,
    /// It names more modules than a formation may have.
    TooManyModules,
}

impl Refusal {
    /// Every kind, for reports.
    pub const ALL: [Self; 13] = [
        Self::StaleEpoch,
        Self::StaleIncarnation,
        Self::WrongSource,
        Self::DuplicateModule,
        Self::UnknownModule,
        Self::WrongClaimant,
        Self::DifferentDecision,
        Self::ContradictingTarget,
        Self::BadRoster,
        Self::NoQuorum,
        Self::ImplausibleEpoch,
        Self::BufferFull,
        Self::TooManyModules,
    ];

    /// The kind in one word, as counters and logs name it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::StaleEpoch => "stale_epoch",
            Self::StaleIncarnation => "stale_incarnation",
            Self::WrongSource => "wrong_source",
            Self::DuplicateModule => "duplicate_module",
            Self::UnknownModule => "unknown_module",
            Self::WrongClaimant => "wrong_claimant",
            Self::DifferentDecision => "different_decision",
            Self::ContradictingTarget => "contradicting_target",
            Self::BadRoster => "bad_roster",
            Self::NoQuorum => "no_quorum",
            Self::ImplausibleEpoch => "implausible_epoch",
            Self::BufferFull => "buffer_full",
            Self::TooManyModules => "too_many_modules",
        }
    }

    /// Whether it is the ordinary lateness of a network, which deserves a count but no line in a log.
    #[must_use]
    pub fn is_ordinary(self) -> bool {
        matches!(self, Self::StaleEpoch | Self::StaleIncarnation)
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::StaleEpoch => "its epoch is over",
            Self::StaleIncarnation => "it is older than what is known of that module",
            Self::WrongSource => "it comes from another process than that module's",
            Self::DuplicateModule => "a second process runs under a living module's identifier",
            Self::UnknownModule => "it speaks for a module that is no member of the roster",
            Self::WrongClaimant => "the turn is another unit's",
            Self::DifferentDecision => "its decision differs from our own recomputation",
            Self::ContradictingTarget => "it announces another target under a known revision",
            Self::BadRoster => "its roster contradicts itself or what we announced of ourselves",
            Self::NoQuorum => "its roster lacks a majority of an earlier one",
            Self::ImplausibleEpoch => "its epoch is too far ahead to be true",
            Self::BufferFull => "it came early and there is no room to keep it",
            Self::TooManyModules => "it names more modules than a formation may have",
        })
    }
}

/// How many messages were refused, by kind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RefusalCounts(BTreeMap<Refusal, u64>);

impl RefusalCounts {
    /// Counts one.
    pub fn add(&mut self, refusal: Refusal) {
        *self.0.entry(refusal).or_default() += 1;
    }

    /// How many of that kind were refused.
    #[must_use]
    pub fn of(&self, refusal: Refusal) -> u64 {
        self.0.get(&refusal).copied().unwrap_or_default()
    }

    /// How many were refused in all.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.0.values().sum()
    }

    /// The kinds that occurred, with their counts.
    pub fn iter(&self) -> impl Iterator<Item = (Refusal, u64)> + '_ {
        self.0.iter().map(|(&refusal, &count)| (refusal, count))
    }
}

impl fmt::Display for RefusalCounts {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, (refusal, count)) in self.iter().enumerate() {
            let separator = if index > 0 { ", " } else { "" };
            write!(formatter, "{separator}{} {count}", refusal.name())?;
        }
        Ok(())
    }
}
