//! Which modules are to form a roster: the largest set that all receive each other.
//!
//! Agreement needs every member to receive every other, so each roster that comes into force is a clique of the graph of who receives
//! whom. That graph is read off the heartbeats, which list whom their senders miss. All members of the best clique see all of it, and
//! find the same one. To find it is to find a least cover of the missed pairs by modules that are left out (a vertex cover; Downey and
//! Fellows, "Parameterized Complexity", 1999, section 3.2: branching on a module and its neighbours).

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use fixedbitset::FixedBitSet;
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
    /// Whether it shows that it holds a plan.
    pub is_planned: bool,
}

/// How good a set is: whether it has a quorum, how many it has, and those that it leaves out, of which the highest are to be left out
/// first.
type Value = (bool, Count, Reverse<usize>, Vec<ModuleId>);

/// Voters, then active modules, then modules that hold a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Count {
    voters: usize,
    active: usize,
    planned: usize,
}

impl Count {
    fn of(candidate: Candidate) -> Self {
        Self {
            voters: usize::from(candidate.votes),
            active: usize::from(candidate.is_active),
            planned: usize::from(candidate.is_planned),
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            voters: self.voters + other.voters,
            active: self.active + other.active,
            planned: self.planned + other.planned,
        }
    }

    fn minus(self, other: Self) -> Self {
        Self {
            voters: self.voters - other.voters,
            active: self.active - other.active,
            planned: self.planned - other.planned,
        }
    }

    /// At least so many are lost with one of the two.
    fn least(self, other: Self) -> Self {
        Self {
            voters: self.voters.min(other.voters),
            active: self.active.min(other.active),
            planned: self.planned.min(other.planned),
        }
    }
}

/// The best set of some candidates, in ascending order, that holds none of the missed pairs.
///
/// It has a quorum if any has one, then the most voters, then the most active modules, then the most that hold a plan, then the
/// lowest identifiers. A module that is paired with itself is in none.
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
    let nodes = nodes_of(&candidates, missed);
    let mut left = FixedBitSet::with_capacity(nodes.len());
    left.insert_range(..);
    let all = candidates.iter().copied().map(Count::of);
    let all = all.fold(Count::default(), Count::plus);
    let mut search = Search {
        candidates: &candidates,
        nodes: &nodes,
        has_quorum,
        branches: 0,
        best: None,
    };
    search.branch(&left, all);
    search.best.map(|(_, members)| members).unwrap_or_default()
}

/// Modules that miss the same ones, such as those of one process: they are in or out together.
#[derive(Clone)]
struct Node {
    /// In ascending order.
    modules: Vec<ModuleId>,
    count: Count,
    /// The nodes with which it is paired.
    others: FixedBitSet,
}

/// The nodes of the candidates in missed pairs, in the order of their lowest modules.
fn nodes_of(candidates: &[Candidate], missed: &[(ModuleId, ModuleId)]) -> Vec<Node> {
    let position = |module: ModuleId| {
        let find = candidates.binary_search_by_key(&module, |candidate| candidate.module);
        find.ok()
    };
    let mut neighbours: BTreeMap<usize, FixedBitSet> = BTreeMap::new();
    for &(one, other) in missed {
        if let (Some(one), Some(other)) = (position(one), position(other)) {
            for (one, other) in [(one, other), (other, one)] {
                let others = neighbours.entry(one);
                let others = others.or_insert_with(|| FixedBitSet::with_capacity(candidates.len()));
                others.insert(other);
            }
        }
    }
    let mut node_of: BTreeMap<&FixedBitSet, usize> = BTreeMap::new();
    let mut node_at: BTreeMap<usize, usize> = BTreeMap::new();
    for (&position, others) in &neighbours {
        let next = node_of.len();
        node_at.insert(position, *node_of.entry(others).or_insert(next));
    }
    let empty = Node {
        modules: Vec::new(),
        count: Count::default(),
        others: FixedBitSet::with_capacity(node_of.len()),
    };
    let mut nodes = vec![empty; node_of.len()];
    for (position, &node) in &node_at {
        let node = &mut nodes[node];
        let candidate = candidates[*position];
        node.modules.push(candidate.module);
        node.count = node.count.plus(Count::of(candidate));
        if let ([_], Some(others)) = (&*node.modules, neighbours.get(position)) {
            node.others
                .extend(others.ones().map(|other| node_at[&other]));
        }
    }
    nodes
}

struct Search<'a, F> {
    candidates: &'a [Candidate],
    nodes: &'a [Node],
    has_quorum: F,
    branches: u32,
    best: Option<(Value, Vec<ModuleId>)>,
}

impl<F: Fn(&[ModuleId]) -> bool> Search<'_, F> {
    /// Tries all sets of these nodes, which have so many with all that are in no pair.
    fn branch(&mut self, left: &FixedBitSet, count: Count) {
        self.branches += 1;
        let lost = self.pairs_apart(left).map(|(one, other)| {
            let [one, other] = [one, other].map(|node| self.nodes[node].count);
            one.least(other)
        });
        if !self.may_be_best(count.minus(lost.fold(Count::default(), Count::plus))) {
            return;
        }
        let worst = left.ones().map(|node| {
            let others = &self.nodes[node].others;
            let sizes = others
                .intersection(left)
                .map(|other| self.nodes[other].modules.len());
            (others.intersection_count(left), sizes.sum::<usize>(), node)
        });
        let (others, worst) = worst
            .max()
            .map_or((0, 0), |(others, _, node)| (others, node));
        if others <= 1 {
            self.finish(left, count);
            // Which of the two matters where a single module decides, such as the lowest voter.
            if others == 0 || !self.may_have_a_quorum_yet(left) {
                return;
            }
        }
        let mut without = FixedBitSet::with_capacity(self.nodes.len());
        without.insert(worst);
        for out in [&without, &self.nodes[worst].others] {
            if self.best.is_some() && self.branches >= BRANCHES_MAX {
                return;
            }
            let lost = out
                .intersection(left)
                .map(|node| self.nodes[node].count)
                .fold(Count::default(), Count::plus);
            let mut left = left.clone();
            left.difference_with(out);
            self.branch(&left, count.minus(lost));
        }
    }

    /// Pairs of these nodes that have no node in common; as many as are found by taking one after the other.
    fn pairs_apart(&self, left: &FixedBitSet) -> impl Iterator<Item = (usize, usize)> {
        let mut free = left.clone();
        left.ones().filter_map(move |node| {
            if !free.contains(node) {
                return None;
            }
            free.remove(node);
            let other = self.nodes[node].others.intersection(&free).next()?;
            free.remove(other);
            Some((node, other))
        })
    }

    /// Leaves out one end of each pair, of pairs that have no end in common.
    fn finish(&mut self, left: &FixedBitSet, count: Count) {
        // That with fewer voters, fewer active modules or fewer plans, then that of fewer modules, then the higher.
        let badness = |node: usize| {
            let Node { modules, count, .. } = &self.nodes[node];
            let descending: Vec<ModuleId> = modules.iter().rev().copied().collect();
            (Reverse(*count), Reverse(modules.len()), descending)
        };
        let worse: Vec<usize> = self
            .pairs_apart(left)
            .map(|(one, other)| {
                if badness(one) > badness(other) {
                    one
                } else {
                    other
                }
            })
            .collect();
        let (mut left, mut count) = (left.clone(), count);
        for node in worse {
            left.remove(node);
            count = count.minus(self.nodes[node].count);
        }
        self.note(&left, count);
    }

    /// Whether no set so far has a quorum, and one of these nodes may.
    fn may_have_a_quorum_yet(&self, left: &FixedBitSet) -> bool {
        let best = self.best.as_ref();
        best.is_some_and(|((has_quorum, ..), _)| !has_quorum)
            && (self.has_quorum)(&self.members_without(&self.left_out(left)))
    }

    /// The modules that are left out if these nodes are not, in ascending order.
    fn left_out(&self, left: &FixedBitSet) -> Vec<ModuleId> {
        let out = left.zeroes().flat_map(|node| &self.nodes[node].modules);
        let mut out: Vec<ModuleId> = out.copied().collect();
        out.sort_unstable();
        out
    }

    fn members_without(&self, out: &[ModuleId]) -> Vec<ModuleId> {
        let members = self.candidates.iter().map(|candidate| candidate.module);
        let members = members.filter(|module| out.binary_search(module).is_err());
        members.collect()
    }

    /// Whether a set with so many, or with fewer, may be the best.
    fn may_be_best(&self, count: Count) -> bool {
        let best = self.best.as_ref();
        best.is_none_or(|((has_quorum, best, ..), _)| !has_quorum || count >= *best)
    }

    /// Takes the set of these nodes, and all that are in no pair, for the best, if it is.
    fn note(&mut self, left: &FixedBitSet, count: Count) {
        if !self.may_be_best(count) {
            return;
        }
        let mut out = self.left_out(left);
        let members = self.members_without(&out);
        out.reverse();
        let value = ((self.has_quorum)(&members), count, Reverse(out.len()), out);
        if self.best.as_ref().is_none_or(|(best, _)| *best < value) {
            self.best = Some((value, members));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidates(count: u32) -> Vec<Candidate> {
        let one = |id| Candidate {
            module: ModuleId(id),
            votes: true,
            is_active: true,
            is_planned: false,
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
    fn of_equals_one_that_holds_no_plan_is_left_out() {
        let mut five = candidates(5);
        five[3].is_planned = true;
        assert_eq!(best_of(&five, &[(2, 4)], 3), [1, 3, 4, 5]);
        five[3].is_active = false;
        assert_eq!(best_of(&five, &[(2, 4)], 3), [1, 2, 3, 5]);
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

    /// Half of the voters are a quorum with the lowest. It is in the pair of which the other end holds a plan.
    /// Shows E4.
    #[test]
    fn a_set_with_a_quorum_is_found_where_it_hangs_on_one_module() {
        let mut four = candidates(3);
        four[1].is_planned = true;
        four[2].is_planned = true;
        let has_quorum = |members: &[ModuleId]| {
            members.len() > 2 || (members.len() == 2 && members.contains(&ModuleId(1)))
        };
        let members = best(&four, &pairs(&[(1, 2)]), has_quorum);
        assert_eq!(members, [ModuleId(1), ModuleId(3)]);
    }

    /// Shows E4.
    #[test]
    fn of_equal_pairs_the_higher_modules_are_left_out() {
        let nine = candidates(9);
        let pairs = [(1, 2), (1, 3), (9, 2), (9, 3)];
        assert_eq!(best_of(&nine, &pairs, 5), [2, 3, 4, 5, 6, 7, 8]);
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
