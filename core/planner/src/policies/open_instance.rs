//! What a policy decides on: the modules that need a spot, and the spots that are free.

use crate::assignment::{Instance, SpotTable};
use formation_model::{MicroUnits, PlanningModule, PlanningProblem, Spot, Target};

/// The modules that need a spot and the spots that are free, both ascending. Pinned modules, modules that walls cut off, and
/// spots that stay empty are not among them.
#[derive(Debug)]
pub struct OpenInstance<'a> {
    instance: &'a Instance,
    positions: Vec<usize>,
    spot_positions: Vec<usize>,
    modules: Vec<&'a PlanningModule>,
    spots: Vec<Spot>,
}

impl<'a> OpenInstance<'a> {
    pub(super) fn new(instance: &'a Instance, table: &SpotTable) -> Self {
        let problem = &instance.problem;
        let is_open =
            |&module: &usize| table.spot_of(module).is_none() && !problem.is_cut_off(module);
        let positions: Vec<usize> = (0..instance.module_count()).filter(is_open).collect();
        let spot_positions: Vec<usize> = table.free_spots().collect();
        let modules = positions
            .iter()
            .map(|&position| &problem.modules()[position]);
        let spots = spot_positions
            .iter()
            .map(|&position| instance.target.spots()[position]);
        Self {
            modules: modules.collect(),
            spots: spots.collect(),
            instance,
            positions,
            spot_positions,
        }
    }

    /// The modules to place, with their links and poses.
    #[must_use]
    pub fn modules(&self) -> &[&'a PlanningModule] {
        &self.modules
    }

    /// The free spots.
    #[must_use]
    pub fn spots(&self) -> &[Spot] {
        &self.spots
    }

    /// Each module with each spot.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let spots = 0..self.spots.len();
        (0..self.modules.len())
            .flat_map(move |module| spots.clone().map(move |spot| (module, spot)))
    }

    /// The length of a module's way to a spot, past walls.
    #[must_use]
    pub fn way(&self, module: usize, spot: usize) -> MicroUnits {
        let (module, spot) = (self.positions[module], self.spot_positions[spot]);
        let utilities = &self.instance.utilities;
        utilities.distance(module, spot) + utilities.detour(module, spot)
    }

    /// The utility of a spot for a module: its value less the cost of the way and of all links.
    #[must_use]
    pub fn utility(&self, module: usize, spot: usize) -> MicroUnits {
        let utilities = &self.instance.utilities;
        utilities.of(self.positions[module], self.spot_positions[spot])
    }

    /// The utility of each spot for each module, a row a module, in millionths.
    #[must_use]
    pub fn utilities(&self) -> Vec<Vec<i64>> {
        let row = |module| {
            let spots = 0..self.spots.len();
            spots.map(|spot| self.utility(module, spot).0).collect()
        };
        (0..self.modules.len()).map(row).collect()
    }

    /// The target that is formed: the problem's own without the spots that were trimmed.
    #[must_use]
    pub fn target(&self) -> &Target {
        &self.instance.target
    }

    /// The whole problem, with the modules that have their spots.
    #[must_use]
    pub fn problem(&self) -> &PlanningProblem {
        &self.instance.problem
    }

    pub(super) fn module_position(&self, module: usize) -> usize {
        self.positions[module]
    }

    pub(super) fn spot_position(&self, spot: usize) -> Option<usize> {
        self.spot_positions.get(spot).copied()
    }
}
