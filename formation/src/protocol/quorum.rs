//! Quorums: the earlier rosters of which a new one must contain more than half, so that no two plans are in force at once.
//!
//! Runs of processes count, not modules: a module that has restarted does not know which later roster it agreed on before,
//! and so does not count towards the quorum (Liskov and Cowling, "Viewstamped Replication Revisited", 2012, section 4.3: a
//! replica that recovers takes part only after a majority with its memory intact has answered it). If every module of a
//! roster is present, no majority of that roster can be acting elsewhere, and restarted modules count too.

use std::collections::BTreeMap;

use crate::model::{Epoch, ModuleRun, QuorumBasis};

/// The greatest number of rosters that are kept with a shown digest and without a known agreement.
///
/// Only rosters with different members take a place, and each new one needs a majority of all before it.
pub const QUORUM_BASES_MAX: usize = 32;

/// By how much a set of modules falls short of a majority of an earlier roster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Shortfall {
    /// The number of its members that are present.
    pub present: usize,
    /// The number of members of the earlier roster.
    pub basis: usize,
}

/// The earlier rosters that count.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct Quorum {
    /// The last roster of which all members showed the same digest.
    agreed: Option<(Epoch, Vec<ModuleRun>)>,
    /// Later ones for which some member showed a digest: they may have agreed without this module's knowledge.
    shown: BTreeMap<Epoch, Vec<ModuleRun>>,
}

impl Quorum {
    /// Records that some member of a roster showed a digest for it.
    pub fn note_shown(&mut self, epoch: Epoch, members: &[ModuleRun]) {
        if self
            .agreed
            .as_ref()
            .is_some_and(|(agreed, _)| *agreed >= epoch)
            || self.shown.contains_key(&epoch)
        {
            return;
        }
        self.shown.retain(|_, known| known != members);
        self.shown.insert(epoch, members.to_vec());
        while self.shown.len() > QUORUM_BASES_MAX {
            self.shown.pop_first();
        }
    }

    /// Records that all members of a roster showed the same digest for it; earlier ones no longer count.
    pub fn note_agreed(&mut self, epoch: Epoch, members: &[ModuleRun]) {
        if self
            .agreed
            .as_ref()
            .is_some_and(|(agreed, _)| *agreed >= epoch)
        {
            return;
        }
        self.agreed = Some((epoch, members.to_vec()));
        self.shown.retain(|&shown, _| shown > epoch);
    }

    /// Adds the bases that another module knows.
    pub fn learn(&mut self, bases: &[QuorumBasis]) {
        for basis in bases {
            if basis.agreed {
                self.note_agreed(basis.epoch, &basis.members);
            } else {
                self.note_shown(basis.epoch, &basis.members);
            }
        }
    }

    /// The bases that this module knows, for its messages.
    pub fn bases(&self) -> Vec<QuorumBasis> {
        let basis = |agreed, (epoch, members): (&Epoch, &Vec<ModuleRun>)| QuorumBasis {
            epoch: *epoch,
            agreed,
            members: members.clone(),
        };
        let agreed = self
            .agreed
            .iter()
            .map(|(epoch, members)| basis(true, (epoch, members)));
        agreed
            .chain(self.shown.iter().map(|entry| basis(false, entry)))
            .collect()
    }

    /// Whether any roster is known to be agreed.
    pub fn has_agreed(&self) -> bool {
        self.agreed.is_some()
    }

    /// The first basis of which `present` (ascending) holds no majority. An exact half is enough if it contains the lowest
    /// module, and all modules together are enough whichever of them have restarted.
    ///
    /// Before the first agreement, a majority of the expected number is needed, where it is known.
    pub fn shortfall(&self, present: &[ModuleRun], expected: Option<u32>) -> Option<Shortfall> {
        if self.agreed.is_none()
            && let Some(expected) = expected
            && present.len() * 2 <= expected as usize
        {
            return Some(Shortfall {
                present: present.len(),
                basis: expected as usize,
            });
        }
        let agreed = self.agreed.iter().map(|(_, members)| members);
        agreed.chain(self.shown.values()).find_map(|basis| {
            let is_present = |run: &ModuleRun| present.binary_search(run).is_ok();
            let count = basis.iter().filter(|run| is_present(run)).count();
            let lowest = basis.first().is_some_and(is_present);
            let is_back = |run: &ModuleRun| present.iter().any(|here| here.module == run.module);
            let suffices = count * 2 > basis.len()
                || (count * 2 == basis.len() && lowest)
                || (!basis.is_empty() && basis.iter().all(is_back));
            (!suffices).then_some(Shortfall {
                present: count,
                basis: basis.len(),
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Incarnation, ModuleId};

    fn runs(runs: &[(u32, u64)]) -> Vec<ModuleRun> {
        let run = |&(id, incarnation)| ModuleRun {
            module: ModuleId(id),
            incarnation: Incarnation(incarnation),
        };
        runs.iter().map(run).collect()
    }

    fn modules(ids: &[u32]) -> Vec<ModuleRun> {
        let first: Vec<(u32, u64)> = ids.iter().map(|&id| (id, 1)).collect();
        runs(&first)
    }

    fn epoch(number: u64) -> Epoch {
        Epoch {
            number,
            convener: ModuleId(1),
        }
    }

    #[test]
    fn the_first_roster_needs_more_than_half_of_the_expected() {
        let quorum = Quorum::default();
        assert!(quorum.shortfall(&modules(&[1, 2]), Some(4)).is_some());
        assert!(quorum.shortfall(&modules(&[1, 2, 3]), Some(4)).is_none());
        assert!(quorum.shortfall(&modules(&[1]), None).is_none());
    }

    #[test]
    fn an_exact_half_suffices_with_the_lowest_module_only() {
        let mut quorum = Quorum::default();
        quorum.note_agreed(epoch(1), &modules(&[1, 2, 3, 4]));
        assert!(quorum.shortfall(&modules(&[1, 4, 9]), None).is_none());
        assert!(quorum.shortfall(&modules(&[2, 3, 9]), None).is_some());
    }

    #[test]
    fn shown_rosters_count_until_a_later_one_agrees() {
        let mut quorum = Quorum::default();
        quorum.note_agreed(epoch(1), &modules(&[1, 2, 3, 4, 5]));
        quorum.note_shown(epoch(2), &modules(&[3, 4, 5]));
        assert!(quorum.shortfall(&modules(&[1, 2, 3]), None).is_some());
        quorum.note_agreed(epoch(3), &modules(&[1, 2, 3, 4]));
        assert!(quorum.shortfall(&modules(&[1, 2, 3]), None).is_none());
        assert_eq!(quorum.bases().len(), 1);
    }

    #[test]
    fn a_restarted_module_does_not_count_unless_all_are_present() {
        let mut quorum = Quorum::default();
        quorum.note_agreed(epoch(1), &modules(&[1, 2, 3, 4, 5]));
        let shortfall = |present: &[(u32, u64)]| quorum.shortfall(&runs(present), None);
        assert!(shortfall(&[(3, 1), (4, 1), (5, 1)]).is_none());
        // Before its restart, the third may have agreed with the first two on a later roster.
        assert!(shortfall(&[(3, 2), (4, 1), (5, 1)]).is_some());
        assert!(shortfall(&[(1, 2), (2, 2), (3, 2), (4, 1), (5, 1)]).is_none());
        assert!(shortfall(&[(1, 2), (2, 2), (3, 2), (4, 1), (9, 1)]).is_some());
    }
}
