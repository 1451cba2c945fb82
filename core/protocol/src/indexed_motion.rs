//! How the modules of a plan move, by module: the same for all members, so the agents of a process share it.

use std::collections::BTreeMap;

use formation_model::{ModuleId, ModuleMotion, UnitMotion};
use formation_motion::PlannedMotion;

/// The unit of a module in the paths of a plan, and the module's own path.
pub(super) type PathPlace<'a> = (&'a UnitMotion, &'a ModuleMotion);

/// The motion of a plan with the places of its modules.
#[derive(Clone, Debug)]
pub(super) struct IndexedMotion {
    planned: PlannedMotion,
    /// The position of each unit by its lead.
    units: BTreeMap<ModuleId, usize>,
    /// The position of each module's unit, and its own in that.
    modules: BTreeMap<ModuleId, (usize, usize)>,
}

impl IndexedMotion {
    /// The motion of a plan.
    pub fn of(planned: PlannedMotion) -> Self {
        let units = planned.paths().into_iter().flat_map(|paths| &paths.units);
        let leads = units.clone().enumerate();
        let modules = units.enumerate().flat_map(|(unit, motion)| {
            let members = motion.modules.iter().enumerate();
            members.map(move |(member, module)| (module.module, (unit, member)))
        });
        Self {
            units: leads.map(|(index, unit)| (unit.lead, index)).collect(),
            modules: modules.collect(),
            planned,
        }
    }

    /// The motion without the places.
    pub fn planned(&self) -> &PlannedMotion {
        &self.planned
    }

    /// All units with paths.
    pub fn units(&self) -> &[UnitMotion] {
        self.planned.paths().map_or(&[], |motion| &motion.units)
    }

    /// The unit with this lead.
    pub fn unit(&self, lead: ModuleId) -> Option<&UnitMotion> {
        self.units().get(*self.units.get(&lead)?)
    }

    /// The positions of a module's unit, and of its own path in that.
    pub fn position_of(&self, module: ModuleId) -> Option<(usize, usize)> {
        self.modules.get(&module).copied()
    }

    /// The unit of a module in the paths, and its own path.
    pub fn place_of(&self, module: ModuleId) -> Option<PathPlace<'_>> {
        let (unit, member) = self.position_of(module)?;
        let unit = self.units().get(unit)?;
        Some((unit, unit.modules.get(member)?))
    }

    /// The unit of each module in the paths, and the module's own path.
    pub fn places(&self) -> BTreeMap<ModuleId, PathPlace<'_>> {
        let modules = self.modules.keys();
        modules
            .filter_map(|&module| Some((module, self.place_of(module)?)))
            .collect()
    }
}
