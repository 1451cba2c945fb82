//! Pins: the spots on which modules have settled and which they keep in a new epoch.
//!
//! A pin is released for one of two reasons: two modules name the same spot, or the settled modules wall in a spot that
//! must still be filled. In the second case the pins farthest from the target's centre are released first, until the planner
//! finds an order in which every spot can be reached. The convener decides this: it may release a pin, never invent one.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::model::{
    AssemblyWarning, PlannerParameters, PlanningProblem, RosterMember, Service, SpotId, Target,
};
use crate::planner;

/// Releases the pins that cannot stay; `members` ascend by module.
pub(super) fn release(
    members: &mut [RosterMember],
    target: &Arc<Target>,
    parameters: PlannerParameters,
) {
    let mut held = BTreeSet::new();
    for member in members.iter_mut() {
        let stays = member
            .module
            .pin
            .is_none_or(|spot| target.position_of(spot).is_some() && held.insert(spot));
        if !stays {
            member.module.pin = None;
        }
    }
    let outermost_first = outermost_first(&held, target);
    let walls_in = |released: usize| {
        let released = &outermost_first[..released];
        let modules = members
            .iter()
            .filter(|member| member.service == Service::Active)
            .map(|member| {
                let mut module = member.module.clone();
                module.pin = module.pin.filter(|spot| !released.contains(spot));
                module
            });
        PlanningProblem::new(Arc::clone(target), parameters, modules.collect()).is_ok_and(has_walls)
    };
    let all = outermost_first.len();
    // If spots are walled in even without pins, moving settled modules does not help.
    if all == 0 || !walls_in(0) || walls_in(all) {
        return;
    }
    // The smallest number that is enough, by bisection: each try makes a plan.
    let (mut too_few, mut enough) = (0, all);
    while too_few + 1 < enough {
        let middle = too_few.midpoint(enough);
        if walls_in(middle) {
            too_few = middle;
        } else {
            enough = middle;
        }
    }
    for member in members {
        member.module.pin = member
            .module
            .pin
            .filter(|spot| !outermost_first[..enough].contains(spot));
    }
}

fn outermost_first(held: &BTreeSet<SpotId>, target: &Target) -> Vec<SpotId> {
    let centre = target.centre();
    let mut spots: Vec<_> = held
        .iter()
        .filter_map(|&id| Some((target.spot(id)?.pose.distance_to(&centre), id)))
        .collect();
    spots.sort_unstable();
    spots.into_iter().rev().map(|(_, id)| id).collect()
}

fn has_walls(problem: PlanningProblem) -> bool {
    let plan = planner::plan(Arc::new(problem)).plan;
    let mut warnings = plan.assembly.warnings.iter();
    warnings.any(|warning| matches!(warning, AssemblyWarning::WalledIn(_)))
}
