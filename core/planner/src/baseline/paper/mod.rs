//! The paper's own planner: Algorithms 1 and 2.
//!
//! `docs/paper.md` goes through the paper line by line and names every reading. Where the text and the pseudo-code leave
//! something open, [`PaperOptions`](formation_model::PaperOptions) decide; what the paper does not mention at all is settled
//! here:
//!
//! - `evict` answers TRUE or FALSE but never says which spot the evicted module takes. The text and the proof of Theorem 2
//!   send it to the second-best spot of the test, so it moves there. If that spot is no longer free when the module moves,
//!   which happens when a block evicts several modules, the module gets no spot: neither algorithm gives it another turn.
//! - A module of a configuration that keeps no link has left the configuration, so it can be evicted like a singleton.
//! - Ties of utility go to the lower identifier, among candidates to the earlier one.

mod block_allocation;
mod candidates;
mod spot_allocation;

use crate::assignment::{Displacement, Instance, SpotTable};
pub use candidates::{CandidateInput, Candidates};
pub(crate) use spot_allocation::Favourites;

/// The state on which one turn works.
pub(crate) struct PaperTurn<'a> {
    /// What a configuration may spend on its search for candidates.
    pub(crate) nodes_max: u64,
    pub(crate) instance: &'a Instance,
    pub(crate) favourites: &'a mut Favourites,
    pub(crate) table: &'a mut SpotTable,
    pub(crate) evictions: &'a mut Vec<Displacement>,
}
