//! The best common subgraph of a configuration and a target of which at least one has a cycle.
//!
//! The paper (section "Block Allocation by Modules Connected in a Configuration") looks for an isomorphic subgraph
//! first and for a maximum common subgraph otherwise, and takes all graphs for trees. This does the same for any graphs:
//!
//! 1. `monomorphism`: the whole configuration with all its links, non-induced (spots can be adjacent though their modules
//!    are not linked), of greatest utility.
//! 2. If there is none, `branch_and_bound`: the most modules, then the most kept links, then the greatest utility,
//!    where the kept links connect the matched modules. It starts from the matching that `spanning_trees` finds.
//!
//! Both problems are NP-hard, so both searches end at a number of search nodes; with a time limit, replicas could differ.
//! The best matching by then is improved along spanning trees once more and reported as unproven. Trees have a polynomial
//! algorithm of their own ([`crate::planner::placement::common_subtree`]).

mod branch_and_bound;
mod domains;
mod monomorphism;
mod spanning_trees;
#[cfg(test)]
mod tests;

use crate::planner::placement::matching::{Matching, MatchingInput, Pairs, Weight};

/// The greatest number of search nodes that [`solve`] enters.
pub(crate) const SEARCH_NODES_MAX: u64 = 100_000;

/// The cost of a node of the branch and bound, in nodes of the search for the whole configuration.
const BRANCH_NODE_COST: u64 = 5;
/// The greatest number of modules that the branch and bound looks at; each of its nodes looks at the whole configuration.
const BRANCH_MODULES_MAX: u64 = 5_000_000;
/// Before the branch and bound: the rounds of climbing without success after which it ends, and the rounds in all.
const FIRST_ROUNDS: (usize, usize) = (16, 100);
/// The rounds of climbing after a search that ended at its budget.
const LAST_ROUNDS: usize = 100;

/// Finds the largest connected part of the configuration that fits into the target; among the largest one that keeps the
/// most links, and among those one of the greatest utility.
///
/// The answer is proven unless a search reaches [`SEARCH_NODES_MAX`]. It is the same for the same input; ties go by the
/// order of the search, which depends on the graphs, the weights and the numbers of the nodes alone.
pub(crate) fn solve<W: Weight>(input: &MatchingInput<'_, W>) -> Matching {
    solve_within(input, SEARCH_NODES_MAX)
}

/// [`solve`] with a budget of `nodes_max` search nodes for the whole configuration, and a fifth of that for a part.
fn solve_within<W: Weight>(input: &MatchingInput<'_, W>, nodes_max: u64) -> Matching {
    let module_count = input.configuration.node_count();
    let mut budget = Budget::of(nodes_max);
    if let Some(pairs) = monomorphism::search(input, &mut budget) {
        return finish(input, pairs, &budget);
    }
    let (fruitless_max, rounds_max) = FIRST_ROUNDS;
    let incumbent = spanning_trees::climb(input, Vec::new(), fruitless_max, rounds_max);
    let affordable = BRANCH_MODULES_MAX / (module_count as u64).max(1);
    let mut budget = Budget::of((nodes_max / BRANCH_NODE_COST).min(affordable));
    let pairs = branch_and_bound::search(input, incumbent, &mut budget);
    finish(input, pairs, &budget)
}

fn finish<W: Weight>(input: &MatchingInput<'_, W>, mut pairs: Pairs, budget: &Budget) -> Matching {
    if budget.is_spent {
        pairs = spanning_trees::climb(input, pairs, LAST_ROUNDS, LAST_ROUNDS);
    }
    pairs.sort_unstable();
    Matching {
        utility: input.utility(&pairs),
        pairs,
        proven: !budget.is_spent,
    }
}

/// The search nodes that may still be entered.
struct Budget {
    left: u64,
    /// Whether a node was refused, so that the search may have missed the best matching.
    is_spent: bool,
}

impl Budget {
    fn of(nodes_max: u64) -> Self {
        Self {
            left: nodes_max,
            is_spent: false,
        }
    }

    /// Pays for one more node. Returns false from the first node on that the budget does not cover.
    fn take(&mut self) -> bool {
        self.is_spent |= self.left == 0;
        self.left = self.left.saturating_sub(1);
        !self.is_spent
    }
}
