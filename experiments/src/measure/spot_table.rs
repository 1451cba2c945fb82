//! The module of each spot after each decision.

use std::collections::BTreeMap;

use formation_model::{Decision, ModuleId, SpotId};

/// The (spot, selector) pairs, computed from all claims.
#[derive(Default)]
pub(super) struct SpotTable {
    pub spot_of: BTreeMap<ModuleId, SpotId>,
}

impl SpotTable {
    pub(super) fn apply(&mut self, decision: &Decision) {
        // Selections list only the spots whose module changes. They omit a module that a later chain of the same
        // decision sends back to its old spot, so evictions are applied as well.
        for eviction in &decision.evictions {
            match eviction.to {
                Some(spot) => self.spot_of.insert(eviction.evicted, spot),
                None => self.spot_of.remove(&eviction.evicted),
            };
        }
        for selection in &decision.selections {
            self.spot_of.insert(selection.module, selection.spot);
        }
    }

    /// The number of modules that have the same spot in both.
    pub(super) fn in_common_with(&self, other: &Self) -> usize {
        let held = |(module, spot): &(&ModuleId, &SpotId)| other.spot_of.get(module) == Some(spot);
        self.spot_of.iter().filter(held).count()
    }
}
