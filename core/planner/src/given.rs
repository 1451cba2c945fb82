//! Allocations that were computed elsewhere: by a program, in Python, by hand.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::turns::{PlanOutcome, plan};
use formation_model::{
    ModuleId, PlanningProblem, RawGiven, RawGivenSpot, ScenarioError, SpotId, kept_groups,
    largest_group,
};

/// The plan of an allocation: the problem under the policy `given`, with the modules detached that [`detached_by`] names.
///
/// # Errors
/// Names the entry that repeats a module or a spot or names none, or the module or spot with which the allocation cannot be
/// carried out.
pub fn plan_with_allocation(
    problem: &PlanningProblem,
    allocation: &[(ModuleId, SpotId)],
) -> Result<PlanOutcome, ScenarioError> {
    let given = given_by(problem, allocation);
    Ok(plan(Arc::new(problem.with_given(&given)?)))
}

/// An allocation as it can be announced, with the modules that it detaches.
#[must_use]
pub fn given_by(problem: &PlanningProblem, allocation: &[(ModuleId, SpotId)]) -> RawGiven {
    let entries = allocation.iter().map(|&(module, spot)| RawGivenSpot {
        module: module.0,
        spot: spot.0,
    });
    let detached = detached_by(problem, allocation).into_iter();
    RawGiven {
        allocation: entries.collect(),
        detached: detached.map(|module| module.0).collect(),
    }
}

/// The modules that leave their configuration by an allocation, ascending: all but the largest group that stays docked along
/// its links, the lowest of equals. A group of one is none.
#[must_use]
pub fn detached_by(problem: &PlanningProblem, allocation: &[(ModuleId, SpotId)]) -> Vec<ModuleId> {
    let target = problem.target();
    let spot_of: BTreeMap<ModuleId, SpotId> = allocation.iter().copied().collect();
    let all_links = problem.links();
    let mut detached = Vec::new();
    for configuration in problem.configurations() {
        let members = configuration.modules;
        let positions: Vec<usize> = members
            .iter()
            .filter_map(|&member| problem.position_of(member))
            .collect();
        let links = all_links.induced_by(&positions);
        let spot = |node: usize| target.position_of(*spot_of.get(&members[node])?);
        let staying = largest_group(kept_groups(&links, target.topology(), spot));
        let stays = |node: &usize| staying.len() > 1 && staying.contains(node);
        let leaving = (0..members.len()).filter(|node| !stays(node));
        detached.extend(leaving.map(|node| members[node]));
    }
    detached.sort_unstable();
    detached
}
