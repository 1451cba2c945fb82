//! Quorums: which modules may form a roster.
//!
//! A roster holds a majority of the voters of the session, so any two rosters share a voter, and a voter shows one epoch at a time.
//! With the leases of A1 and A2 no two plans are ever in motion at once, and nobody needs to remember anything for that.
//!
//! Where robots stand must be remembered. A majority counts voters that *know*: that have forgotten nothing since they began to take
//! part. Of each roster in force one of them is in the next, and knows its bodies (Liskov and Cowling, "Viewstamped Replication
//! Revisited", 2012, section 4.3: a replica that recovers takes part only after a majority has answered it). A roster of all voters
//! needs nobody who knows.

use std::collections::BTreeSet;

use thiserror::Error;

use formation_model::{ModuleId, Voters};

/// Why a set of modules cannot have a roster of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Error)]
pub enum Shortfall {
    /// A majority is missing.
    #[error("{present} of {of} are within reach{}", ignorant(*.forgetful))]
    Majority {
        /// The number of voters present that count.
        present: usize,
        /// The number of voters of whom a majority is needed.
        of: usize,
        /// The number of voters present that do not count, as they do not know what was agreed before.
        forgetful: usize,
    },
    /// This module knows no voters, and others do.
    #[error("others know who votes, and this module is yet to learn it from a target or a roster")]
    VotersUnknown,
}

fn ignorant(forgetful: usize) -> String {
    match forgetful {
        0 => String::new(),
        count => format!(
            ", and {count} more that have forgotten what was agreed and count once all voters are back"
        ),
    }
}

/// The majority that these modules lack, which ascend, each with whether it knows.
///
/// Where no voters are named, `expected` modules take the place of theirs, if that number is known.
/// Enforces Q1, Q2, Q3.
pub(super) fn shortfall(
    voters: &Voters,
    expected: Option<u32>,
    present: impl Iterator<Item = (ModuleId, bool)>,
) -> Option<Shortfall> {
    if voters.named.is_empty() {
        let is_removed =
            |module: &ModuleId| voters.removed.contains(module) || voters.listed.contains(module);
        let present = present.filter(|(module, _)| !is_removed(module)).count();
        let expected = usize::try_from(expected?).ok()?;
        let of = expected.saturating_sub(voters.removed.len());
        let remaining = of.saturating_sub(voters.listed.len());
        let suffices = present * 2 > of || (present > 0 && present >= remaining);
        return (!suffices).then_some(Shortfall::Majority {
            present,
            of,
            forgetful: 0,
        });
    }
    let remaining: BTreeSet<ModuleId> = voters.remaining().collect();
    let present = present.filter(|(module, _)| remaining.contains(module));
    let (know, forgetful): (Vec<_>, Vec<_>) = present.partition(|&(_, knows)| knows);
    let are_all = !remaining.is_empty() && know.len() + forgetful.len() == remaining.len();
    let of = voters.counted().count();
    let has_lowest = know.first().map(|&(module, _)| module) == voters.counted().next();
    let is_majority = know.len() * 2 > of || (know.len() * 2 == of && has_lowest);
    (!are_all && !is_majority).then_some(Shortfall::Majority {
        present: know.len(),
        of,
        forgetful: forgetful.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn modules(ids: &[u32]) -> Vec<ModuleId> {
        ids.iter().copied().map(ModuleId).collect()
    }

    fn voters(count: u32) -> Voters {
        Voters {
            named: (1..=count).map(ModuleId).collect(),
            ..Voters::default()
        }
    }

    fn lacks(voters: &Voters, know: &[u32], forgetful: &[u32]) -> bool {
        let mut present: Vec<(ModuleId, bool)> =
            modules(know).into_iter().map(|one| (one, true)).collect();
        present.extend(modules(forgetful).into_iter().map(|one| (one, false)));
        present.sort_unstable();
        shortfall(voters, Some(2), present.into_iter()).is_some()
    }

    /// Shows Q1.
    #[test]
    fn a_roster_needs_more_than_half_of_the_voters() {
        let five = voters(5);
        assert!(lacks(&five, &[1, 2], &[]));
        assert!(lacks(&five, &[1, 2, 8, 9], &[]), "others do not vote");
        assert!(!lacks(&five, &[2, 4, 5], &[]));
    }

    /// Shows Q1.
    #[test]
    fn exactly_half_suffices_with_the_lowest_voter() {
        let four = voters(4);
        assert!(!lacks(&four, &[1, 4], &[]));
        assert!(lacks(&four, &[2, 3, 4][..2], &[]));
    }

    /// Shows Q2.
    #[test]
    fn those_that_have_forgotten_count_only_if_all_are_there() {
        let four = voters(4);
        assert!(lacks(&four, &[1], &[2, 3]));
        assert!(!lacks(&four, &[], &[1, 2, 3, 4]));
        assert!(!lacks(&four, &[1, 2, 3], &[4]));
    }

    /// Shows Q3.
    #[test]
    fn a_removal_that_is_listed_takes_a_vote_and_one_in_force_lowers_the_number_needed() {
        let mut voters = voters(5);
        voters.listed.insert(ModuleId(5));
        assert!(lacks(&voters, &[2, 3, 5], &[]));
        assert!(lacks(&voters, &[1, 2], &[]), "of five");
        voters.settle();
        assert!(!lacks(&voters, &[1, 2], &[]), "of four, with the lowest");
        assert!(!lacks(&voters, &[2, 3, 4], &[]));
        assert!(lacks(&voters, &[2, 3], &[]));
        voters.removed.extend(modules(&[1, 2]));
        assert!(lacks(&voters, &[4], &[]));
        assert!(!lacks(&voters, &[3], &[]), "the lowest of two");
    }

    /// Shows Q1.
    #[test]
    fn without_named_voters_a_majority_of_the_expected_is_needed() {
        let present = |ids: &[u32]| modules(ids).into_iter().map(|one| (one, false));
        let mut voters = Voters::default();
        assert!(shortfall(&voters, Some(4), present(&[1, 2])).is_some());
        assert!(shortfall(&voters, Some(4), present(&[1, 2, 9])).is_none());
        assert!(shortfall(&voters, None, present(&[1])).is_none());
        voters.removed.insert(ModuleId(4));
        assert!(shortfall(&voters, Some(4), present(&[1, 2])).is_none());
        voters.listed.extend(modules(&[3, 5, 6]));
        assert!(shortfall(&voters, Some(7), present(&[1, 2])).is_some());
        assert!(shortfall(&voters, Some(7), present(&[1, 2, 7])).is_none());
    }
}
