//! Why messages are refused. Refusals are counted by kind and stop no module.

use std::collections::BTreeMap;
use std::fmt;

use thiserror::Error;

use formation_model::text::joined;

/// Declares the kinds of refusals, each with its name in counters and its text in logs.
macro_rules! refusals {
    ($($(#[$documentation:meta])* $kind:ident = $name:literal: $text:literal,)*) => {
        /// Why a message was refused.
        /// Enforces C2.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Error)]
        pub enum Refusal {
            $($(#[$documentation])* #[error($text)] $kind,)*
        }

        impl Refusal {
            /// The kind in one word, as in counters and logs.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$kind => $name,)*
                }
            }
        }
    };
}

refusals! {
    /// It belongs to an epoch that is over.
    StaleEpoch = "stale_epoch": "its epoch is over",
    /// It comes from a run of the process that is over, or repeats an older state.
    StaleIncarnation = "stale_incarnation": "it is older than what is known of that module",
    /// It names a live module but comes from another process.
    WrongSource = "wrong_source": "it comes from another process than the module's own",
    /// It comes from a second process under a live module's identifier.
    DuplicateModule = "duplicate_module": "a second process runs under a live module's identifier",
    /// Its sender is not a member of the roster.
    UnknownModule = "unknown_module": "its sender is not a member of the roster",
    /// It claims a turn that is another unit's.
    WrongClaimant = "wrong_claimant": "the turn is another unit's",
    /// Its decision differs from this module's own recomputation.
    DifferentDecision = "different_decision": "its decision differs from our own recomputation",
    /// It announces another target under a known revision.
    ContradictingTarget = "contradicting_target": "it announces another target under a known revision",
    /// Its roster contradicts itself or this module's announced state.
    BadRoster = "bad_roster": "its roster contradicts itself or our announced state",
    /// Its roster lacks a majority of the voters.
    NoQuorum = "no_quorum": "its roster lacks a majority of the voters",
    /// Its roster does not list votes as removed that were.
    UnlistedVotes = "unlisted_votes": "its roster does not list votes as removed that were",
    /// Its roster opens a spot on which this module knows a body, or does not say where a body is.
    UnlistedBody = "unlisted_body": "its roster lacks a body that is known to stand on a spot or in the way",
    /// Its roster lists as removed a module that this one hears, or for which it has not listened for long enough.
    RemovalOfLiving = "removal_of_living": "its roster lists as removed a module that we hear, or have not listened for long enough",
    /// It reports as removed a run of which no message came, or this one.
    RemovalOfUnknownRun = "removal_of_unknown_run": "it reports as removed a run of which no message came, or our own",
    /// The revision of its command to stop or to resume is too far ahead of this module's clock.
    ImplausibleStop = "implausible_stop": "the revision of its stop command is too far ahead of our clock",
    /// Its epoch is too far ahead of this module's clock.
    ImplausibleEpoch = "implausible_epoch": "its epoch is too far ahead of our clock",
    /// Its incarnation is too far ahead of this module's clock.
    ImplausibleIncarnation = "implausible_incarnation": "its incarnation is too far ahead of our clock",
    /// Its revision is too far ahead of this module's clock and of every known revision.
    ImplausibleRevision = "implausible_revision": "its revision is too far ahead of our clock and of every known one",
    /// Its roster is for other heartbeat, suspicion and lease times than this module has.
    DifferentTiming = "different_timing": "its roster is for another heartbeat_s, suspicion_s or lease_s than ours",
    /// It names other voters than are known.
    OtherVoters = "other_voters": "it names other voters than this session has; begin a new session for them",
    /// It shows a body of another session under the number of a module of this one.
    NumberOfOtherSession = "number_of_other_session": "a module of another session has the number of one of this session; no plan leads around its body",
    /// It came before its turn, and the buffer for early claims is full.
    BufferFull = "buffer_full": "it came before its turn, and the buffer for early claims is full",
    /// It names more modules than a formation may have.
    TooManyModules = "too_many_modules": "it names more modules than a formation may have",
}

impl Refusal {
    /// Whether it is counted but not logged: the ordinary lateness of a network, and what one message may hold thousands of.
    #[must_use]
    pub fn is_ordinary(self) -> bool {
        matches!(
            self,
            Self::StaleEpoch | Self::StaleIncarnation | Self::RemovalOfUnknownRun
        )
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
        let counts = self.iter();
        let counts = counts.map(|(refusal, count)| format!("{} {count}", refusal.name()));
        formatter.write_str(&joined(counts, ", "))
    }
}
