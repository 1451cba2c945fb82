//! Who holds which spot, followed from decision to decision.

use std::collections::BTreeMap;

use formation::model::{Decision, ModuleId, SpotId};

/// The spot-selector pairs, as anybody who hears all claims knows them.
#[derive(Default)]
pub(super) struct SpotTable {
    pub spot_of: BTreeMap<ModuleId, SpotId>,
}

impl SpotTable {
    pub(super) fn apply(&mut self, decision: &Decision) {
        // Selections list the spots that change hands. A module that a later chain of the same decision sends back to
        // where it was is not among them, so evictions are followed as well.
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

    /// How many modules have the same spot in both.
    pub(super) fn in_common_with(&self, other: &Self) -> usize {
        let held = |(module, spot): &(&ModuleId, &SpotId)| other.spot_of.get(module) == Some(spot);
        self.spot_of.iter().filter(held).count()
    }
}
