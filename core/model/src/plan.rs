//! A finished plan: the spot of each module, and the order in which the units move.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{ModuleId, SpotId, SpotSelection};

/// One module and the spot that it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Assignment {
    /// The module.
    pub module: ModuleId,
    /// Its spot.
    pub spot: SpotId,
}

/// One unit of the acting phase: a block that moves together, or a single module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ActingUnit {
    /// The lowest of its modules, which names the unit.
    pub lead: ModuleId,
    /// Its modules and their spots, in the order in which the spots are filled.
    pub placements: Vec<(ModuleId, SpotId)>,
    /// Whether its modules stand on their spots already.
    pub pinned: bool,
}

/// A flaw of the acting order that people should know before anything moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum AssemblyWarning {
    /// The order is breadth-first, and this spot has no free corridor from outside when its turn comes. No order has
    /// corridors for all spots, unless [`Self::BudgetSpent`] is listed as well.
    #[error("{0} is walled in when its turn comes; its module cannot get there without help")]
    WalledIn(SpotId),
    /// The spots do not lie on a unit lattice, so corridors were not checked.
    #[error(
        "the spots do not lie on a unit lattice with edges of one unit, so no corridor was checked"
    )]
    OffLattice,
    /// The search for an order with corridors ended at its budget; one may exist.
    #[error("the search for an order that leaves every spot a corridor ended at its budget")]
    BudgetSpent,
    /// The filled spots are disconnected, and this one is filled while no adjacent spot is.
    #[error("the filled spots are disconnected: {0} is filled while no adjacent spot is")]
    Disconnected(SpotId),
}

/// The order in which the units take their spots.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Assembly {
    /// The units, pinned ones first. Each but the first has a spot adjacent to one that is filled before it, unless a
    /// warning says otherwise.
    pub units: Vec<ActingUnit>,
    /// The flaws of the order.
    pub warnings: Vec<AssemblyWarning>,
}

impl Assembly {
    /// The modules and their spots, in the order in which the spots are filled.
    pub fn placements(&self) -> impl Iterator<Item = (ModuleId, SpotId)> + '_ {
        let units = self.units.iter();
        units.flat_map(|unit| unit.placements.iter().copied())
    }

    /// The spots in the order in which they are filled.
    pub fn spots(&self) -> impl Iterator<Item = SpotId> + '_ {
        self.placements().map(|(_, spot)| spot)
    }

    /// The acting unit of each placed module.
    #[must_use]
    pub fn unit_of_each(&self) -> BTreeMap<ModuleId, &ActingUnit> {
        let units = self.units.iter();
        units
            .flat_map(|unit| {
                unit.placements
                    .iter()
                    .map(move |&(module, _)| (module, unit))
            })
            .collect()
    }
}

/// The outcome of all turns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// The spot of each placed module.
    pub assignments: BTreeMap<ModuleId, SpotId>,
    /// The groups of two or more modules that stay docked while they move, each ascending.
    pub blocks: Vec<Vec<ModuleId>>,
    /// The kept links, whose ends are in one block, or both pinned, and on adjacent spots; lower module first.
    pub kept_links: BTreeSet<(ModuleId, ModuleId)>,
    /// The order in which the units move.
    pub assembly: Assembly,
    /// The new holders of the spots that change hands after the claims, ascending by spot; empty unless nothing could carry
    /// out the claims.
    pub swaps: Vec<SpotSelection>,
}
