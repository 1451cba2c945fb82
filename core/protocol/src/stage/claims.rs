//! Claims that came before the plan by which they are judged.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use formation_model::SpotClaim;

use super::super::refusal::Refusal;

/// The greatest number of claims that are kept.
const CLAIMS_MAX: usize = 16_384;
/// The greatest number of spots, evictions and modules in all claims that are kept.
const ENTRIES_MAX: usize = 1 << 17;
/// The greatest number of claims that are kept for one turn; only one of them can be right.
const CLAIMS_PER_TURN_MAX: u32 = 8;

/// The claims of one epoch that came before this module's plan.
#[derive(Clone, Debug, Default, Hash)]
pub(crate) struct EarlyClaims {
    /// By turn, and for each turn in the order in which they came.
    claims: BTreeMap<(u32, u32), Arc<SpotClaim>>,
    entries: usize,
}

impl EarlyClaims {
    /// Keeps a claim until the plan is computed.
    /// Enforces C3.
    pub fn keep(&mut self, claim: Arc<SpotClaim>) -> Result<(), Refusal> {
        let entries = claim.decision.entry_count();
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

    /// The claims in the order of their turns.
    pub fn in_turn(self) -> impl Iterator<Item = Arc<SpotClaim>> {
        self.claims.into_values()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::{Decision, Epoch, Incarnation, ModuleId};

    fn claim(turn: u32, rival: u32) -> Arc<SpotClaim> {
        Arc::new(SpotClaim {
            epoch: Epoch {
                number: 1,
                convener: ModuleId(1),
            },
            turn,
            claimant: ModuleId(2),
            incarnation: Incarnation(1),
            decision: Decision {
                detached: vec![ModuleId(rival)],
                ..Decision::default()
            },
        })
    }

    #[test]
    fn claims_come_in_order_and_rivals_as_they_came() {
        let mut claims = EarlyClaims::default();
        for (turn, rival) in [(2, 7), (1, 9), (2, 5), (2, 7), (0, 3)] {
            claims.keep(claim(turn, rival)).unwrap();
        }
        let kept = claims.in_turn();
        let kept = kept.map(|claim| (claim.turn, claim.decision.detached[0].0));
        assert_eq!(kept.collect::<Vec<_>>(), [(0, 3), (1, 9), (2, 7), (2, 5)]);
    }

    /// Shows C3.
    #[test]
    fn one_turn_has_room_for_few_claims() {
        let mut claims = EarlyClaims::default();
        for rival in 0..CLAIMS_PER_TURN_MAX {
            assert_eq!(claims.keep(claim(4, rival)), Ok(()));
        }
        assert_eq!(claims.keep(claim(4, 99)), Err(Refusal::BufferFull));
        assert_eq!(claims.keep(claim(4, 0)), Ok(()), "it is kept already");
        assert_eq!(claims.keep(claim(5, 99)), Ok(()));
        assert_eq!(claims.entries, 9);
    }
}
