//! Quorums: the earlier rosters of which a new one must contain more than half, so that no two plans are in force at once.
//!
//! Memories count, not modules: a module that has restarted without a store does not know which later roster it agreed on
//! before, and so does not count towards the quorum (Liskov and Cowling, "Viewstamped Replication Revisited", 2012, section
//! 4.3: a replica that recovers takes part only after a majority with its memory intact has answered it). That all members
//! of a roster are back proves nothing: before they restarted, they may have handed the majority on to others.

use std::collections::BTreeMap;

use thiserror::Error;

use formation_model::{Epoch, ModuleId, QUORUM_BASES_MAX, QuorumBasis, Voter, VoterMemory};

/// Why a set of modules cannot have a roster of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Error)]
pub enum Shortfall {
    /// A majority is missing.
    #[error("{present} of {basis} modules are within reach")]
    Majority {
        /// The number of modules present that count.
        present: usize,
        /// The number of modules of which a majority is needed.
        basis: usize,
    },
    /// A message cannot hold one more roster next to those that were shown and are not known to be agreed.
    #[error("{0} rosters came to no agreement, and no more can be counted; begin a new session")]
    WithoutAgreement(usize),
}

/// The modules that may form the first roster of a session.
#[derive(Clone, Copy, Debug)]
pub(super) enum Founders<'a> {
    /// These, in ascending order: all of them, or a majority with stores. Each later roster needs one of them.
    Named(&'a [ModuleId]),
    /// A majority of this number. A number cannot distinguish founders from modules that were added later.
    Number(usize),
    /// Any: neither their names nor their number is known.
    Unknown,
}

/// The earlier rosters that count.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct Quorum {
    /// The last roster of which all members showed the same digest.
    agreed: Option<(Epoch, Vec<Voter>)>,
    /// Later ones for which some member showed a digest: they may have agreed without this module's knowledge.
    shown: BTreeMap<Epoch, Vec<Voter>>,
}

impl Quorum {
    /// Whether it would change nothing to record that some member of the roster of this epoch showed a digest.
    pub fn has_noted(&self, epoch: Epoch) -> bool {
        let agreed = self.agreed.as_ref();
        agreed.is_some_and(|(agreed, _)| *agreed >= epoch) || self.shown.contains_key(&epoch)
    }

    /// Records that some member of a roster showed a digest for it.
    pub fn note_shown(&mut self, epoch: Epoch, members: &[Voter]) {
        if self.has_noted(epoch) {
            return;
        }
        self.shown.retain(|_, known| known != members);
        self.shown.insert(epoch, members.to_vec());
    }

    /// That no message can hold the known bases with this one. None is dropped to make room: its roster may have agreed.
    /// Enforces Q1.
    pub fn lacks_room_for(&self, basis: &[Voter]) -> Option<Shortfall> {
        let is_new = !self.shown.values().any(|known| known == basis);
        let needed = self.known().count() + usize::from(is_new);
        (needed > QUORUM_BASES_MAX).then_some(Shortfall::WithoutAgreement(self.shown.len()))
    }

    /// Records that all members of a roster showed the same digest for it; earlier ones no longer count.
    pub fn note_agreed(&mut self, epoch: Epoch, members: &[Voter]) {
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

    /// Adds bases that are known to be true.
    pub fn learn(&mut self, bases: &[QuorumBasis]) {
        for basis in bases {
            if basis.agreed {
                self.note_agreed(basis.epoch, &basis.members);
            } else {
                self.note_shown(basis.epoch, &basis.members);
            }
        }
    }

    /// Adds the bases that modules report which count themselves: those of a known basis and, before the first agreement,
    /// the founders.
    ///
    /// That is enough: every later roster contains a majority of the basis that this module knows, so some module that counts
    /// in this basis, and is present if a majority of it is, knows that roster. What any other module reports teaches nothing.
    /// Enforces Q5.
    pub fn learn_from(&mut self, reports: &[(Voter, &[QuorumBasis])], founders: Founders<'_>) {
        let mut unheard = reports.to_vec();
        loop {
            let (credible, others): (Vec<_>, Vec<_>) = unheard
                .into_iter()
                .partition(|(voter, _)| self.counts(*voter, founders));
            if credible.is_empty() {
                return;
            }
            for (_, bases) in credible {
                self.learn(bases);
            }
            unheard = others;
        }
    }

    /// Whether a module counts in a known basis or, before the first agreement, as a founder.
    fn counts(&self, voter: Voter, founders: Founders<'_>) -> bool {
        let founds = match founders {
            Founders::Named(named) => named.contains(&voter.module),
            Founders::Number(_) | Founders::Unknown => true,
        };
        (self.agreed.is_none() && founds) || self.lists(voter)
    }

    /// Whether a module counts in a known basis.
    pub fn lists(&self, voter: Voter) -> bool {
        self.known().any(|basis| basis.contains(&voter))
    }

    /// The members of every known basis.
    fn known(&self) -> impl Iterator<Item = &Vec<Voter>> {
        let agreed = self.agreed.iter().map(|(_, members)| members);
        agreed.chain(self.shown.values())
    }

    /// The bases that this module knows, for its messages.
    pub fn bases(&self) -> Vec<QuorumBasis> {
        let basis = |agreed, (epoch, members): (&Epoch, &Vec<Voter>)| QuorumBasis {
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

    /// Whether no roster of another epoch than this one is known.
    pub fn knows_only(&self, epoch: Epoch) -> bool {
        let agreed = self.agreed.as_ref().map(|(agreed, _)| agreed);
        agreed
            .into_iter()
            .chain(self.shown.keys())
            .all(|&known| known == epoch)
    }

    /// Whether any roster is known to be agreed.
    pub fn has_agreed(&self) -> bool {
        self.agreed.is_some()
    }

    /// The first majority that `present` (ascending) lacks: of the founders, and of every known basis.
    ///
    /// Before the first agreement the founders count, even if some member showed a digest for a roster.
    /// Enforces Q1.
    pub fn shortfall(&self, present: &[Voter], founders: Founders<'_>) -> Option<Shortfall> {
        let lacks_founders = match founders {
            Founders::Named(named) => of_founders(named, present, self.agreed.is_some()),
            Founders::Number(number) if self.agreed.is_none() => (present.len() * 2 <= number)
                .then_some(Shortfall::Majority {
                    present: present.len(),
                    basis: number,
                }),
            Founders::Number(_) | Founders::Unknown => None,
        };
        lacks_founders.or_else(|| self.known().find_map(|basis| of_basis(basis, present)))
    }
}

/// The majority that is missing of a basis: more than half of its voters, or an exact half with the lowest.
/// Enforces Q2, Q3.
fn of_basis(basis: &[Voter], present: &[Voter]) -> Option<Shortfall> {
    let is_present = |voter: &Voter| present.binary_search(voter).is_ok();
    let count = basis.iter().filter(|voter| is_present(voter)).count();
    let lowest = basis.first().is_some_and(is_present);
    let suffices = count * 2 > basis.len() || (count * 2 == basis.len() && lowest);
    (!suffices).then_some(Shortfall::Majority {
        present: count,
        basis: basis.len(),
    })
}

/// The founders that are missing: without a store, a founder that restarts does not know what it agreed on, so all of them
/// found the formation, or a majority that has stores. Later, one of them must be present: otherwise a formation that was
/// handed on to added modules would go on while restarted founders found another.
/// Enforces Q4, Q7.
fn of_founders(named: &[ModuleId], present: &[Voter], has_agreed: bool) -> Option<Shortfall> {
    let memories_of = |founder: ModuleId| {
        let begin = present.partition_point(|voter| voter.module < founder);
        let from = present[begin..].iter();
        from.take_while(move |voter| voter.module == founder)
    };
    let is_stored = |voter: &Voter| matches!(voter.memory, VoterMemory::Stored(_));
    let founders = named.iter().filter(|&&id| memories_of(id).next().is_some());
    let stored = named.iter().filter(|&&id| memories_of(id).any(is_stored));
    let (founders, stored) = (founders.count(), stored.count());
    let suffices = if has_agreed {
        founders > 0
    } else {
        founders == named.len() || stored * 2 > named.len()
    };
    (!suffices).then_some(Shortfall::Majority {
        present: founders,
        basis: named.len(),
    })
}

#[cfg(test)]
mod tests {
    use std::num::NonZeroU64;

    use super::*;
    use formation_model::{Incarnation, ModuleRun, StoreId};

    /// Each module with its incarnation.
    fn runs(runs: &[(u32, u64)]) -> Vec<Voter> {
        let run = |&(id, incarnation)| ModuleRun {
            module: ModuleId(id),
            incarnation: Incarnation(incarnation),
        };
        runs.iter()
            .map(|entry| Voter::new(run(entry), None))
            .collect()
    }

    fn modules(ids: &[u32]) -> Vec<Voter> {
        let first: Vec<(u32, u64)> = ids.iter().map(|&id| (id, 1)).collect();
        runs(&first)
    }

    /// Modules with stores, in a run of this number.
    fn stored(ids: &[u32], incarnation: u64) -> Vec<Voter> {
        let voter = |&id: &u32| {
            let run = ModuleRun {
                module: ModuleId(id),
                incarnation: Incarnation(incarnation),
            };
            Voter::new(run, NonZeroU64::new(1_000 + u64::from(id)).map(StoreId))
        };
        ids.iter().map(voter).collect()
    }

    fn named(ids: &[u32]) -> Vec<ModuleId> {
        ids.iter().copied().map(ModuleId).collect()
    }

    fn epoch(number: u64) -> Epoch {
        Epoch {
            number,
            convener: ModuleId(1),
        }
    }

    fn basis(number: u64, agreed: bool, members: Vec<Voter>) -> QuorumBasis {
        QuorumBasis {
            epoch: epoch(number),
            agreed,
            members,
        }
    }

    /// Shows Q4.
    #[test]
    fn the_first_roster_needs_more_than_half_of_the_expected() {
        let quorum = Quorum::default();
        let four = Founders::Number(4);
        assert!(quorum.shortfall(&modules(&[1, 2]), four).is_some());
        assert!(quorum.shortfall(&modules(&[1, 2, 3]), four).is_none());
        assert!(
            quorum
                .shortfall(&modules(&[1]), Founders::Unknown)
                .is_none()
        );
    }

    /// Shows Q4.
    #[test]
    fn founders_are_all_present_or_a_majority_has_stores() {
        let quorum = Quorum::default();
        let founders = named(&[1, 2, 3]);
        let lacks = |present: &[Voter]| {
            quorum
                .shortfall(present, Founders::Named(&founders))
                .is_some()
        };
        assert!(lacks(&modules(&[1, 2, 8, 9])));
        assert!(!lacks(&modules(&[1, 2, 3])));
        assert!(!lacks(&stored(&[1, 3], 1)));
        assert!(lacks(&stored(&[1], 1)));
    }

    /// Shows Q7.
    #[test]
    fn every_later_roster_holds_a_founder() {
        let mut quorum = Quorum::default();
        quorum.note_agreed(epoch(4), &modules(&[3, 8, 9]));
        let founders = named(&[1, 2, 3]);
        let lacks = |present: &[Voter]| {
            quorum
                .shortfall(present, Founders::Named(&founders))
                .is_some()
        };
        assert!(lacks(&modules(&[8, 9])));
        assert!(!lacks(&modules(&[3, 8])));
    }

    /// Shows Q2.
    #[test]
    fn an_exact_half_suffices_with_the_lowest_module_only() {
        let mut quorum = Quorum::default();
        quorum.note_agreed(epoch(1), &modules(&[1, 2, 3, 4]));
        assert!(
            quorum
                .shortfall(&modules(&[1, 4, 9]), Founders::Unknown)
                .is_none()
        );
        assert!(
            quorum
                .shortfall(&modules(&[2, 3, 9]), Founders::Unknown)
                .is_some()
        );
    }

    /// Shows Q1.
    #[test]
    fn shown_rosters_count_until_a_later_one_agrees() {
        let mut quorum = Quorum::default();
        quorum.note_agreed(epoch(1), &modules(&[1, 2, 3, 4, 5]));
        quorum.note_shown(epoch(2), &modules(&[3, 4, 5]));
        assert!(
            quorum
                .shortfall(&modules(&[1, 2, 3]), Founders::Unknown)
                .is_some()
        );
        quorum.note_agreed(epoch(3), &modules(&[1, 2, 3, 4]));
        assert!(
            quorum
                .shortfall(&modules(&[1, 2, 3]), Founders::Unknown)
                .is_none()
        );
        assert_eq!(quorum.bases().len(), 1);
    }

    /// Module 3 enters each of these epochs without its roster. With 4 and 5, which only know the first roster, it is a majority.
    /// Shows Q1.
    #[test]
    fn a_roster_that_may_have_agreed_counts_however_many_follow() {
        let mut quorum = Quorum::default();
        quorum.note_shown(epoch(1), &modules(&[1, 2, 3, 4, 5]));
        let with_the = |run| runs(&[(1, 1), (2, 1), (3, 1), (6, 1), (7, run)]);
        let mut run = 1;
        while quorum.lacks_room_for(&with_the(run)).is_none() {
            let members = with_the(run);
            assert_eq!(quorum.shortfall(&members, Founders::Unknown), None);
            run += 1;
            quorum.note_shown(epoch(run), &members);
        }
        assert_eq!(quorum.bases().len(), QUORUM_BASES_MAX);
        assert_eq!(quorum.lacks_room_for(&with_the(run - 1)), None);
        let without_a_majority_of_the_first = modules(&[1, 2, 6]);
        let shortfall = quorum.shortfall(&without_a_majority_of_the_first, Founders::Unknown);
        assert!(shortfall.is_some());
    }

    /// Each of two modules knows other rosters, and both together more than a message holds.
    /// Shows Q1.
    #[test]
    fn a_roster_that_no_message_can_hold_is_not_published() {
        let with_the = |run| runs(&[(1, 1), (2, 1), (3, 1), (7, run)]);
        let (mut one, mut other) = (Quorum::default(), Quorum::default());
        for run in 1..=200 {
            one.note_shown(epoch(2 * run), &with_the(2 * run));
            other.note_shown(epoch(2 * run + 1), &with_the(2 * run + 1));
        }
        assert_eq!(one.lacks_room_for(&with_the(2)), None);
        one.learn(&other.bases());
        let shortfall = one.lacks_room_for(&with_the(2));
        assert_eq!(shortfall, Some(Shortfall::WithoutAgreement(400)));
    }

    /// Shows Q3.
    #[test]
    fn a_restarted_module_counts_only_with_its_store() {
        let mut quorum = Quorum::default();
        quorum.note_agreed(epoch(1), &modules(&[1, 2, 3, 4, 5]));
        let lacks = |present: &[(u32, u64)]| {
            quorum
                .shortfall(&runs(present), Founders::Unknown)
                .is_some()
        };
        assert!(!lacks(&[(3, 1), (4, 1), (5, 1)]));
        // Before its restart, the third may have agreed with the first two on a later roster.
        assert!(lacks(&[(3, 2), (4, 1), (5, 1)]));
        // All are back, but three of them may have handed the majority on before they restarted.
        assert!(lacks(&[(1, 2), (2, 2), (3, 2), (4, 1), (5, 1)]));
        let mut quorum = Quorum::default();
        quorum.note_agreed(epoch(1), &stored(&[1, 2, 3], 1));
        assert!(
            quorum
                .shortfall(&stored(&[2, 3], 7), Founders::Unknown)
                .is_none()
        );
    }

    /// Shows Q5.
    #[test]
    fn only_modules_that_count_teach_bases() {
        let founders = named(&[1, 2, 3]);
        let founders = Founders::Named(&founders);
        let (one, two, stranger) = (runs(&[(1, 1)])[0], runs(&[(2, 1)])[0], runs(&[(9, 1)])[0]);
        let invented = [basis(7, true, modules(&[100, 101]))];
        let mut quorum = Quorum::default();
        quorum.learn_from(&[(stranger, &invented)], founders);
        assert_eq!(quorum.bases(), []);
        // The second knows a roster with the stranger, whose report of a later one is then credible.
        let with_stranger = [basis(5, true, runs(&[(1, 1), (2, 1), (9, 1)]))];
        let later = [basis(6, false, runs(&[(2, 1), (9, 1)]))];
        quorum.note_agreed(epoch(3), &modules(&[1, 2, 3]));
        quorum.learn_from(
            &[(stranger, &later), (two, &with_stranger), (one, &[])],
            founders,
        );
        assert_eq!(quorum.bases(), [with_stranger[0].clone(), later[0].clone()]);
    }
}
