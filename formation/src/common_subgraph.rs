//! The best common subgraph of a configuration and a target where one of them has a cycle.
//!
//! The paper (section "Block Allocation by Modules Connected in a Configuration") looks for an isomorphic subgraph
//! first and for a maximum common subgraph otherwise, and takes all graphs for trees. This does the same for any graphs:
//!
//! 1. [`monomorphism`]: the whole configuration with all its links, non-induced (spots may be adjacent though their modules
//!    are not linked), of greatest utility.
//! 2. If there is none, [`branch_and_bound`]: the most modules, then the most kept links, then the greatest utility,
//!    where the kept links (those whose ends stand on adjacent spots) connect the matched modules.
//!
//! Both problems are NP-hard, so both searches are cut at a number of search nodes, and then give the best they have
//! found. A limit in time would let replicas differ. Trees have a polynomial algorithm of their own
//! ([`crate::common_subtree`]).

mod branch_and_bound;
mod monomorphism;
#[cfg(test)]
mod tests;

use crate::fixed::MicroUnits;
use crate::matching::{Matching, MatchingInput};

/// How many search nodes a solution may cost, both searches together.
pub const SEARCH_NODES_MAX: u64 = 200_000;

/// Finds the largest connected part of the configuration that fits into the target, among the largest one that keeps
/// the most links, and among those one of the greatest utility.
///
/// The answer is proven unless the search ran into [`SEARCH_NODES_MAX`]. It is the same for the same input; ties
/// fall as the searches' orders have it, which depend on the graphs, the weights and the nodes' numbers alone.
#[must_use]
pub fn solve<W: Fn(usize, usize) -> Option<MicroUnits>>(input: &MatchingInput<'_, W>) -> Matching {
    solve_within(input, SEARCH_NODES_MAX)
}

/// [`solve`] with a budget of one's own, in search nodes.
#[must_use]
pub fn solve_within<W: Fn(usize, usize) -> Option<MicroUnits>>(
    input: &MatchingInput<'_, W>,
    nodes_max: u64,
) -> Matching {
    let mut budget = Budget::of(nodes_max.div_ceil(2));
    let whole = monomorphism::search(input, &mut budget);
    if let Some(pairs) = whole {
        return matching(input, pairs, !budget.is_spent());
    }
    let mut budget = Budget::of(nodes_max - budget.used());
    let pairs = branch_and_bound::search(input, &mut budget);
    matching(input, pairs, !budget.is_spent())
}

fn matching<W: Fn(usize, usize) -> Option<MicroUnits>>(
    input: &MatchingInput<'_, W>,
    mut pairs: Vec<(usize, usize)>,
    proven: bool,
) -> Matching {
    pairs.sort_unstable();
    Matching {
        utility: pairs
            .iter()
            .filter_map(|&(node, spot)| (input.weight)(node, spot))
            .sum(),
        pairs,
        proven,
    }
}

/// How many search nodes may still be entered.
struct Budget {
    nodes_max: u64,
    used: u64,
    is_spent: bool,
}

impl Budget {
    fn of(nodes_max: u64) -> Self {
        Self {
            nodes_max,
            used: 0,
            is_spent: false,
        }
    }

    /// Pays for one more node; false if there is nothing left, from which moment on the budget counts as spent.
    fn take(&mut self) -> bool {
        if self.used == self.nodes_max {
            self.is_spent = true;
            return false;
        }
        self.used += 1;
        true
    }

    fn used(&self) -> u64 {
        self.used
    }

    /// Whether a node was refused, so that something may have been missed.
    fn is_spent(&self) -> bool {
        self.is_spent
    }
}
