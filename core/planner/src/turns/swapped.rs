//! Which modules swapped their spots after the claims, and what that gave up.

use serde::Serialize;

use formation_model::{MicroUnits, ModuleId, SpotId};

/// A module whose spot changed after the claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct SwappedModule {
    /// The module.
    pub module: ModuleId,
    /// The spot that it was claimed.
    pub claimed: Option<SpotId>,
    /// The spot that it has.
    pub spot: Option<SpotId>,
}

/// The swap after the claims, and what it gave up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Swapped {
    /// The modules whose spots changed, ascending.
    pub modules: Vec<SwappedModule>,
    /// By how much the total utility fell.
    pub utility: MicroUnits,
    /// By how much the total distance rose.
    pub distance: MicroUnits,
    /// The longest distance before the swap.
    pub claimed_longest: MicroUnits,
}

impl Swapped {
    /// The change of a module's spot.
    #[must_use]
    pub fn of(&self, module: ModuleId) -> Option<SwappedModule> {
        let mut modules = self.modules.iter().copied();
        modules.find(|one| one.module == module)
    }
}
