//! Plans of which it is decided elsewhere who takes which spot.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use thiserror::Error;

use super::planning::Planning;
use crate::assignment::Holder;
use crate::baseline::CentralAssignment;
use crate::placement::SearchBudget;
use formation_model::{ModuleId, PlanningProblem, SpotId};

/// Why an allocation is none for a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum AllocationRefused {
    /// It names a module that does not take part.
    #[error("there is no {0}")]
    UnknownModule(ModuleId),
    /// It names a spot that the target does not have.
    #[error("{0} is to take {1}, which the target does not have")]
    UnknownSpot(ModuleId, SpotId),
    /// It gives a spot to two modules.
    #[error("{0} and {1} are both to take {2}")]
    SharedSpot(ModuleId, ModuleId, SpotId),
    /// It gives a spot to a module that walls cut off.
    #[error("{0} is to take {1}, and no way leads to the target from it")]
    CutOff(ModuleId, SpotId),
    /// It does not leave a pinned module where it is.
    #[error("{0} has settled on {1}, and is to stay there")]
    PinLost(ModuleId, SpotId),
}

impl Planning {
    /// Starts to plan by an allocation, in place of the one that the problem's policy, which assigns centrally, would make: each module
    /// claims its spot in its turn, and docked modules come apart.
    ///
    /// # Errors
    /// Names the module or spot that is wrong. Whether enough spots are filled, and connected, is for the checks of the plan.
    pub fn with_allocation(
        problem: Arc<PlanningProblem>,
        allocation: &BTreeMap<ModuleId, SpotId>,
    ) -> Result<Self, AllocationRefused> {
        check(&problem, allocation)?;
        let (target, order) = (Arc::clone(problem.target()), problem.parameters().order);
        let mut planning = Self::for_target(problem, target, order, &[], SearchBudget::of_plan());
        let (instance, table) = (&planning.instance, &planning.allocation.table);
        let is_open = |position: usize, spot: usize| {
            table.spot_of(position).is_none() && table.holder(spot) == Holder::Free
        };
        let modules = instance.problem.modules().iter().enumerate();
        let spot_of = modules.map(|(position, module)| {
            let spot = instance.target.position_of(*allocation.get(&module.id)?)?;
            is_open(position, spot).then_some(spot)
        });
        planning.central = Some(CentralAssignment {
            spot_of: spot_of.collect(),
            auction: None,
        });
        Ok(planning)
    }
}

fn check(
    problem: &PlanningProblem,
    allocation: &BTreeMap<ModuleId, SpotId>,
) -> Result<(), AllocationRefused> {
    let mut holders: BTreeMap<SpotId, ModuleId> = BTreeMap::new();
    for (&module, &spot) in allocation {
        let Some(position) = problem.position_of(module) else {
            return Err(AllocationRefused::UnknownModule(module));
        };
        if problem.target().position_of(spot).is_none() {
            return Err(AllocationRefused::UnknownSpot(module, spot));
        }
        if problem.is_cut_off(position) {
            return Err(AllocationRefused::CutOff(module, spot));
        }
        if let Some(other) = holders.insert(spot, module) {
            return Err(AllocationRefused::SharedSpot(other, module, spot));
        }
    }
    let pins: BTreeSet<(ModuleId, SpotId)> = problem
        .modules()
        .iter()
        .filter_map(|module| Some((module.id, module.pin?)))
        .collect();
    let lost = pins
        .into_iter()
        .find(|(module, pin)| allocation.get(module) != Some(pin));
    match lost {
        Some((module, pin)) => Err(AllocationRefused::PinLost(module, pin)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::Scenario;

    const SCENARIO: &str =
        "{target: {map: 'o-o-o'}, modules: {map: 'A-A   s'}, planner: {policy: hungarian}}";

    fn planned(pairs: &[(u32, u32)]) -> Result<Vec<(u32, u32)>, AllocationRefused> {
        let problem = Scenario::from_yaml(SCENARIO).unwrap().problem().clone();
        let pairs = pairs.iter();
        let allocation = pairs.map(|&(module, spot)| (ModuleId(module), SpotId(spot)));
        let mut planning = Planning::with_allocation(Arc::new(problem), &allocation.collect())?;
        let decisions = planning.take_all_turns();
        let plan = planning.outcome(decisions).plan;
        let pairs = plan.assignments.iter();
        Ok(pairs.map(|(module, spot)| (module.0, spot.0)).collect())
    }

    #[test]
    fn modules_take_the_spots_of_an_allocation() {
        for spots in [[1, 2, 3], [3, 1, 2], [2, 3, 1]] {
            let pairs: Vec<(u32, u32)> = (1..).zip(spots).collect();
            assert_eq!(planned(&pairs).unwrap(), pairs);
        }
    }

    #[test]
    fn an_allocation_that_is_none_is_refused_by_name() {
        for (pairs, expected) in [
            (vec![(4, 1)], "there is no module 4"),
            (
                vec![(1, 9)],
                "module 1 is to take spot 9, which the target does not have",
            ),
            (
                vec![(1, 2), (3, 2)],
                "module 1 and module 3 are both to take spot 2",
            ),
        ] {
            assert_eq!(planned(&pairs).unwrap_err().to_string(), expected);
        }
    }
}
