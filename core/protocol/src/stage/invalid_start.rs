//! Starts from which no path without contact begins: their modules leave service, so that the others can move.

use std::collections::BTreeSet;

use formation_model::{Area, BODY_WIDTH, MicroUnits, ModuleId, Roster, Service};
use formation_motion::paths::{MotionError, StartFault};

/// A body of a member out of service that is nearer than this may close the cell of a module.
const NEAR: MicroUnits = MicroUnits(1_500_000);

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

/// The module that stays: of two, the one that has not settled, and otherwise the higher one. `None` where an absent module
/// may be in the way, which says nothing about this one.
fn chosen_of(fault: &StartFault, roster: &Roster) -> Option<ModuleId> {
    match *fault {
        StartFault::NotApart(one, other) | StartFault::SharedCell(one, other) => {
            let is_pinned = |module| {
                let member = roster.member(module);
                member.is_some_and(|member| member.module.pin.is_some())
            };
            match (is_pinned(one), is_pinned(other)) {
                (true, false) => Some(other),
                (false, true) => Some(one),
                _ => Some(one.max(other)),
            }
        }
        StartFault::OffGroup(module, _) => Some(module),
        StartFault::Covered(module) => is_covered(module, roster).then_some(module),
    }
}

/// Whether an obstacle, a wall or the body of a member out of service is in the way of a member.
fn is_covered(module: ModuleId, roster: &Roster) -> bool {
    let Some(own) = roster.member(module) else {
        return false;
    };
    let surroundings = roster.target.target.as_ref().map(|it| it.surroundings());
    let width = surroundings.map_or(BODY_WIDTH, |it| it.body_width());
    let body = Area::of_body(&own.module.pose, width);
    let is_out = surroundings.is_some_and(|it| !it.admits(&body));
    let mut aside = roster
        .members
        .iter()
        .filter(|member| member.service != Service::Active);
    is_out || aside.any(|other| other.module.pose.distance_to(&own.module.pose) < NEAR)
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
