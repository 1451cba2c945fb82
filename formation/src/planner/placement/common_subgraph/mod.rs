//! The best common subgraph of a configuration and a target where one of them has a cycle.
//!
//! The paper (section "Block Allocation by Modules Connected in a Configuration") looks for an isomorphic subgraph
//! first and for a maximum common subgraph otherwise, and takes all graphs for trees. This does the same for any graphs:
//!
//! 1. `monomorphism`: the whole configuration with all its links, non-induced (spots may be adjacent though their modules
//!    are not linked), of greatest utility.
//! 2. If there is none, `branch_and_bound`: the most modules, then the most kept links, then the greatest utility,
//!    where the kept links (those whose ends stand on adjacent spots) connect the matched modules.
//!    It begins with what `spanning_trees` find.
//!
//! Both problems are NP-hard, so both searches are cut at a number of search nodes (a limit in time would let replicas
//! differ). What is found by then is bettered along spanning trees once more, and said to be unproven. Trees have
//! a polynomial algorithm of their own ([`crate::planner::placement::common_subtree`]).

mod branch_and_bound;
mod domains;
mod monomorphism;
mod spanning_trees;
#[cfg(test)]
mod tests;

use crate::model::MicroUnits;
use crate::planner::placement::{Matching, MatchingInput};

/// How many search nodes [`solve`] may enter.
pub const SEARCH_NODES_MAX: u64 = 100_000;

/// A node of the branch and bound costs about as much as this many of the search for the whole.
const BRANCH_NODE_COST: u64 = 5;
/// The branch and bound's work at a node grows with the configuration; this many modules are looked at in all.
const BRANCH_MODULES_MAX: u64 = 5_000_000;
/// How long climbing goes on without success before the branch and bound, and at most in all.
const FIRST_ROUNDS: (usize, usize) = (16, 100);
/// How long it goes on after a search that was cut.
const LAST_ROUNDS: usize = 100;

/// Finds the largest connected part of the configuration that fits into the target, among the largest one that keeps
/// the most links, and among those one of the greatest utility.
///
/// The answer is proven unless a search ran into [`SEARCH_NODES_MAX`]. It is the same for the same input; ties fall as the searches' orders have it, which depend on the graphs, the
/// weights and the nodes' numbers alone.
#[must_use]
pub fn solve<W: Fn(usize, usize) -> Option<MicroUnits>>(input: &MatchingInput<'_, W>) -> Matching {
    solve_within(input, SEARCH_NODES_MAX)
}

/// [`solve`] with a budget of one's own: search nodes for the whole configuration, and a fifth of that for a part.
#[must_use]
pub fn solve_within<W: Fn(usize, usize) -> Option<MicroUnits>>(
    input: &MatchingInput<'_, W>,
    nodes_max: u64,
) -> Matching {
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

fn finish<W: Fn(usize, usize) -> Option<MicroUnits>>(
    input: &MatchingInput<'_, W>,
    mut pairs: Vec<(usize, usize)>,
    budget: &Budget,
) -> Matching {
    if budget.is_spent {
        pairs = spanning_trees::climb(input, pairs, LAST_ROUNDS, LAST_ROUNDS);
    }
    pairs.sort_unstable();
    Matching {
        utility: pairs
            .iter()
            .filter_map(|&(module, spot)| (input.weight)(module, spot))
            .sum(),
        pairs,
        proven: !budget.is_spent,
    }
}

/// How many search nodes may still be entered.
struct Budget {
    left: u64,
    /// Whether a node was refused, so that something may have been missed.
    is_spent: bool,
}

impl Budget {
    fn of(nodes_max: u64) -> Self {
        Self {
            left: nodes_max,
            is_spent: false,
        }
    }

    /// Pays for one more node; false if there is nothing left, from which moment on the budget counts as spent.
    fn take(&mut self) -> bool {
        self.is_spent |= self.left == 0;
        self.left = self.left.saturating_sub(1);
        !self.is_spent
    }
}
