//! Pins: the spots on which modules have settled and which they keep in a new epoch.
//!
//! A pin is released for one of two reasons: two modules name the same spot, or the settled modules wall in a spot that
//! must still be filled ([`formation_planner::plan_releasing_pins`]). The convener decides this: it may release a pin, never
//! invent one.

use std::collections::BTreeSet;

use formation_model::{PlanningModule, Roster, SpotId, Target};

use super::context::Context;
use super::plans::PlanJob;

/// Releases the pins of a roster that cannot stay, where bodies leave a part of its target open. `None` until the plan that shows
/// which is computed.
/// Enforces P3.
pub(super) fn release(roster: &mut Roster, open: &Target, context: &mut Context) -> Option<()> {
    let mut held = BTreeSet::new();
    for member in &mut roster.members {
        let pin = &mut member.module.pin;
        *pin = pin.filter(|&spot| open.position_of(spot).is_some() && held.insert(spot));
    }
    if held.is_empty() {
        return Some(());
    }
    let Ok(Some(problem)) = roster.problem() else {
        // Each member refuses the roster, or the convener does.
        return Some(());
    };
    let planned = context.plan(PlanJob::release(problem))?;
    let kept: BTreeSet<SpotId> = planned
        .turns()
        .problem()
        .modules()
        .iter()
        .filter_map(|module: &PlanningModule| module.pin)
        .collect();
    for member in &mut roster.members {
        let pin = &mut member.module.pin;
        *pin = pin.filter(|spot| kept.contains(spot));
    }
    Some(())
}
