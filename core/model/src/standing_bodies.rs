//! What bodies cover that take no part in a plan.

use crate::blocked_spots::lists;
use crate::{Area, BODY_WIDTH, MICRO_PER_UNIT, MicroUnits, Pose, Roster, Service, polyline};

/// A longer path of a body stands for the rectangles around its lines: 1,000 units.
const PATH_SAMPLED_MAX: MicroUnits = MicroUnits(1_000 * MICRO_PER_UNIT);

/// When there are as many obstacles, the paths of further bodies do, too.
const AREAS_SAMPLED_MAX: usize = 1 << 17;

/// The bodies that stand in the way: those of the members that take no part in the plan, and those of absent modules.
pub fn standing_bodies(roster: &Roster) -> Vec<Area> {
    let target = roster.target.target.as_ref();
    let width = target.map_or(BODY_WIDTH, |target| target.surroundings().body_width());
    let is_round = target.is_some_and(|target| target.surroundings().body().is_round());
    let standing = |pose: &Pose| match is_round {
        true => Area::of_round_body(pose, width),
        false => vec![Area::of_body(pose, width)],
    };
    let members = roster.members.iter();
    let aside = members.filter(|member| member.service != Service::Active);
    let aside = aside.map(|member| member.module.pose);
    let bodies = roster.bodies.iter();
    let absent = bodies.filter(|body| !lists(&roster.members, body.module));
    let spacing = MicroUnits(MICRO_PER_UNIT / 2);
    let mut areas: Vec<Area> = aside.flat_map(|pose| standing(&pose)).collect();
    for body in absent {
        let path = body.whereabouts.poses();
        if let [pose] = path {
            areas.extend(standing(pose));
            continue;
        }
        // What a report says cannot make a plan take more memory than there is.
        let is_sampled =
            polyline::length(path) <= PATH_SAMPLED_MAX && areas.len() < AREAS_SAMPLED_MAX;
        let lines = polyline::lines(path);
        if is_sampled {
            areas.extend(lines.flat_map(|ends| Area::along_line(ends, width, spacing)));
        } else {
            areas.extend(lines.map(|ends| Area::around_line(ends, width)));
        }
    }
    areas
}
