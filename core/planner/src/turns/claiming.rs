//! The turn of a unit whose spots were allocated before the first turn.

use super::turn_order::Unit;
use super::turn_result::TurnResult;
use crate::assignment::{Holder, Instance};
use crate::policies::WholeAllocation;

/// Gives a unit the spots that were allocated to it.
///
/// Of a configuration, the largest group that stays docked takes its spots. The other modules leave it and take turns of their
/// own, as with the policy `exact`.
pub(super) fn claim(
    instance: &Instance,
    whole: &WholeAllocation,
    unit: &Unit,
    result: &mut TurnResult,
) {
    let table = &mut result.allocation.table;
    if !unit.is_block() {
        if let Some(spot) = whole.spot_of[unit.leader] {
            table.give(spot, Holder::Singleton(unit.leader));
        }
        if !whole.keeps_links {
            result.detached.extend(instance.linked(vec![unit.leader]));
        }
        return;
    }
    let staying = whole.staying(instance, &unit.members);
    if staying.len() < 2 {
        let members = unit.members.iter();
        result.remainder = members.map(|&member| vec![member]).collect();
        result.detached.clone_from(&unit.members);
        return;
    }
    for &member in &staying {
        if let Some(spot) = whole.spot_of[member] {
            table.give(spot, Holder::Fixed(member));
        }
    }
    let links = instance.links.induced_by(&unit.members);
    let leaves = |node: usize| staying.binary_search(&unit.members[node]).is_err();
    let of_nodes = |nodes: Vec<usize>| nodes.into_iter().map(|node| unit.members[node]).collect();
    let components = links.components_within(leaves).into_iter();
    result.remainder = components.map(of_nodes).collect();
    result.detached = result.remainder.concat();
    result.blocks.push(staying);
}
