//! The paper's own planner, Algorithms 1 and 2, as literally as they can be run.
//!
//! Kept as a baseline; where it falls short of the paper's theorems, so does the paper. What had to be added:
//!
//! - `evict` answers TRUE or FALSE but never says where the evicted module goes. The text and the proof of Theorem 2 send
//!   it to the second-best spot that the test was made with, so it moves there. If that spot is no longer free when its
//!   turn to move comes, which happens when a block evicts several modules, the module is left without a spot: nothing
//!   in either algorithm gives it another turn.
//! - On graphs with cycles, which the paper leaves open, there is one candidate: the largest common subgraph on spots of
//!   the greatest centrality.
//! - Equal utilities go to the lower identifier, among candidates to the one found first.

use std::collections::BTreeSet;

use crate::model::{MicroUnits, Topology};
use crate::planner::assignment::spot_allocation::Displacement;
use crate::planner::assignment::{Holder, Instance, SpotTable};
use crate::planner::baseline::rooted_subtree::{self, Embedding};
use crate::planner::turns::block_allocation::{best_matching, topology_of};

/// The paper's `D_max`, where the user sets none.
const D_MAX: u32 = 3;

/// The paper's `MAX`: at most how many candidates a configuration considers.
const CANDIDATES_MAX: usize = 20;

/// One module that is evicted and the spot that it is sent to.
type Move = (usize, usize);

/// The spots that each module likes best, whoever holds them; computed when first asked for.
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
    spots.sort_by_key(|&spot| std::cmp::Reverse(row[spot]));
    spots
}

/// The first MAX = 20 subgraphs of the target that equal a configuration, or else as much of it as can be, beginning at
/// the spots of greatest value (Algorithm 2, lines 1 to 4, and section "Experimental Evaluation").
///
/// Each candidate pairs the configuration's nodes with target nodes, ascending by the former.
#[must_use]
pub fn candidates(
    configuration: &Topology,
    target: &Topology,
    value: impl Fn(usize) -> MicroUnits,
) -> Vec<Vec<(usize, usize)>> {
    if !configuration.is_tree() || !target.is_tree() {
        let matching = best_matching(target, configuration, |_, spot| Some(value(spot)));
        return vec![matching.pairs];
    }
    let mut spots: Vec<usize> = (0..target.node_count()).collect();
    spots.sort_by_key(|&spot| std::cmp::Reverse(value(spot)));
    rooted_subtree::largest_common(configuration, target, &spots, CANDIDATES_MAX)
}

/// One turn in the making.
pub(crate) struct PaperTurn<'a> {
    pub(crate) instance: &'a Instance,
    pub(crate) favourites: &'a mut Favourites,
    pub(crate) table: &'a mut SpotTable,
    pub(crate) evictions: &'a mut Vec<Displacement>,
}

/// What came of a configuration's turn.
#[derive(Clone, Debug, Default)]
pub(crate) struct PaperBlocks {
    /// The groups of modules that keep together.
    pub(crate) blocks: Vec<Vec<usize>>,
    /// The modules that were disconnected, ascending; each has had its turn.
    pub(crate) detached: Vec<usize>,
}

impl PaperTurn<'_> {
    /// `spotAllocation` (Algorithm 1, lines 1 to 9). A module that finds nothing gets nothing: NO_SPOT_FOUND.
    pub(crate) fn allocate_spot(&mut self, module: usize) {
        for spot in spots_by_utility(self.instance, module) {
            match self.table.holder(spot) {
                Holder::Nobody => {
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

    /// `evict` (Algorithm 1, lines 10 to 20), its recursion unrolled: whether `current` may take `contested` from
    /// `blocking`, and if so, who moves where.
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
                Holder::Nobody => return Some(moves),
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

    /// Lets the module of eviction `position`, and all that it displaces in turn, move as `evict` had them move.
    fn follow(&mut self, mut position: usize, moves: &[Move]) {
        for (number, &(module, spot)) in moves.iter().enumerate() {
            match self.table.holder(spot) {
                Holder::Nobody => {
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
                // What the test relied on has changed since.
                Holder::Singleton(_) | Holder::Fixed(_) | Holder::Closed => return,
            }
        }
    }

    /// `blockAllocation` (Algorithm 2). `members` are two or more modules, ascending and connected by links.
    pub(crate) fn allocate_block(&mut self, members: &[usize]) -> PaperBlocks {
        let links = topology_of(self.instance, members);
        let mut candidates = self.candidates(&links);
        candidates.sort_by_key(|candidate| std::cmp::Reverse(self.utility_of(members, candidate)));
        let mut kept = Vec::new();
        let mut yielding = BTreeSet::new();
        for (number, candidate) in candidates.iter().enumerate() {
            let tests: Vec<(usize, usize, Test)> = candidate
                .iter()
                .map(|&(node, spot)| (node, spot, self.test(members[node], spot)))
                .collect();
            let is_refused = |test: &Test| matches!(test, Test::Refused);
            let is_last = number + 1 == candidates.len();
            if tests.iter().any(|(_, _, test)| is_refused(test)) && !is_last {
                continue;
            }
            // Lines 6 to 15, and lines 16 to 21 for the modules that must yield.
            let (refused, free): (Vec<_>, Vec<_>) =
                tests.into_iter().partition(|(_, _, test)| is_refused(test));
            yielding = refused
                .into_iter()
                .map(|(node, ..)| members[node])
                .collect();
            kept = self.select(members, &links, free);
            break;
        }
        let placed: BTreeSet<usize> = kept.iter().map(|&(module, _)| module).collect();
        let unmatched: BTreeSet<usize> = members
            .iter()
            .copied()
            .filter(|member| !yielding.contains(member) && !placed.contains(member))
            .collect();
        let blocks = self.pieces(&kept);
        let together: BTreeSet<usize> = blocks.iter().flatten().copied().collect();
        let detached: Vec<usize> = members
            .iter()
            .copied()
            .filter(|member| !together.contains(member))
            .collect();
        // Lines 17 to 21, then lines 22 to 24, each by distance from the centre.
        for leaving in [yielding, unmatched] {
            let mut leaving: Vec<usize> = leaving.into_iter().collect();
            leaving.sort_unstable_by_key(|&module| self.instance.ranks[module]);
            for module in leaving {
                self.allocate_spot(module);
            }
        }
        PaperBlocks { blocks, detached }
    }

    /// Lines 1 to 4: the subgraphs of the target that equal the configuration, or else as much of it as can be.
    fn candidates(&self, links: &Topology) -> Vec<Embedding> {
        let utilities = &self.instance.utilities;
        candidates(links, self.instance.target.topology(), |spot| {
            utilities.value(spot)
        })
    }

    /// `U_A(t)`, without the reward, which is the same for all candidates as all have one size.
    fn utility_of(&self, members: &[usize], candidate: &Embedding) -> i64 {
        candidate
            .iter()
            .map(|&(node, spot)| self.instance.utilities.of(members[node], spot).0)
            .sum()
    }

    fn test(&mut self, module: usize, spot: usize) -> Test {
        match self.table.holder(spot) {
            Holder::Nobody => Test::Free,
            Holder::Singleton(holder) => match self.evict(module, holder, spot) {
                Some(moves) => Test::Evicts(moves),
                None => Test::Refused,
            },
            Holder::Fixed(_) | Holder::Closed => Test::Refused,
        }
    }

    /// Gives the modules of a candidate their spots, and lets those that they evict move as `evict` had them move.
    ///
    /// Returns the modules with their spots.
    fn select(
        &mut self,
        members: &[usize],
        links: &Topology,
        free: Vec<(usize, usize, Test)>,
    ) -> Vec<(usize, usize)> {
        let nodes: Vec<usize> = free.iter().map(|&(node, ..)| node).collect();
        let spots: Vec<usize> = free.iter().map(|&(_, spot, _)| spot).collect();
        let target = self.instance.target.topology();
        // A module that is left alone is part of a configuration no more and may be evicted.
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
        let links = &self.instance.links;
        let mut edges = Vec::new();
        for (first, &(module, spot)) in kept.iter().enumerate() {
            for &other in links.neighbours(module).iter().filter(|&&one| one > module) {
                if let Ok(second) = kept.binary_search_by_key(&other, |pair| pair.0)
                    && target.has_edge(spot, kept[second].1)
                {
                    edges.push((first, second));
                }
            }
        }
        let graph = Topology::new(kept.len(), &edges)
            .unwrap_or_else(|_| Topology::without_edges(kept.len()));
        graph
            .components_within(|_| true)
            .into_iter()
            .filter(|piece| piece.len() > 1)
            .map(|piece| piece.into_iter().map(|position| kept[position].0).collect())
            .collect()
    }
}

/// Whether a module of a configuration can have the spot matched to it.
enum Test {
    /// Nobody has it.
    Free,
    /// `evict` answers TRUE, and these modules move.
    Evicts(Vec<Move>),
    /// `evict` answers FALSE, or another configuration holds the spot.
    Refused,
}
