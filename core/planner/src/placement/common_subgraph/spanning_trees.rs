//! Good matchings in polynomial time, by climbing along spanning trees of both graphs.

use petgraph::unionfind::UnionFind;

use crate::placement::common_subtree;
use crate::placement::matching::{MatchingInput, Pairs, Weight};
use formation_model::Topology;

/// The greatest number of pairs of a module and a target edge that all rounds look at; the first round always runs.
const PAIRS_MAX: usize = 4_000_000;

/// The pairs of a module and a target edge that cost as much as a node of the search for the whole configuration.
const PAIRS_PER_NODE: usize = 4;

/// The percentage of the kept links that a round may drop, in turn.
const DROPPED_PERCENT: [u64; 4] = [5, 10, 20, 30];

/// The cost of a round, in nodes of the search for the whole configuration.
pub(super) fn round_cost<W>(input: &MatchingInput<'_, W>) -> u64 {
    (round_size(input) / PAIRS_PER_NODE).max(1) as u64
}

/// The pairs of a module and a target edge. A round also draws a spanning tree of the target, which costs as much as a
/// few modules.
fn round_size<W>(input: &MatchingInput<'_, W>) -> usize {
    input.configuration.node_count() * input.target.edges().len()
}

/// Improves a matching until `fruitless_max` rounds in a row fail, or for `rounds_max` rounds.
///
/// A common subgraph of spanning trees of two graphs is a common subgraph of the graphs, and the best one of two trees is
/// found exactly ([`common_subtree`]). Each round draws a spanning tree of each graph and takes the best matching along
/// them if it has more modules, then more kept links, then more utility. The trees contain most of the links that the best
/// matching keeps, and their images, so that most of that matching stays possible. Returns the number of rounds with the
/// matching.
pub(super) fn climb<W: Weight>(
    input: &MatchingInput<'_, W>,
    mut best: Pairs,
    fruitless_max: usize,
    rounds_max: usize,
) -> (Pairs, u64) {
    let (configuration, target) = (input.configuration, input.target);
    let rounds = rounds_max.min((PAIRS_MAX / round_size(input).max(1)).max(1));
    let mut taken = 0;
    let mut best_score = (best.len(), input.kept_links(&best), input.utility(&best));
    let mut fruitless = 0;
    for (round, percent) in (0..rounds).zip(DROPPED_PERCENT.into_iter().cycle()) {
        taken += 1;
        let (mut links, mut edges) = input.kept(&best);
        links.retain(|&link| scatter(round, link, 0) % 100 >= percent);
        edges.retain(|&edge| scatter(round, edge, 1) % 100 >= percent);
        let matching = common_subtree::solve(&MatchingInput {
            configuration: &spanning_tree(configuration, &links, round),
            target: &spanning_tree(target, &edges, round),
            weight: &input.weight,
        });
        let links = input.kept_links(&matching.pairs);
        let score = (matching.pairs.len(), links, matching.utility);
        if score > best_score || best.is_empty() {
            best_score = score;
            best = matching.pairs;
            fruitless = 0;
        } else {
            fruitless += 1;
            if fruitless >= fruitless_max {
                break;
            }
        }
    }
    (best, taken)
}

/// A spanning tree of a connected graph by Kruskal's algorithm: the edges of `first` that close no cycle, then the others in
/// an order that depends on the round.
fn spanning_tree(graph: &Topology, first: &[(usize, usize)], round: usize) -> Topology {
    let mut others = graph.edges().to_vec();
    others.sort_by_cached_key(|&edge| (scatter(round, edge, 2), edge));
    let mut sets = UnionFind::new(graph.node_count());
    let mut edges = first.to_vec();
    edges.extend(others);
    edges.retain(|&(one, other)| sets.union(one, other));
    Topology::new(graph.node_count(), &edges)
}

/// A pseudo-random number for an edge, a round and a purpose, the same on every machine: the finaliser of SplitMix64
/// (G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
fn scatter(round: usize, (first, second): (usize, usize), purpose: u64) -> u64 {
    let mut bits = purpose << 56 ^ (round as u64) << 40 ^ (first as u64) << 20 ^ second as u64;
    bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}
