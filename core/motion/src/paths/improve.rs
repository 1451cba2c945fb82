//! Improvement: each unit's path is planned again from its start, with all others fixed.

use super::schedule::{Schedule, Stop};
use super::sipp::Query;

/// Plans each path again in the order of filling, at most `passes` times, until nothing gets better.
pub(super) fn improve(schedule: &mut Schedule, filling: &[usize], passes: u32) -> Result<(), Stop> {
    let surplus = (0..schedule.units.len())
        .filter(|&unit| schedule.units[unit].goal.is_none() && !schedule.units[unit].pinned);
    let sequence: Vec<usize> = filling.iter().copied().chain(surplus).collect();
    for _ in 0..passes {
        let mut is_better = false;
        for &unit in &sequence {
            is_better |= improve_one(schedule, unit)?;
        }
        if !is_better {
            break;
        }
    }
    Ok(())
}

fn improve_one(schedule: &mut Schedule, unit: usize) -> Result<bool, Stop> {
    let (arrival, goal) = (schedule.since(unit), schedule.place(unit));
    let body = &schedule.units[unit];
    let shortest = body.distance(schedule.arena, body.start, goal);
    if schedule.paths[unit].len() == shortest as usize && arrival <= body.ready + shortest {
        return Ok(false);
    }
    let query = Query {
        unit,
        from: body.start,
        since: body.ready,
        goal,
        known: Some((
            arrival,
            u32::try_from(schedule.paths[unit].len()).unwrap_or(u32::MAX),
        )),
        exit_from: schedule.exit_from(unit),
    };
    let old = schedule.take_out(unit);
    let new = schedule
        .sipp
        .path(schedule.arena, schedule.units, &schedule.table, &query);
    let is_better = new.is_some();
    schedule.put_in(unit, new.unwrap_or(old));
    schedule.check_budget()?;
    Ok(is_better)
}
