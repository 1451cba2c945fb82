//! Starts from which no path without contact begins: their modules leave service, so that the others can move.

use std::cmp::Reverse;
use std::collections::BTreeSet;

use formation_model::{MICRO_PER_UNIT, MicroUnits, ModuleId, Pose, Roster};
use formation_motion::paths::{MotionError, StartFault};

/// A body that is nearer than this to a module may be in its way onto the lattice.
const NEAR: MicroUnits = MicroUnits(2 * MICRO_PER_UNIT);

/// Why this member has to stay where it is, if it has to. All members find the same.
/// Enforces X13.
pub(super) fn fault_of(
    module: ModuleId,
    error: &MotionError,
    roster: &Roster,
) -> Option<StartFault> {
    let MotionError::Starts(faults) = error else {
        return None;
    };
    let is_its = |fault: &&StartFault| {
        let chosen = chosen_of(fault, roster);
        chosen.is_some_and(|chosen| docked_to(chosen, roster).contains(&module))
    };
    faults.iter().find(is_its).cloned()
}

/// The module that stays: of two, the one that has not settled, then the one that is docked to fewer others, and otherwise the higher
/// one. `None` where an absent module may be in the way, which says nothing about this one.
fn chosen_of(fault: &StartFault, roster: &Roster) -> Option<ModuleId> {
    match *fault {
        StartFault::NotApart(one, other) | StartFault::SharedCell(one, other) => {
            let is_pinned = |module| {
                let member = roster.member(module);
                member.is_some_and(|member| member.module.pin.is_some())
            };
            let rank = |module| {
                let docked = docked_to(module, roster).len();
                (!is_pinned(module), Reverse(docked), module)
            };
            [one, other].into_iter().max_by_key(|&module| rank(module))
        }
        StartFault::OffGroup(module, _) => Some(module),
        StartFault::Covered(module) => is_covered(module, roster).then_some(module),
    }
}

/// Whether what is in the way of a member stays there: no absent module, which may return or be taken away, is as near to it or to
/// those that are docked to it as they reach when they turn onto the lattice.
fn is_covered(module: ModuleId, roster: &Roster) -> bool {
    let group = docked_to(module, roster);
    let members = group.iter().filter_map(|&member| roster.member(member));
    let poses: Vec<Pose> = members.map(|member| member.module.pose).collect();
    let spread = poses
        .iter()
        .flat_map(|one| poses.iter().map(|other| one.distance_to(other)));
    let reach = MicroUnits(spread.max().unwrap_or_default().0 + NEAR.0);
    let is_listed = |module| roster.member(module).is_some();
    let absent = roster.bodies.iter().filter(|body| !is_listed(body.module));
    let mut places = absent.flat_map(|body| body.whereabouts.poses());
    !places.any(|place| poses.iter().any(|pose| pose.distance_to(place) < reach))
}

/// A module and the members that are docked to it, directly or through others.
fn docked_to(module: ModuleId, roster: &Roster) -> BTreeSet<ModuleId> {
    let mut docked = BTreeSet::from([module]);
    let mut open = vec![module];
    while let Some(next) = open.pop() {
        let member = roster.member(next).into_iter();
        let links = member.flat_map(|member| &member.module.links);
        open.extend(links.copied().filter(|&link| docked.insert(link)));
    }
    docked
}
