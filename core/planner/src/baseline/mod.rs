//! Planners to compare with, each a policy: the paper's algorithms, and an auction and the Hungarian method, which
//! `formation_baselines` has.
//!
//! The auction and the Hungarian method treat every module as single, so they break all links. Both compute the whole
//! assignment before the first turn; each module then claims its spot in its turn.

mod paper;

use crate::assignment::{Instance, SpotTable};
use formation_baselines::auction::{self, AuctionCounts};
use formation_baselines::hungarian;
use formation_model::Policy;
pub use paper::{CandidateInput, Candidates};
pub(crate) use paper::{Favourites, PaperTurn};

/// The assignment that a central policy computes before the first turn.
#[derive(Clone, Debug, Default)]
pub(crate) struct CentralAssignment {
    /// The spot of each module; `None` for modules that held one before, and for those that get none.
    pub(crate) spot_of: Vec<Option<usize>>,
    /// The messages of the auction; `None` for the Hungarian method.
    pub(crate) auction: Option<AuctionCounts>,
}

/// Assigns the modules without a spot to the free spots by a central policy; `None` for policies that decide turn by turn.
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
        .filter(|&module| table.spot_of(module).is_none() && !instance.problem.is_cut_off(module))
        .collect();
    let spots: Vec<usize> = table.free_spots().collect();
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
