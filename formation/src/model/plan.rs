//! A finished plan: who takes which spot, and in which order the units move.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::model::{ModuleId, SpotId};

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
    /// The module that names the unit: the lowest of its modules.
    pub lead: ModuleId,
    /// Its modules and their spots, in the order in which the spots are listed in the assembly order.
    pub placements: Vec<(ModuleId, SpotId)>,
    /// Whether it stands on its spots already.
    pub pinned: bool,
}

/// Something about the acting order that people should know before anything moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum AssemblyWarning {
    /// In the breadth-first order that is used, this spot has no free corridor from outside when its turn comes.
    /// No order would do, unless [`Self::BudgetSpent`] stands beside this.
    #[error("{0} is walled in when its turn comes; its module needs help to get there")]
    WalledIn(SpotId),
    /// The spots do not lie on a unit lattice, so corridors were not checked.
    #[error(
        "the spots do not lie on a unit lattice with edges of one unit, so no corridor was checked"
    )]
    OffLattice,
    /// The search for an order with corridors was cut at its budget; one may exist.
    #[error("the search for an order that leaves every spot a corridor was cut at its budget")]
    BudgetSpent,
    /// The filled spots are disconnected, so the order begins anew at this one, beside no placed spot.
    #[error("the filled spots are disconnected: {0} is filled beside no placed spot")]
    Disconnected(SpotId),
}

/// In which order the units take their spots.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Assembly {
    /// The units, pinned ones first; each but the first has a spot beside one that is placed before it, unless a
    /// warning says otherwise.
    pub units: Vec<ActingUnit>,
    /// What is wrong with the order, if anything.
    pub warnings: Vec<AssemblyWarning>,
}

impl Assembly {
    /// The spots in the order in which they are filled.
    pub fn spots(&self) -> impl Iterator<Item = SpotId> + '_ {
        self.units
            .iter()
            .flat_map(|unit| unit.placements.iter().map(|&(_, spot)| spot))
    }
}

/// The outcome of all turns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Which spot each placed module takes.
    pub assignments: BTreeMap<ModuleId, SpotId>,
    /// The groups of two or more modules that stay docked on their way, each ascending.
    pub blocks: Vec<Vec<ModuleId>>,
    /// The links that are kept: both ends in one block, on adjacent spots; lower module first.
    pub kept_links: BTreeSet<(ModuleId, ModuleId)>,
    /// In which order the units move.
    pub assembly: Assembly,
}
