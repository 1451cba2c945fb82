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
//! The caller gives the number, its share of what all placements of a plan may spend
//! ([`crate::placement::SearchBudget`]). The best matching by then is improved along spanning trees once more and
//! reported as unproven. Trees have a polynomial algorithm of their own ([`crate::placement::common_subtree`]).

mod branch_and_bound;
mod domains;
mod links_bound;
mod monomorphism;
mod spanning_trees;
#[cfg(test)]
mod tests;

use self::links_bound::LinksBound;
use crate::placement::matching::{Matching, MatchingInput, Pairs, Weight};

/// The greatest number of nodes of the search for the whole configuration, and the cost of all nodes of the branch and bound.
const SEARCH_NODES_MAX: u64 = 100_000;
/// The cost of a node of the branch and bound, in nodes of the search for the whole configuration.
const BRANCH_NODE_COST: u64 = 5;
/// A node of the branch and bound looks at the whole configuration: this many of its modules cost as much as a node of the
/// search for the whole configuration.
const MODULES_PER_NODE: u64 = 50;
/// Before the branch and bound: the rounds of climbing without success after which it ends, and the rounds in all.
const FIRST_ROUNDS: (usize, usize) = (16, 100);
/// The rounds of climbing after a search that ended at its budget.
const LAST_ROUNDS: usize = 100;

/// Finds the largest connected part of the configuration that fits into the target; among the largest one that keeps the
/// most links, and among those one of the greatest utility.
///
/// The searches together cost at most `nodes_max` nodes of the search for the whole configuration, except that the first
/// round of climbing always runs. The answer is proven unless a search ends at its budget. It is the same for the same input;
/// ties go by the order of the search, which depends on the graphs, the weights and the numbers of the nodes alone.
pub(crate) fn solve<W: Weight>(input: &MatchingInput<'_, W>, nodes_max: u64) -> Matching {
    let bound = LinksBound::of(input.configuration, input.target);
    let (module_count, link_count) = (
        input.configuration.node_count(),
        input.configuration.edges().len(),
    );
    if bound.for_modules(module_count) < link_count {
        return solve_partially(input, &bound, nodes_max, nodes_max);
    }
    let mut left = nodes_max;
    // With plenty of nodes each search has its greatest budget; with few, none leaves nothing to those after it.
    let mut budget = Budget::of((left / 2).min(SEARCH_NODES_MAX));
    let found = monomorphism::search(input, &mut budget);
    left -= budget.spent;
    let Some(pairs) = found else {
        return solve_partially(input, &bound, nodes_max, left);
    };
    let is_proven = !budget.is_spent;
    finish(input, pairs, is_proven, nodes_max, left)
}

/// The same once it is known that the whole configuration does not fit, or was not found in its budget.
fn solve_partially<W: Weight>(
    input: &MatchingInput<'_, W>,
    bound: &LinksBound,
    nodes_max: u64,
    mut left: u64,
) -> Matching {
    let round_cost = spanning_trees::round_cost(input);
    let affordable = |nodes: u64| usize::try_from(nodes / round_cost).unwrap_or(usize::MAX);
    let (fruitless_max, rounds_max) = FIRST_ROUNDS;
    let rounds_max = rounds_max.min(affordable(left / 4)).max(1);
    let (incumbent, rounds) = spanning_trees::climb(input, Vec::new(), fruitless_max, rounds_max);
    left = left.saturating_sub(rounds * round_cost);
    let module_count = input.configuration.node_count() as u64;
    let node_cost = BRANCH_NODE_COST.max(module_count / MODULES_PER_NODE);
    let mut budget = Budget::of((left / 4 * 3).min(SEARCH_NODES_MAX) / node_cost);
    let pairs = branch_and_bound::search(input, bound, incumbent, &mut budget);
    left -= budget.spent * node_cost;
    finish(input, pairs, !budget.is_spent, nodes_max, left)
}

/// Improves a matching that is not proven with the nodes that are left.
fn finish<W: Weight>(
    input: &MatchingInput<'_, W>,
    mut pairs: Pairs,
    is_proven: bool,
    nodes_max: u64,
    mut left: u64,
) -> Matching {
    if !is_proven {
        let round_cost = spanning_trees::round_cost(input);
        let affordable = usize::try_from(left / round_cost).unwrap_or(usize::MAX);
        let rounds_max = LAST_ROUNDS.min(affordable);
        let (improved, rounds) = spanning_trees::climb(input, pairs, LAST_ROUNDS, rounds_max);
        pairs = improved;
        left = left.saturating_sub(rounds * round_cost);
    }
    pairs.sort_unstable();
    Matching {
        utility: input.utility(&pairs),
        pairs,
        proven: is_proven,
        nodes: nodes_max - left,
    }
}

/// The search nodes that may still be entered.
struct Budget {
    left: u64,
    spent: u64,
    /// Whether a node was refused, so that the search may have missed the best matching.
    is_spent: bool,
}

impl Budget {
    fn of(nodes_max: u64) -> Self {
        Self {
            left: nodes_max,
            spent: 0,
            is_spent: false,
        }
    }

    /// Pays for one more node. Returns false from the first node on that the budget does not cover.
    fn take(&mut self) -> bool {
        match self.left.checked_sub(1) {
            Some(left) => {
                self.left = left;
                self.spent += 1;
            }
            None => self.is_spent = true,
        }
        !self.is_spent
    }
}
