//! Why messages are refused. Refusals are counted by kind and stop no module.

use std::collections::BTreeMap;
use std::fmt;

/// Why a message was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Refusal {
    /// It belongs to an epoch that is over.
    StaleEpoch,
    /// It comes from a run of the process that is over, or repeats an older state.
    StaleIncarnation,
    /// It names a live module but comes from another process.
    WrongSource,
    /// It comes from a second process under a live module's identifier.
    DuplicateModule,
    /// Its sender is not a member of the roster.
    UnknownModule,
    /// It claims a turn that is another unit's.
    WrongClaimant,
    /// Its decision differs from this module's own recomputation.
    DifferentDecision,
    /// It announces another target under a known revision.
    ContradictingTarget,
    /// Its roster contradicts itself or this module's announced state.
    BadRoster,
    /// Its roster lacks a majority of an earlier one.
    NoQuorum,
    /// Its epoch is too far ahead of every known epoch.
    ImplausibleEpoch,
    /// It came before its turn, and the buffer for early claims is full.
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

    /// The kind in one word, as in counters and logs.
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

    /// Whether it is the ordinary lateness of a network, which is counted but not logged.
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
            Self::WrongSource => "it comes from another process than the module's own",
            Self::DuplicateModule => "a second process runs under a live module's identifier",
            Self::UnknownModule => "its sender is not a member of the roster",
            Self::WrongClaimant => "the turn is another unit's",
            Self::DifferentDecision => "its decision differs from our own recomputation",
            Self::ContradictingTarget => "it announces another target under a known revision",
            Self::BadRoster => "its roster contradicts itself or our announced state",
            Self::NoQuorum => "its roster lacks a majority of an earlier one",
            Self::ImplausibleEpoch => "its epoch is too far ahead of every known epoch",
            Self::BufferFull => "it came before its turn, and the buffer for early claims is full",
            Self::TooManyModules => "it names more modules than a formation may have",
        })
    }
}

/// The number of refused messages by kind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RefusalCounts(BTreeMap<Refusal, u64>);

impl RefusalCounts {
    /// Counts one refusal.
    pub fn add(&mut self, refusal: Refusal) {
        *self.0.entry(refusal).or_default() += 1;
    }

    /// The number of refusals of a kind.
    #[must_use]
    pub fn of(&self, refusal: Refusal) -> u64 {
        self.0.get(&refusal).copied().unwrap_or_default()
    }

    /// The number of all refusals.
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
