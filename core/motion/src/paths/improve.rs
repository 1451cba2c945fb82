//! Improvement: each unit's path is planned again from its start, with all others fixed.

use super::field::{Field, Stop};
use super::sipp::Query;

/// Plans each path again in the order of filling, at most `passes` times, until nothing gets better.
pub(super) fn improve(field: &mut Field, filling: &[usize], passes: u32) -> Result<(), Stop> {
    let surplus = (0..field.units.len())
        .filter(|&unit| field.units[unit].goal.is_none() && !field.units[unit].pinned);
    let sequence: Vec<usize> = filling.iter().copied().chain(surplus).collect();
    for _ in 0..passes {
        let mut is_better = false;
        for &unit in &sequence {
            is_better |= improve_one(field, unit)?;
        }
        if !is_better {
            break;
        }
    }
    Ok(())
}

fn improve_one(field: &mut Field, unit: usize) -> Result<bool, Stop> {
    let (arrival, goal) = (field.since(unit), field.place(unit));
    let body = &field.units[unit];
    let shortest = body.distance(field.arena, body.start, goal);
    if field.paths[unit].len() == shortest as usize && arrival <= body.ready + shortest {
        return Ok(false);
    }
    let query = Query {
        unit,
        from: body.start,
        since: body.ready,
        goal,
        latest: arrival,
    };
    let old = field.take_out(unit);
    let found = field
        .sipp
        .path(field.arena, field.units, &field.table, &query);
    let new = found.filter(|path| {
        let end = path.last().map_or(query.since, |entry| entry.begin + 1);
        (end, path.len()) < (arrival, old.len())
    });
    let is_better = new.is_some();
    field.put_in(unit, new.unwrap_or(old));
    field.check_budget()?;
    Ok(is_better)
}
