//! The decision of a turn: which spots change hands.

use serde::{Deserialize, Serialize};

use crate::{ModuleId, SpotId};

/// One (spot, selector) pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SpotSelection {
    /// The spot.
    pub spot: SpotId,
    /// The module that takes it.
    pub module: ModuleId,
}

/// One module losing its spot to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct EvictionRecord {
    /// The module that loses its spot.
    pub evicted: ModuleId,
    /// The module that takes it.
    pub by: ModuleId,
    /// The spot that changes hands.
    pub from: SpotId,
    /// The spot that the evicted module takes instead; `None` leaves it without a spot.
    pub to: Option<SpotId>,
}

/// The decision of one unit in its turn; applied as a whole or not at all.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Decision {
    /// The new pairs, with the new spots of evicted modules; ascending by spot. Empty means NO_SPOT_FOUND.
    pub selections: Vec<SpotSelection>,
    /// The evictions that it makes, in the order of the chain.
    pub evictions: Vec<EvictionRecord>,
    /// The modules that leave their configuration, ascending; in an exact finish also those that left it in an earlier turn
    /// and get a spot only now.
    pub detached: Vec<ModuleId>,
    /// In the last turn alone: the new holders of the spots that equal units swap after it, ascending by spot, where nothing
    /// could carry out the claims.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub swaps: Vec<SpotSelection>,
}

impl Decision {
    /// The number of its spots, evictions and modules, by which the memory for decisions is limited.
    pub fn entry_count(&self) -> usize {
        self.selections.len() + self.evictions.len() + self.detached.len() + self.swaps.len()
    }
}
