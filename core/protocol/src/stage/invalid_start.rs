//! Members for which there is no path: they leave service, so that the others can move.

use std::cmp::Reverse;
use std::collections::BTreeSet;

use formation_model::{ModuleId, Roster};
use formation_motion::paths::{MotionError, StartFault};

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
    let is_its =
        |fault: &&StartFault| docked_to(chosen_of(fault, roster), roster).contains(&module);
    faults.iter().find(is_its).cloned()
}

/// The module that stays: of two, the one that has not settled, then the one that is docked to fewer others, and otherwise the higher
/// one.
fn chosen_of(fault: &StartFault, roster: &Roster) -> ModuleId {
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
            if rank(one) > rank(other) { one } else { other }
        }
        StartFault::OffGroup(module, _) | StartFault::Covered(module) => module,
    }
}

/// A module and the members that are docked to it, directly or through others, and that have not settled.
fn docked_to(module: ModuleId, roster: &Roster) -> BTreeSet<ModuleId> {
    let is_free = |module: &ModuleId| {
        let member = roster.member(*module);
        member.is_some_and(|member| member.module.pin.is_none())
    };
    let mut docked = BTreeSet::from([module]);
    let mut open = vec![module];
    while let Some(next) = open.pop() {
        let member = roster.member(next).into_iter();
        let links = member.flat_map(|member| &member.module.links);
        let links = links.copied().filter(is_free);
        open.extend(links.filter(|&link| docked.insert(link)));
    }
    docked
}
