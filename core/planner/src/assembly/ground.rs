//! The filled spots of a plan, and the units that fill them.

use formation_model::{ActingUnit, MicroUnits, ModuleId, Plan, PlanningProblem, Topology};

/// The spots to fill with their holders and units; spots are positions in the problem's target.
pub(super) struct Ground<'a> {
    pub(super) topology: &'a Topology,
    pub(super) values: &'a [MicroUnits],
    /// The module that fills each spot.
    holders: Vec<Option<ModuleId>>,
    /// The unit of each filled spot.
    pub(super) unit_of: Vec<Option<usize>>,
    /// The spots of each unit, ascending.
    pub(super) units: Vec<Vec<usize>>,
    /// Whether the holder of each spot stands on it already.
    pub(super) pinned: Vec<bool>,
}

/// The spots that are vacated last when the formation is taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Root {
    /// In each component, the spot of greatest value.
    Centre,
    /// Any spot.
    Free,
}

impl<'a> Ground<'a> {
    pub(super) fn new(problem: &'a PlanningProblem, plan: &Plan, values: &'a [MicroUnits]) -> Self {
        let target = problem.target();
        let count = target.spots().len();
        let mut ground = Self {
            topology: target.topology(),
            values,
            holders: vec![None; count],
            unit_of: vec![None; count],
            units: Vec::new(),
            pinned: vec![false; count],
        };
        for (&module, &id) in &plan.assignments {
            if let Some(spot) = target.position_of(id) {
                let pin = problem.module(module).and_then(|module| module.pin);
                ground.holders[spot] = Some(module);
                ground.pinned[spot] = pin == Some(id);
            }
        }
        let spot_of = |module: &ModuleId| target.position_of(*plan.assignments.get(module)?);
        for block in &plan.blocks {
            let mut spots: Vec<usize> = block.iter().filter_map(spot_of).collect();
            spots.sort_unstable();
            ground.add_unit(spots);
        }
        for spot in 0..count {
            if ground.holders[spot].is_some() && ground.unit_of[spot].is_none() {
                ground.add_unit(vec![spot]);
            }
        }
        ground
    }

    fn add_unit(&mut self, spots: Vec<usize>) {
        for &spot in &spots {
            self.unit_of[spot] = Some(self.units.len());
        }
        self.units.push(spots);
    }

    pub(super) fn is_filled(&self, spot: usize) -> bool {
        self.unit_of[spot].is_some()
    }

    /// The filled neighbours of a spot, ascending.
    pub(super) fn neighbours(&self, spot: usize) -> impl Iterator<Item = usize> + '_ {
        let neighbours = self.topology.neighbours(spot).iter().copied();
        neighbours.filter(|&neighbour| self.is_filled(neighbour))
    }

    /// The spots of a sequence that are filled while no adjacent spot is, without the first one and pinned ones.
    pub(super) fn restarts_along(&self, sequence: &[usize]) -> Vec<usize> {
        let mut placed = vec![false; self.unit_of.len()];
        let mut restarts = Vec::new();
        for (index, &spot) in sequence.iter().enumerate() {
            let has_neighbour = self.neighbours(spot).any(|neighbour| placed[neighbour]);
            if index > 0 && !self.pinned[spot] && !has_neighbour {
                restarts.push(spot);
            }
            placed[spot] = true;
        }
        restarts
    }

    /// The units in the order of a sequence of spots, in which the spots of a unit follow one another.
    pub(super) fn units_along(
        &self,
        problem: &PlanningProblem,
        sequence: &[usize],
    ) -> Vec<ActingUnit> {
        let mut units: Vec<ActingUnit> = Vec::with_capacity(self.units.len());
        let mut current = None;
        for &spot in sequence {
            let Some(holder) = self.holders[spot] else {
                continue;
            };
            let placement = (holder, problem.target().spots()[spot].id);
            match units.last_mut() {
                Some(unit) if current == self.unit_of[spot] => {
                    unit.lead = unit.lead.min(holder);
                    unit.placements.push(placement);
                }
                _ => units.push(ActingUnit {
                    lead: holder,
                    placements: vec![placement],
                    pinned: self.pinned[spot],
                }),
            }
            current = self.unit_of[spot];
        }
        units
    }
}
