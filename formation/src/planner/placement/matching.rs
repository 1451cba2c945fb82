//! The common question of the two common-subgraph solvers, and their common answer.
//!
//! Which modules of a configuration can keep their links to each other if they take which spots of the target?
//! One solver answers for trees, the other for graphs with cycles; both take and give what stands here.

use crate::model::{MicroUnits, Topology};

/// One configuration to be laid into one target.
#[derive(Clone, Copy, Debug)]
pub struct MatchingInput<'a, W> {
    /// The modules' links; connected.
    pub configuration: &'a Topology,
    /// The spots' edges; connected.
    pub target: &'a Topology,
    /// What it is worth, in micro-units, that a node of the configuration (first) takes a node of the target
    /// (second); `None` forbids it. Solvers may ask for any pair several times and in any order.
    pub weight: W,
}

/// The best way found to lay a configuration, or a part of it, into a target.
///
/// The matched nodes are connected in the configuration by links whose images are edges of the target.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Matching {
    /// Pairs of a configuration's node and the target's node that it takes, ascending.
    pub pairs: Vec<(usize, usize)>,
    /// The sum of the pairs' weights.
    pub utility: MicroUnits,
    /// Whether no better matching exists; `false` when a search was cut at its budget.
    pub proven: bool,
}

impl<W: Fn(usize, usize) -> Option<MicroUnits>> MatchingInput<'_, W> {
    /// How many links a matching keeps: pairs of linked nodes whose images are adjacent.
    #[must_use]
    pub fn kept_links(&self, pairs: &[(usize, usize)]) -> usize {
        let mut image = vec![None; self.configuration.node_count()];
        for &(node, spot) in pairs {
            image[node] = Some(spot);
        }
        self.configuration
            .edges()
            .iter()
            .filter(|&&(first, second)| {
                matches!((image[first], image[second]), (Some(one), Some(other)) if self.target.has_edge(one, other))
            })
            .count()
    }
}
