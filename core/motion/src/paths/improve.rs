//! Improvement: each unit's path is planned again from its start, with all others fixed.

use super::field::{Field, Stop};
use super::lattice::{FOREVER, Time};
use super::order::Order;
use super::sipp::Query;

/// Plans each path again in the order of docking, at most `passes` times, until nothing gets better.
pub(super) fn improve(field: &mut Field, order: &Order, passes: u32) -> Result<(), Stop> {
    let mut children = vec![Vec::new(); field.units.len()];
    for (unit, parent) in order.parents.iter().enumerate() {
        if let Some(parent) = *parent {
            children[parent].push(unit);
        }
    }
    let surplus = (0..field.units.len()).filter(|&unit| field.units[unit].goal.is_none());
    let sequence: Vec<usize> = order.sequence.iter().copied().chain(surplus).collect();
    for _ in 0..passes {
        let mut is_better = false;
        for &unit in &sequence {
            if !field.units[unit].pinned {
                is_better |= improve_one(field, order, &children, unit)?;
            }
        }
        if !is_better {
            break;
        }
    }
    Ok(())
}

fn improve_one(
    field: &mut Field,
    order: &Order,
    children: &[Vec<usize>],
    unit: usize,
) -> Result<bool, Stop> {
    let parent = order.parents[unit].and_then(|parent| field.docked[parent]);
    let parent = parent.unwrap_or_default();
    let has_spot = field.units[unit].goal.is_some();
    let (arrival, goal) = (field.since(unit), field.place(unit));
    let shortest = field.units[unit].distance(field.arena, field.units[unit].start, goal);
    let earliest = (field.units[unit].ready + shortest).max(parent + 1);
    let is_best = field.paths[unit].len() == shortest as usize && arrival <= earliest;
    let mut is_better = false;
    if !is_best {
        let query = Query {
            unit,
            from: field.units[unit].start,
            since: field.units[unit].ready,
            goal,
            dock_after: parent,
            latest: arrival.min(latest_docking(field, children, unit)),
        };
        let old = field.take_out(unit);
        let found = field
            .sipp
            .path(field.arena, field.units, &field.table, &query);
        let new = found.filter(|path| {
            let end = path.last().map_or(query.since, |entry| entry.begin + 1);
            (end, path.len()) < (arrival, old.len())
        });
        is_better = new.is_some();
        field.put_in(unit, new.unwrap_or(old));
        field.check_budget()?;
    }
    if has_spot {
        field.docked[unit] = Some(field.since(unit).max(parent));
    }
    Ok(is_better)
}

/// The last steps of the children begin after their parent has docked; those of children that stood on their places
/// earlier, and their children's, come after both.
fn latest_docking(field: &Field, children: &[Vec<usize>], unit: usize) -> Time {
    let mut latest = FOREVER - 1;
    let docked = field.docked[unit].unwrap_or_default();
    let mut waiting = children[unit].clone();
    while let Some(child) = waiting.pop() {
        match field.paths[child].last() {
            Some(last) if last.begin >= docked => latest = latest.min(last.begin),
            _ => waiting.extend(&children[child]),
        }
    }
    latest
}
