//! The paper's own planner, Algorithms 1 and 2, as literally as they can be run.
//!
//! A baseline: it shares the paper's failures to keep its theorems. These points had to be added:
//!
//! - `evict` answers TRUE or FALSE but never says which spot the evicted module takes. The text and the proof of Theorem 2
//!   send it to the second-best spot of the test, so it moves there. If that spot is no longer free when the module moves,
//!   which happens when a block evicts several modules, the module gets no spot: neither algorithm gives it another turn.
//! - On graphs with cycles, which the paper leaves open, there is one candidate: the largest common subgraph on spots of
//!   the greatest centrality.
//! - Ties of utility go to the lower identifier, among candidates to the one found first.

use std::cmp::Reverse;
use std::collections::BTreeSet;

use crate::model::{MicroUnits, Topology};
use crate::planner::assignment::{Displacement, Holder, Instance, SpotTable};
use crate::planner::baseline::rooted_subtree;
use crate::planner::placement::{Pairs, best_matching};

/// The paper's `D_max`, unless the user sets one.
const D_MAX: u32 = 3;

/// The paper's `MAX`: the greatest number of candidates of a configuration.
const CANDIDATES_MAX: usize = 20;

/// A module that is evicted, and the spot to which it moves.
type Move = (usize, usize);

/// For each module, the spot of greatest utility and the second one, held or not; computed at first use.
#[derive(Clone, Debug)]
pub(crate) struct Favourites {
    of: Vec<Option<(usize, Option<usize>)>>,
}

impl Favourites {
    pub(crate) fn new(module_count: usize) -> Self {
        Self {
            of: vec![None; module_count],
        }
    }

    /// `arg max U(s)` over all spots but one (Algorithm 1, lines 12 and 13).
    fn other_than(&mut self, instance: &Instance, module: usize, spot: usize) -> Option<usize> {
        let (best, second) = *self.of[module].get_or_insert_with(|| {
            let sorted = spots_by_utility(instance, module);
            (sorted[0], sorted.get(1).copied())
        });
        if best == spot { second } else { Some(best) }
    }
}

/// All spots in descending order of a module's utility (Algorithm 1, line 2).
fn spots_by_utility(instance: &Instance, module: usize) -> Vec<usize> {
    let row = instance.utilities.row(module);
    let mut spots: Vec<usize> = (0..row.len()).collect();
    spots.sort_by_key(|&spot| Reverse(row[spot]));
    spots
}

/// The first MAX = 20 subgraphs of the target that equal a configuration, or its largest part that fits, from the spots of
/// greatest value on (Algorithm 2, lines 1 to 4, and section "Experimental Evaluation").
///
/// Each candidate pairs the configuration's nodes with target nodes, ascending by the former. On graphs with cycles the search
/// ends after `nodes_max` search nodes.
pub fn candidates(
    configuration: &Topology,
    target: &Topology,
    value: impl Fn(usize) -> MicroUnits,
    nodes_max: u64,
) -> Vec<Pairs> {
    if !configuration.is_tree() || !target.is_tree() {
        let matching = best_matching(
            target,
            configuration,
            |_, spot| Some(value(spot)),
            nodes_max,
        );
        return vec![matching.pairs];
    }
    let mut spots: Vec<usize> = (0..target.node_count()).collect();
    spots.sort_by_key(|&spot| Reverse(value(spot)));
    rooted_subtree::largest_common(configuration, target, &spots, CANDIDATES_MAX)
}

/// The state on which one turn works.
pub(crate) struct PaperTurn<'a> {
    /// The search nodes of a configuration's turn.
    pub(crate) nodes_max: u64,
    pub(crate) instance: &'a Instance,
    pub(crate) favourites: &'a mut Favourites,
    pub(crate) table: &'a mut SpotTable,
    pub(crate) evictions: &'a mut Vec<Displacement>,
}

impl PaperTurn<'_> {
    /// `spotAllocation` (Algorithm 1, lines 1 to 9). A module that finds no spot gets none: NO_SPOT_FOUND.
    pub(crate) fn allocate_spot(&mut self, module: usize) {
        for spot in spots_by_utility(self.instance, module) {
            match self.table.holder(spot) {
                Holder::Free => {
                    self.table.give(spot, Holder::Singleton(module));
                    return;
                }
                Holder::Singleton(holder) => {
                    if let Some(moves) = self.evict(module, holder, spot) {
                        let start = self.evictions.len();
                        self.take_from(module, holder, spot, Holder::Singleton(module));
                        self.follow(start, &moves);
                        return;
                    }
                }
                Holder::Fixed(_) | Holder::Closed => {}
            }
        }
    }

    /// `evict` (Algorithm 1, lines 10 to 20), its recursion unrolled: the moves by which `current` takes `contested` from
    /// `blocking`; `None` if it may not.
    fn evict(
        &mut self,
        mut current: usize,
        mut blocking: usize,
        mut contested: usize,
    ) -> Option<Vec<Move>> {
        let instance = self.instance;
        let utility = |module, spot| instance.utilities.of(module, spot);
        let mut moves = Vec::new();
        let depth_limit = instance.problem.parameters().d_max.unwrap_or(D_MAX);
        for _ in 0..depth_limit {
            let for_blocking = self.favourites.other_than(instance, blocking, contested)?;
            let for_current = self.favourites.other_than(instance, current, contested)?;
            let evicting = utility(current, contested) + utility(blocking, for_blocking);
            let yielding = utility(current, for_current) + utility(blocking, contested);
            if evicting <= yielding {
                return None;
            }
            moves.push((blocking, for_blocking));
            match self.table.holder(for_blocking) {
                Holder::Free => return Some(moves),
                Holder::Singleton(next) => {
                    (current, blocking, contested) = (blocking, next, for_blocking);
                }
                Holder::Fixed(_) | Holder::Closed => return None,
            }
        }
        None
    }

    fn take_from(&mut self, module: usize, holder: usize, spot: usize, as_holder: Holder) {
        self.table.release(holder);
        self.table.give(spot, as_holder);
        self.evictions.push(Displacement {
            evicted: holder,
            by: module,
            from: spot,
            to: None,
        });
    }

    /// Carries out the moves of `evict` for the module of eviction `position` and the modules that it displaces in turn.
    fn follow(&mut self, mut position: usize, moves: &[Move]) {
        for (number, &(module, spot)) in moves.iter().enumerate() {
            match self.table.holder(spot) {
                Holder::Free => {
                    self.table.give(spot, Holder::Singleton(module));
                    self.evictions[position].to = Some(spot);
                    return;
                }
                Holder::Singleton(holder)
                    if moves.get(number + 1).is_some_and(|next| next.0 == holder) =>
                {
                    self.evictions[position].to = Some(spot);
                    self.take_from(module, holder, spot, Holder::Singleton(module));
                    position = self.evictions.len() - 1;
                }
                // The table has changed since the test.
                Holder::Singleton(_) | Holder::Fixed(_) | Holder::Closed => return,
            }
        }
    }

    /// `blockAllocation` (Algorithm 2). `members` are two or more modules, ascending and connected by links.
    ///
    /// Returns the groups of modules that stay together, and the disconnected modules, ascending, which have had their turns.
    pub(crate) fn allocate_block(&mut self, members: &[usize]) -> (Vec<Vec<usize>>, Vec<usize>) {
        let links = self.instance.links.induced_by(members);
        let utilities = &self.instance.utilities;
        let target = self.instance.target.topology();
        let mut candidates =
            candidates(&links, target, |spot| utilities.value(spot), self.nodes_max);
        // `U_A(t)`, without the reward, which is equal for all candidates, since all have the same size.
        let utility_of = |&(node, spot): &(usize, usize)| utilities.of(members[node], spot).0;
        candidates.sort_by_key(|pairs| Reverse(pairs.iter().map(utility_of).sum::<i64>()));
        let mut kept = Vec::new();
        let mut yielding = BTreeSet::new();
        for (number, candidate) in candidates.iter().enumerate() {
            let tests: Vec<(usize, usize, Test)> = candidate
                .iter()
                .map(|&(node, spot)| (node, spot, self.test(members[node], spot)))
                .collect();
            let is_last = number + 1 == candidates.len();
            // Lines 6 to 15, and lines 16 to 21 for the modules that must yield.
            let (refused, free): (Vec<_>, Vec<_>) = tests
                .into_iter()
                .partition(|(_, _, test)| matches!(test, Test::Refused));
            if refused.is_empty() || is_last {
                yielding = refused.iter().map(|&(node, ..)| members[node]).collect();
                kept = self.select(members, &links, free);
                break;
            }
        }
        let placed: BTreeSet<usize> = kept.iter().map(|&(module, _)| module).collect();
        let blocks = self.pieces(&kept);
        let together: BTreeSet<usize> = blocks.iter().flatten().copied().collect();
        let detached = without(members, |member| together.contains(member));
        // Lines 17 to 21, then lines 22 to 24, each by distance from the centre.
        let unmatched = without(members, |member| {
            yielding.contains(member) || placed.contains(member)
        });
        for mut leaving in [yielding.into_iter().collect(), unmatched] {
            leaving.sort_unstable_by_key(|&module| self.instance.ranks[module]);
            for module in leaving {
                self.allocate_spot(module);
            }
        }
        (blocks, detached)
    }

    fn test(&mut self, module: usize, spot: usize) -> Test {
        match self.table.holder(spot) {
            Holder::Free => Test::Free,
            Holder::Singleton(holder) => match self.evict(module, holder, spot) {
                Some(moves) => Test::Evicts(moves),
                None => Test::Refused,
            },
            Holder::Fixed(_) | Holder::Closed => Test::Refused,
        }
    }

    /// Gives the modules of a candidate their spots, and carries out the moves of `evict` for those that they evict.
    ///
    /// Returns the modules with their spots.
    fn select(
        &mut self,
        members: &[usize],
        links: &Topology,
        free: Vec<(usize, usize, Test)>,
    ) -> Pairs {
        let nodes: Vec<usize> = free.iter().map(|&(node, ..)| node).collect();
        let spots: Vec<usize> = free.iter().map(|&(_, spot, _)| spot).collect();
        let target = self.instance.target.topology();
        // A module that keeps no link has left the configuration and can be evicted.
        let is_alone = |position: usize| {
            !links.neighbours(nodes[position]).iter().any(|other| {
                nodes
                    .binary_search(other)
                    .is_ok_and(|other| target.has_edge(spots[position], spots[other]))
            })
        };
        let mut evicted = Vec::new();
        let mut displaced = Vec::new();
        for (position, (node, spot, test)) in free.into_iter().enumerate() {
            let module = members[node];
            if let (Test::Evicts(moves), Holder::Singleton(holder)) =
                (test, self.table.holder(spot))
            {
                self.table.release(holder);
                displaced.push(Displacement {
                    evicted: holder,
                    by: module,
                    from: spot,
                    to: None,
                });
                evicted.push(moves);
            }
            let holder = if is_alone(position) {
                Holder::Singleton(module)
            } else {
                Holder::Fixed(module)
            };
            self.table.give(spot, holder);
        }
        for (displacement, moves) in displaced.into_iter().zip(evicted) {
            let position = self.evictions.len();
            self.evictions.push(displacement);
            self.follow(position, &moves);
        }
        nodes
            .into_iter()
            .map(|node| members[node])
            .zip(spots)
            .collect()
    }

    /// The groups of two or more placed modules that keep links to each other; `kept` ascends by module.
    fn pieces(&self, kept: &[(usize, usize)]) -> Vec<Vec<usize>> {
        let target = self.instance.target.topology();
        let modules: Vec<usize> = kept.iter().map(|&(module, _)| module).collect();
        let mut links = self.instance.links.induced_by(&modules).edges().to_vec();
        links.retain(|&(first, second)| target.has_edge(kept[first].1, kept[second].1));
        Topology::new(kept.len(), &links)
            .components()
            .into_iter()
            .filter(|piece| piece.len() > 1)
            .map(|piece| piece.into_iter().map(|node| modules[node]).collect())
            .collect()
    }
}

/// Whether a module of a configuration can take the spot matched to it.
enum Test {
    /// The spot is free.
    Free,
    /// `evict` answers TRUE, and these modules move.
    Evicts(Vec<Move>),
    /// `evict` answers FALSE, or another configuration holds the spot.
    Refused,
}

/// The members that `leaves_out` rejects.
fn without(members: &[usize], leaves_out: impl Fn(&usize) -> bool) -> Vec<usize> {
    let members = members.iter().copied();
    members.filter(|member| !leaves_out(member)).collect()
}
