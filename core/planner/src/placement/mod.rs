//! The place of a configuration in the target: a utility-optimal maximum common subgraph, exact on trees and by branch and
//! bound on other graphs (paper, Algorithm 2).

mod budget;
pub(crate) mod common_subgraph;
pub mod common_subtree;
mod directed_edges;
mod matching;
mod small_assignment;

pub(crate) use budget::SearchBudget;
pub(crate) use directed_edges::DirectedEdges;
pub use matching::{Matching, MatchingInput, Pairs, Weight};
pub(crate) use small_assignment::{NO_COLUMN, Score, SmallAssignment};

use formation_model::{MicroUnits, Topology};

/// Finds the best place of a connected configuration in a connected target: with the exact programme if both are trees,
/// otherwise with the search for graphs with cycles, which ends after `nodes_max` search nodes.
pub(crate) fn best_matching(
    target: &Topology,
    configuration: &Topology,
    weight: impl Fn(usize, usize) -> Option<MicroUnits>,
    nodes_max: u64,
) -> Matching {
    let input = MatchingInput {
        configuration,
        target,
        weight,
    };
    let is_tree = |graph: &Topology| graph.edges().len() + 1 == graph.node_count();
    if is_tree(configuration) && is_tree(target) {
        common_subtree::solve(&input)
    } else {
        common_subgraph::solve(&input, nodes_max)
    }
}
