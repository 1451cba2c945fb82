//! Pins: the spots on which modules have settled and which they keep in a new epoch.
//!
//! A pin is released for one of two reasons: two modules name the same spot, or the settled modules wall in a spot that
//! must still be filled ([`formation_planner::plan_releasing_pins`]). The convener decides this: it may release a pin, never
//! invent one.

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_model::{
    Area, PlannerParameters, PlanningModule, PlanningProblem, RosterMember, Service, SpotId, Target,
};

use super::context::Context;
use super::plans::PlanJob;

/// Releases the pins that cannot stay; `members` ascend by module. `None` until the plan that shows which is computed.
/// Enforces P3.
pub(super) fn release(
    members: &mut [RosterMember],
    target: &Arc<Target>,
    parameters: PlannerParameters,
    obstacles: Vec<Area>,
    context: &mut Context,
) -> Option<()> {
    let mut held = BTreeSet::new();
    for member in members.iter_mut() {
        let pin = &mut member.module.pin;
        *pin = pin.filter(|&spot| target.position_of(spot).is_some() && held.insert(spot));
    }
    if held.is_empty() {
        return Some(());
    }
    let active = members
        .iter()
        .filter(|member| member.service == Service::Active)
        .map(|member| member.module.clone())
        .collect();
    let Ok(problem) = PlanningProblem::new(Arc::clone(target), parameters, active) else {
        // There are too many members; each of them refuses the roster.
        return Some(());
    };
    let planned = context.plan(PlanJob::release(
        Arc::new(problem.with_bodies(obstacles.clone())),
        obstacles,
    ))?;
    let kept: BTreeSet<SpotId> = planned
        .turns()
        .problem()
        .modules()
        .iter()
        .filter_map(|module: &PlanningModule| module.pin)
        .collect();
    for member in members {
        let pin = &mut member.module.pin;
        *pin = pin.filter(|spot| kept.contains(spot));
    }
    Some(())
}
