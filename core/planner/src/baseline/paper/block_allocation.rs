//! `blockAllocation` (Algorithm 2).

use std::cmp::Reverse;
use std::collections::BTreeSet;

use super::PaperTurn;
use super::candidates::{CandidateInput, Candidates};
use super::spot_allocation::Move;
use crate::assignment::{Displacement, Holder};
use crate::placement::Pairs;
use formation_model::{Fallback, Topology};

/// The effects of a configuration's turn beyond the spots that change hands.
pub(crate) struct BlockTurn {
    /// The groups of modules that stay together.
    pub(crate) blocks: Vec<Vec<usize>>,
    /// The disconnected modules, ascending, which have had their turns.
    pub(crate) detached: Vec<usize>,
    /// Whether the candidates are those of Algorithm 2.
    pub(crate) proven: bool,
    /// The search nodes that were spent.
    pub(crate) nodes: u64,
}

impl PaperTurn<'_> {
    /// `blockAllocation` (Algorithm 2). `members` are two or more modules, ascending and connected by links.
    pub(crate) fn allocate_block(&mut self, members: &[usize]) -> BlockTurn {
        let links = self.instance.links.induced_by(members);
        let Candidates {
            embeddings,
            proven,
            nodes,
        } = self.candidates(members, &links);
        let tests = self.chosen(members, &embeddings);
        // Lines 6 to 15, and lines 16 to 21 for the modules that must yield.
        let (refused, free): (Vec<_>, Vec<_>) = tests
            .into_iter()
            .partition(|(_, _, test)| matches!(test, Test::Refused));
        let yielding: BTreeSet<usize> = refused.iter().map(|&(node, ..)| members[node]).collect();
        let kept = self.select(members, &links, free);
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
        BlockTurn {
            blocks,
            detached,
            proven,
            nodes,
        }
    }

    /// Lines 2 to 5: the candidates in descending order of utility, equals in the order of candidates.
    fn candidates(&self, members: &[usize], links: &Topology) -> Candidates {
        let utilities = &self.instance.utilities;
        let options = &self.instance.problem.parameters().paper;
        let input = CandidateInput {
            configuration: links,
            target: self.instance.target.topology(),
            value: |spot| utilities.value(spot),
            utility: |node: usize, spot| utilities.of(members[node], spot),
            embedding: options.embedding,
            nodes_max: self.nodes_max,
        };
        let mut candidates = input.candidates(options.max());
        // `U_A(t)`, without the reward, which is equal for all candidates, since all have the same size.
        let utility_of = |&(node, spot): &(usize, usize)| utilities.of(members[node], spot).0;
        let total = |pairs: &Pairs| pairs.iter().map(utility_of).sum::<i64>();
        candidates
            .embeddings
            .sort_by_key(|pairs| Reverse(total(pairs)));
        candidates
    }

    /// Lines 5 to 16: the first candidate of which no spot is refused; if there is none, the one of the reading. Each node
    /// with its spot, and whether it can have it.
    fn chosen(&mut self, members: &[usize], embeddings: &[Pairs]) -> Vec<Tested> {
        let fallback = self.instance.problem.parameters().paper.fallback;
        let mut chosen: Option<(usize, Vec<Tested>)> = None;
        for pairs in embeddings {
            let tests: Vec<Tested> = pairs
                .iter()
                .map(|&(node, spot)| (node, spot, self.test(members[node], spot)))
                .collect();
            let refused = tests
                .iter()
                .filter(|(_, _, test)| matches!(test, Test::Refused));
            let refused = refused.count();
            if refused == 0 {
                return tests;
            }
            let is_better = chosen.as_ref().is_none_or(|&(fewest, _)| match fallback {
                Fallback::Last => true,
                Fallback::Fewest => refused < fewest,
            });
            if is_better {
                chosen = Some((refused, tests));
            }
        }
        chosen.map(|(_, tests)| tests).unwrap_or_default()
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
    fn select(&mut self, members: &[usize], links: &Topology, free: Vec<Tested>) -> Pairs {
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

/// A node of a configuration, the spot matched to it, and whether it can take it.
type Tested = (usize, usize, Test);

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
