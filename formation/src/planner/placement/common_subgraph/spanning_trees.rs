//! Good matchings in polynomial time: climbing along spanning trees of both graphs.

use crate::model::{MicroUnits, Topology};
use crate::planner::placement::{MatchingInput, common_subtree};

/// How many pairs of a module and an edge of the target may be looked at in all. At least one pair of trees is tried.
const PAIRS_MAX: usize = 4_000_000;

/// How many of 100 kept links are let go before the next pair of trees is drawn, by turns.
const LET_GO_PERCENT: [u64; 4] = [5, 10, 20, 30];

/// Betters a matching until `fruitless_max` rounds in a row have not, or `rounds_max` are over.
///
/// What spanning trees of two graphs have in common, the graphs have too, and the best of that is found exactly
/// ([`common_subtree`]). So each round draws a spanning tree of each graph and takes what is best along them, if that has
/// more modules, or as many and keeps more links, or as many of both and more utility. The trees hold most of
/// the links that the best matching keeps, and their images, so that most of it stays within reach.
pub(super) fn climb<W: Fn(usize, usize) -> Option<MicroUnits>>(
    input: &MatchingInput<'_, W>,
    mut best: Vec<(usize, usize)>,
    fruitless_max: usize,
    rounds_max: usize,
) -> Vec<(usize, usize)> {
    let (configuration, target) = (input.configuration, input.target);
    let round_size = configuration.node_count() * target.edges().len();
    let rounds = rounds_max.min((PAIRS_MAX / round_size.max(1)).max(1));
    let utility = |pairs: &[(usize, usize)]| -> MicroUnits {
        pairs
            .iter()
            .filter_map(|&(module, spot)| (input.weight)(module, spot))
            .sum()
    };
    let mut best_score = (best.len(), input.kept_links(&best), utility(&best));
    let mut fruitless = 0;
    for (round, percent) in (0..rounds).zip(LET_GO_PERCENT.into_iter().cycle()) {
        let (mut links, mut edges) = kept(input, &best);
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
    best
}

/// The links that a matching keeps, and their images.
fn kept<W>(input: &MatchingInput<'_, W>, pairs: &[(usize, usize)]) -> (Edges, Edges) {
    let mut image = vec![None; input.configuration.node_count()];
    for &(module, spot) in pairs {
        image[module] = Some(spot);
    }
    let links = input.configuration.edges().iter();
    links
        .filter_map(|&(first, second)| {
            let (one, other) = (image[first]?, image[second]?);
            let is_kept = input.target.has_edge(one, other);
            is_kept.then_some(((first, second), (one, other)))
        })
        .unzip()
}

type Edges = Vec<(usize, usize)>;

/// A spanning tree of a connected graph that holds the edges of `first`, but for those that close a cycle of them; the others are
/// taken in an order that depends on the round (Kruskal).
fn spanning_tree(graph: &Topology, first: &[(usize, usize)], round: usize) -> Topology {
    let mut others = graph.edges().to_vec();
    others.sort_by_cached_key(|&edge| (scatter(round, edge, 2), edge));
    let mut groups: Vec<usize> = (0..graph.node_count()).collect();
    let mut edges = Vec::with_capacity(graph.node_count());
    for &(one, other) in first.iter().chain(&others) {
        let (one_group, other_group) = (group_of(&mut groups, one), group_of(&mut groups, other));
        if one_group != other_group {
            groups[one_group] = other_group;
            edges.push((one, other));
        }
    }
    // The edges are distinct edges of a graph, so this cannot fail.
    Topology::new(graph.node_count(), &edges)
        .unwrap_or_else(|_| Topology::without_edges(graph.node_count()))
}

/// The representative of a node's group, with the way there halved.
fn group_of(groups: &mut [usize], mut node: usize) -> usize {
    while groups[node] != node {
        groups[node] = groups[groups[node]];
        node = groups[node];
    }
    node
}

/// A number that looks random but is the same for the same edge, round and purpose everywhere: the finaliser of
/// Steele, Lea and Flood's SplitMix64.
fn scatter(round: usize, (first, second): (usize, usize), purpose: u64) -> u64 {
    let mut bits = purpose << 56 ^ (round as u64) << 40 ^ (first as u64) << 20 ^ second as u64;
    bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}
