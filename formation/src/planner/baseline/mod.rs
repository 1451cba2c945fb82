//! Other planners to compare with, each a policy of its own: the paper's algorithms to the letter, an auction and the
//! Hungarian method.
//!
//! The auction and the Hungarian method know no configurations: to them every module is single, so that they break
//! all links. Both settle the whole assignment at once; each module then claims its spot in its turn.

pub mod auction;
pub mod hungarian;
pub(crate) mod paper;
mod rooted_subtree;

use crate::model::Policy;
use crate::planner::assignment::{Holder, Instance, SpotTable};
pub use auction::AuctionCounts;
pub use paper::candidates as paper_candidates;

/// A whole assignment that a central policy has made before the first turn.
#[derive(Clone, Debug, Default)]
pub(crate) struct CentralAssignment {
    /// The spot of each module that was free to move.
    pub(crate) spot_of: Vec<Option<usize>>,
    /// What the auction said; nothing for the Hungarian method.
    pub(crate) auction: Option<AuctionCounts>,
}

/// Lets a central policy assign the modules that hold no spot to the spots that nobody holds.
///
/// Returns `None` for policies that decide turn by turn.
pub(crate) fn assign_centrally(
    instance: &Instance,
    table: &SpotTable,
) -> Option<CentralAssignment> {
    let policy = instance.problem.parameters().policy;
    if !matches!(policy, Policy::Auction | Policy::Hungarian) {
        return None;
    }
    let module_count = instance.problem.modules().len();
    let modules: Vec<usize> = (0..module_count)
        .filter(|&module| table.spot_of(module).is_none())
        .collect();
    let spots: Vec<usize> = table
        .holders()
        .iter()
        .enumerate()
        .filter(|&(_, &holder)| holder == Holder::Nobody)
        .map(|(spot, _)| spot)
        .collect();
    let utilities: Vec<Vec<i64>> = modules
        .iter()
        .map(|&module| {
            spots
                .iter()
                .map(|&spot| instance.utilities.of(module, spot).0)
                .collect()
        })
        .collect();
    let (columns, auction) = if policy == Policy::Auction {
        let outcome = auction::assign(&utilities);
        (outcome.assignment, Some(outcome.counts))
    } else {
        (hungarian::assign(&utilities), None)
    };
    let mut spot_of = vec![None; module_count];
    for (&module, column) in modules.iter().zip(columns) {
        spot_of[module] = column.map(|column| spots[column]);
    }
    Some(CentralAssignment { spot_of, auction })
}
