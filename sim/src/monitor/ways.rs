//! Which modules have a way to a target at all: judged on a grid of cells, apart from everything that plans.

use std::collections::BTreeSet;

use formation_model::{MICRO_PER_UNIT, MicroUnits, Pose, Roster, Service, Target};

use super::covering::is_covered;

/// How far around everything ways may lead, in cells.
const MARGIN: i64 = 2;

type Cell = (i64, i64);

/// The number of active members that bodies on these lines, and members on their spots, keep from every spot of a part of
/// the target. Those that hold one are not counted.
pub(super) fn cut_off(
    roster: &Roster,
    target: &Target,
    part: &[Pose],
    lines: &[(Pose, Pose)],
) -> usize {
    let Some(origin) = part.first().filter(|_| !lines.is_empty()) else {
        return 0;
    };
    let nearest = |along: i64| (along + MICRO_PER_UNIT / 2).div_euclid(MICRO_PER_UNIT);
    let cell_of = |pose: &Pose| {
        let (right, up) = (pose.x.0 - origin.x.0, pose.y.0 - origin.y.0);
        (nearest(right), nearest(up))
    };
    let spots: Vec<Cell> = part.iter().map(cell_of).collect();
    let members = roster.members.iter();
    let free =
        members.filter(|member| member.service == Service::Active && member.module.pin.is_none());
    let held = roster.members.iter();
    let held = held.filter(|member| member.module.pin.is_some());
    let held = held.map(|member| (member.module.pose, member.module.pose));
    let lines: Vec<(Pose, Pose)> = lines.iter().copied().chain(held).collect();
    let starts: Vec<Cell> = free.map(|member| cell_of(&member.module.pose)).collect();
    let ends = lines
        .iter()
        .flat_map(|(from, to)| [cell_of(from), cell_of(to)]);
    let all: Vec<Cell> = spots.iter().chain(&starts).copied().chain(ends).collect();
    let range = |along: fn(&Cell) -> i64| {
        let least = all.iter().map(along).min().unwrap_or_default();
        let most = all.iter().map(along).max().unwrap_or_default();
        least - MARGIN..=most + MARGIN
    };
    let (across, along) = (range(|cell| cell.0), range(|cell| cell.1));
    let is_open = |&(right, up): &Cell| {
        let pose = Pose {
            x: MicroUnits(origin.x.0 + right * MICRO_PER_UNIT),
            y: MicroUnits(origin.y.0 + up * MICRO_PER_UNIT),
            theta: MicroUnits::ZERO,
        };
        let is_clear = !is_covered(&pose, &lines, target);
        across.contains(&right) && along.contains(&up) && is_clear
    };
    let around = |(right, up): Cell| {
        [
            (right + 1, up),
            (right, up + 1),
            (right - 1, up),
            (right, up - 1),
        ]
    };
    let mut seen: BTreeSet<Cell> = spots.into_iter().filter(is_open).collect();
    let mut waiting: Vec<Cell> = seen.iter().copied().collect();
    while let Some(cell) = waiting.pop() {
        let next = around(cell).into_iter().filter(is_open);
        let next: Vec<Cell> = next.filter(|cell| seen.insert(*cell)).collect();
        waiting.extend(next);
    }
    starts.len() - starts.iter().filter(|start| seen.contains(*start)).count()
}
