//! Which modules are to form a roster: the largest set that all receive each other.
//!
//! Agreement needs every member to receive every other, so each roster that comes into force is a clique of the graph of who receives
//! whom. That graph is read off the heartbeats, which list whom their senders miss. All members of the best clique see all of it, and
//! find the same one. To find it is to find a least cover of the missed pairs by modules that are left out (a vertex cover; Downey and
//! Fellows, "Parameterized Complexity", 1999, section 3.2: branching on a module and its neighbours).

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use formation_model::ModuleId;

/// After this many branches no further ones are followed: the best set so far is at least as good as that which leaves out the module
/// in the most missed pairs, again and again.
const BRANCHES_MAX: u32 = 4_096;

/// A module that may be a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Candidate {
    pub module: ModuleId,
    /// Whether it has a vote.
    pub votes: bool,
    /// Whether it is known to take spots.
    pub is_active: bool,
}

/// How good a set is: whether it has a quorum, its voters, its active modules, and those that it leaves out, of which the highest are
/// to be left out first.
type Value = (bool, usize, usize, Reverse<usize>, Vec<ModuleId>);

/// The best set of some candidates, in ascending order, that holds none of the missed pairs.
///
/// It has a quorum if any has one, then the most voters, then the most active modules, then the lowest identifiers. A module that is
/// paired with itself is in none.
pub(super) fn best(
    candidates: &[Candidate],
    missed: &[(ModuleId, ModuleId)],
    has_quorum: impl Fn(&[ModuleId]) -> bool,
) -> Vec<ModuleId> {
    let alone = missed.iter().filter(|(one, other)| one == other);
    let alone: BTreeSet<ModuleId> = alone.map(|&(module, _)| module).collect();
    let candidates = candidates.iter().copied();
    let candidates: Vec<Candidate> = candidates
        .filter(|candidate| !alone.contains(&candidate.module))
        .collect();
    let is_candidate = |module: ModuleId| {
        let find = candidates.binary_search_by_key(&module, |candidate| candidate.module);
        find.is_ok()
    };
    let mut neighbours: BTreeMap<ModuleId, BTreeSet<ModuleId>> = BTreeMap::new();
    for &(one, other) in missed {
        if !is_candidate(one) || !is_candidate(other) {
            continue;
        }
        neighbours.entry(one).or_default().insert(other);
        neighbours.entry(other).or_default().insert(one);
    }
    // Modules that miss the same ones, such as those of one process, are in or out together. The lowest stands for them.
    let mut alike: BTreeMap<&BTreeSet<ModuleId>, Vec<ModuleId>> = BTreeMap::new();
    for (&module, others) in &neighbours {
        alike.entry(others).or_default().push(module);
    }
    let alike = alike
        .into_values()
        .filter_map(|modules| Some((*modules.first()?, modules)));
    let alike: BTreeMap<ModuleId, Vec<ModuleId>> = alike.collect();
    let lowest = alike.iter().map(|(&lowest, _)| {
        let others = neighbours.get(&lowest).into_iter().flatten().copied();
        (
            lowest,
            others.filter(|other| alike.contains_key(other)).collect(),
        )
    });
    let remaining: BTreeMap<ModuleId, BTreeSet<ModuleId>> = lowest.collect();
    let mut search = Search {
        candidates: &candidates,
        alike: &alike,
        has_quorum,
        branches: 0,
        best: None,
    };
    search.branch(&remaining, &mut BTreeSet::new());
    search.best.map(|(_, members)| members).unwrap_or_default()
}

struct Search<'a, F> {
    candidates: &'a [Candidate],
    /// The modules for which each stands that is branched on.
    alike: &'a BTreeMap<ModuleId, Vec<ModuleId>>,
    has_quorum: F,
    branches: u32,
    best: Option<(Value, Vec<ModuleId>)>,
}

impl<F: Fn(&[ModuleId]) -> bool> Search<'_, F> {
    /// Tries all sets without `out`, in which these pairs remain.
    fn branch(
        &mut self,
        remaining: &BTreeMap<ModuleId, BTreeSet<ModuleId>>,
        out: &mut BTreeSet<ModuleId>,
    ) {
        self.branches += 1;
        if !self.may_be_better(out) {
            return;
        }
        let size = |module: &ModuleId| self.alike[module].len();
        let missed = |others: &BTreeSet<ModuleId>| others.iter().map(size).sum::<usize>();
        let worst = remaining
            .iter()
            .max_by_key(|(module, others)| (others.len(), missed(others), **module));
        let Some((&worst, others)) = worst.filter(|(_, others)| others.len() > 1) else {
            return self.finish(remaining, out);
        };
        let without = BTreeSet::from([worst]);
        for left_out in [&without, others] {
            if self.best.is_some() && self.branches >= BRANCHES_MAX {
                return;
            }
            let added: Vec<ModuleId> = left_out.difference(out).copied().collect();
            out.extend(&added);
            self.branch(&without_modules(remaining, left_out), out);
            for module in added {
                out.remove(&module);
            }
        }
    }

    /// Leaves out one end of each pair, of pairs that have no end in common.
    fn finish(
        &mut self,
        remaining: &BTreeMap<ModuleId, BTreeSet<ModuleId>>,
        out: &mut BTreeSet<ModuleId>,
    ) {
        let pairs = remaining.iter();
        let pairs = pairs.flat_map(|(&one, others)| others.iter().map(move |&other| (one, other)));
        let worse = pairs
            .filter(|(one, other)| one < other)
            .map(|(one, other)| {
                let value = |module| count(&self.like(module));
                // Of equal ones the higher.
                if value(one) < value(other) {
                    one
                } else {
                    other
                }
            });
        let added: Vec<ModuleId> = worse.collect();
        out.extend(&added);
        self.note(out);
        for module in added {
            out.remove(&module);
        }
    }

    /// The candidates that are like one.
    fn like(&self, lowest: ModuleId) -> Vec<Candidate> {
        let alike = &self.alike[&lowest];
        let candidates = self.candidates.iter().copied();
        candidates
            .filter(|candidate| alike.binary_search(&candidate.module).is_ok())
            .collect()
    }

    /// Whether a set without these, and maybe without others, may be better than the best.
    fn may_be_better(&self, out: &BTreeSet<ModuleId>) -> bool {
        let Some(((best_has_quorum, best_voters, best_active, ..), _)) = self.best else {
            return true;
        };
        let (voters, active) = count(&self.left_without(out));
        !best_has_quorum || (voters, active) >= (best_voters, best_active)
    }

    /// The candidates that are left without these and all that are like them.
    fn left_without(&self, out: &BTreeSet<ModuleId>) -> Vec<Candidate> {
        let out: BTreeSet<ModuleId> = self.modules(out).collect();
        let left = self.candidates.iter().copied();
        left.filter(|candidate| !out.contains(&candidate.module))
            .collect()
    }

    fn modules<'a>(&'a self, out: &'a BTreeSet<ModuleId>) -> impl Iterator<Item = ModuleId> + 'a {
        out.iter().flat_map(|lowest| &self.alike[lowest]).copied()
    }

    /// Takes the set without these for the best, if it is.
    fn note(&mut self, out: &BTreeSet<ModuleId>) {
        let left = self.left_without(out);
        let members: Vec<ModuleId> = left.iter().map(|candidate| candidate.module).collect();
        let (voters, active) = count(&left);
        let mut left_out: Vec<ModuleId> = self.modules(out).collect();
        left_out.sort_unstable_by_key(|&module| Reverse(module));
        let has_quorum = (self.has_quorum)(&members);
        let value = (
            has_quorum,
            voters,
            active,
            Reverse(left_out.len()),
            left_out,
        );
        if self.best.as_ref().is_none_or(|(best, _)| *best < value) {
            self.best = Some((value, members));
        }
    }
}

/// The voters and the active modules among some.
fn count(candidates: &[Candidate]) -> (usize, usize) {
    let voters = candidates.iter().filter(|candidate| candidate.votes);
    let active = candidates.iter().filter(|candidate| candidate.is_active);
    (voters.count(), active.count())
}

/// The pairs that remain without some modules.
fn without_modules(
    neighbours: &BTreeMap<ModuleId, BTreeSet<ModuleId>>,
    out: &BTreeSet<ModuleId>,
) -> BTreeMap<ModuleId, BTreeSet<ModuleId>> {
    let left = neighbours
        .iter()
        .filter(|(module, _)| !out.contains(module));
    let left = left.map(|(&module, others)| {
        let others = others.difference(out).copied().collect();
        (module, others)
    });
    left.filter(|(_, others): &(ModuleId, BTreeSet<ModuleId>)| !others.is_empty())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidates(count: u32) -> Vec<Candidate> {
        let one = |id| Candidate {
            module: ModuleId(id),
            votes: true,
            is_active: true,
        };
        (1..=count).map(one).collect()
    }

    fn pairs(pairs: &[(u32, u32)]) -> Vec<(ModuleId, ModuleId)> {
        let pairs = pairs.iter();
        pairs
            .map(|&(one, other)| (ModuleId(one), ModuleId(other)))
            .collect()
    }

    fn best_of(candidates: &[Candidate], missed: &[(u32, u32)], least: usize) -> Vec<u32> {
        let best = best(candidates, &pairs(missed), |members| members.len() >= least);
        best.into_iter().map(|module| module.0).collect()
    }

    /// Shows E4.
    #[test]
    fn the_fewest_are_left_out_and_of_these_the_highest() {
        let five = candidates(5);
        assert_eq!(best_of(&five, &[], 3), [1, 2, 3, 4, 5]);
        assert_eq!(best_of(&five, &[(1, 4)], 3), [1, 2, 3, 5]);
        assert_eq!(best_of(&five, &[(1, 4), (1, 5), (2, 1)], 3), [2, 3, 4, 5]);
        assert_eq!(
            best_of(&five, &[(1, 2), (2, 3), (3, 4), (4, 5)], 3),
            [1, 3, 5]
        );
    }

    /// Shows E4.
    #[test]
    fn votes_count_more_than_spots() {
        let mut five = candidates(5);
        for voteless in [3, 4] {
            five[voteless].votes = false;
        }
        assert_eq!(best_of(&five, &[(3, 4), (3, 5)], 2), [1, 2, 3]);
        five[2].is_active = false;
        assert_eq!(best_of(&five, &[(1, 4), (1, 5), (2, 3)], 2), [1, 2]);
    }

    /// Shows E4.
    #[test]
    fn one_that_misses_many_is_in_none_and_pairs_apart_are_judged_one_by_one() {
        let many = candidates(60);
        let mut missed: Vec<(u32, u32)> = (1..=25).map(|pair| (pair, pair + 30)).collect();
        missed.push((60, 60));
        let mut expected: Vec<u32> = (1..=30).collect();
        expected.extend(56..=59);
        assert_eq!(best_of(&many, &missed, 31), expected);
    }

    /// Shows E4.
    #[test]
    fn two_halves_that_do_not_receive_each_other_are_found_at_once() {
        let many = candidates(60);
        let missed: Vec<(u32, u32)> = (1..=25)
            .flat_map(|one| (26..=60).map(move |other| (one, other)))
            .collect();
        assert_eq!(best_of(&many, &missed, 31), (26..=60).collect::<Vec<u32>>());
    }

    /// As by a search of all sets.
    /// Shows E4.
    #[test]
    fn no_set_is_better() {
        let ten = candidates(10);
        let mut state = 1_u32;
        for _ in 0..200 {
            let mut draw = |bound: u32| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 16) % bound
            };
            let missed: Vec<(u32, u32)> = (0..draw(12))
                .map(|_| (1 + draw(10), 1 + draw(10)))
                .filter(|(one, other)| one != other)
                .collect();
            let holds = |set: u32| {
                missed
                    .iter()
                    .all(|&(one, other)| set >> one & 1 == 0 || set >> other & 1 == 0)
            };
            let sets = (0_u32..1 << 11).filter(|set| set & 1 == 0 && holds(*set));
            let largest = sets.map(u32::count_ones).max().unwrap();
            let found = best_of(&ten, &missed, 6);
            assert_eq!(found.len(), largest as usize, "{missed:?}");
            let set = found.iter().map(|module| 1_u32 << module).sum();
            assert!(holds(set), "{missed:?}: {found:?}");
        }
    }
}
