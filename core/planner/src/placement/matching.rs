//! The input and the output of the two common-subgraph solvers, one for trees and one for graphs with cycles.
//!
//! The question is which modules of a configuration can keep their links to each other if they take which spots of the
//! target.

use formation_model::{MicroUnits, Topology};

/// The worth of a pair of a configuration's node (first) and a target's node (second); `None` forbids the pair. Solvers
/// can ask for any pair repeatedly and in any order.
pub trait Weight: Fn(usize, usize) -> Option<MicroUnits> {}

impl<W: Fn(usize, usize) -> Option<MicroUnits>> Weight for W {}

/// A list of pairs: of a configuration's node and the target's node that it takes, or of the ends of edges.
pub type Pairs = Vec<(usize, usize)>;

/// One configuration to place in one target.
#[derive(Clone, Copy, Debug)]
pub struct MatchingInput<'a, W> {
    /// The links of the modules; connected.
    pub configuration: &'a Topology,
    /// The edges of the spots; connected.
    pub target: &'a Topology,
    /// The worth of each pair.
    pub weight: W,
}

/// A placement of a configuration, or of a part of it, in a target.
///
/// The matched nodes are connected in the configuration by links whose images are edges of the target.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Matching {
    /// The matched nodes with their target nodes, ascending.
    pub pairs: Pairs,
    /// The sum of the pairs' weights.
    pub utility: MicroUnits,
    /// Whether no better matching exists; `false` when a search ended at its budget.
    pub proven: bool,
    /// What the search cost, in search nodes; none on trees.
    pub nodes: u64,
}

impl<W> MatchingInput<'_, W> {
    /// The links that a matching keeps, which are those whose ends take adjacent nodes, and the edges that these links
    /// take.
    pub(crate) fn kept(&self, pairs: &[(usize, usize)]) -> (Pairs, Pairs) {
        let mut image = vec![None; self.configuration.node_count()];
        for &(node, spot) in pairs {
            image[node] = Some(spot);
        }
        let links = self.configuration.edges().iter();
        links
            .filter_map(|&(first, second)| {
                let (one, other) = (image[first]?, image[second]?);
                let is_kept = self.target.has_edge(one, other);
                is_kept.then_some(((first, second), (one, other)))
            })
            .unzip()
    }

    /// The number of links that a matching keeps.
    pub(crate) fn kept_links(&self, pairs: &[(usize, usize)]) -> usize {
        self.kept(pairs).0.len()
    }
}

impl<W: Weight> MatchingInput<'_, W> {
    /// The sum of the weights of some pairs.
    pub(crate) fn utility(&self, pairs: &[(usize, usize)]) -> MicroUnits {
        let weights = pairs.iter();
        weights
            .filter_map(|&(node, spot)| (self.weight)(node, spot))
            .sum()
    }
}
