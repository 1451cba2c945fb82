//! Claims whose turn has not come.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use crate::model::{Decision, SpotClaim};

use super::super::refusal::Refusal;

/// The greatest number of claims that are kept before their turn.
const CLAIMS_MAX: usize = 16_384;
/// The greatest number of spots, evictions and modules in all claims that are kept.
const ENTRIES_MAX: usize = 1 << 17;
/// The greatest number of claims that are kept for one turn; only one of them can be right.
const CLAIMS_PER_TURN_MAX: u32 = 8;

/// The claims of one epoch that came before their turn.
#[derive(Clone, Debug, Default, Hash)]
pub(in crate::protocol) struct EarlyClaims {
    /// By turn, and for each turn in the order in which they came.
    claims: BTreeMap<(u32, u32), Arc<SpotClaim>>,
    entries: usize,
}

fn entries_of(decision: &Decision) -> usize {
    decision.selections.len() + decision.evictions.len() + decision.detached.len()
}

impl EarlyClaims {
    /// Keeps a claim for its turn.
    pub fn keep(&mut self, claim: Arc<SpotClaim>) -> Result<(), Refusal> {
        let entries = entries_of(&claim.decision);
        if self.claims.len() >= CLAIMS_MAX || self.entries + entries > ENTRIES_MAX {
            return Err(Refusal::BufferFull);
        }
        for number in 0..CLAIMS_PER_TURN_MAX {
            match self.claims.entry((claim.turn, number)) {
                Entry::Vacant(place) => {
                    place.insert(claim);
                    self.entries += entries;
                    return Ok(());
                }
                Entry::Occupied(known) if *known.get() == claim => return Ok(()),
                Entry::Occupied(_) => {}
            }
        }
        Err(Refusal::BufferFull)
    }

    /// Removes the first claim of the least turn that has one, if that is not later than this turn.
    pub fn take(&mut self, turn: u32) -> Option<Arc<SpotClaim>> {
        let first = self.claims.first_entry()?;
        let &(of_turn, _) = first.key();
        let claim = (of_turn <= turn).then(|| first.remove())?;
        self.entries -= entries_of(&claim.decision);
        Some(claim)
    }
}
