//! Claims whose turn has not come.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::model::{Decision, SpotClaim};

use super::super::refusal::Refusal;

/// The greatest number of claims that are kept before their turn.
const CLAIMS_MAX: usize = 16_384;
/// The greatest number of spots, evictions and modules in all claims that are kept.
const ENTRIES_MAX: usize = 1 << 17;
/// The greatest number of claims that are kept for one turn; only one of them can be right.
const CLAIMS_PER_TURN_MAX: usize = 8;

/// The claims of one epoch that came before their turn.
#[derive(Clone, Debug, Default, Hash)]
pub(in crate::protocol) struct EarlyClaims {
    claims: BTreeMap<u32, Vec<Arc<SpotClaim>>>,
    count: usize,
    entries: usize,
}

fn entries_of(decision: &Decision) -> usize {
    decision.selections.len() + decision.evictions.len() + decision.detached.len()
}

impl EarlyClaims {
    /// Keeps a claim for its turn.
    pub fn keep(&mut self, claim: Arc<SpotClaim>) -> Result<(), Refusal> {
        let entries = entries_of(&claim.decision);
        if self.count >= CLAIMS_MAX || self.entries + entries > ENTRIES_MAX {
            return Err(Refusal::BufferFull);
        }
        let same_turn = self.claims.entry(claim.turn).or_default();
        if same_turn.contains(&claim) {
            return Ok(());
        }
        if same_turn.len() >= CLAIMS_PER_TURN_MAX {
            return Err(Refusal::BufferFull);
        }
        same_turn.push(claim);
        self.count += 1;
        self.entries += entries;
        Ok(())
    }

    /// Removes the claims of a turn.
    pub fn take(&mut self, turn: u32) -> Vec<Arc<SpotClaim>> {
        let claims = self.claims.remove(&turn).unwrap_or_default();
        let entries = claims.iter().map(|claim| entries_of(&claim.decision));
        self.count -= claims.len();
        self.entries -= entries.sum::<usize>();
        claims
    }
}
