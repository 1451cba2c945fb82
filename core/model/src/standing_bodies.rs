//! What bodies cover that take no part in a plan.

use crate::blocked_spots::{body_areas, lists, makes_room};
use crate::body_form::BodyForm;
use crate::{Area, BodyReport, Roster, RosterMember, Service};

/// The bodies that stand in the way: those of the members that take no part in the plan and do not make way, and those of absent
/// modules.
pub fn standing_bodies(roster: &Roster) -> Vec<Area> {
    standing_by(roster, &roster.bodies)
}

/// The same if these were the bodies of modules that are not members.
pub(crate) fn standing_by(roster: &Roster, bodies: &[BodyReport]) -> Vec<Area> {
    let target = roster.target.target.as_deref();
    let form = BodyForm::of(target);
    let members = roster.members.iter();
    let makes_way = |member: &RosterMember| target.is_some_and(|target| makes_room(target, member));
    let aside = members.filter(|member| member.service != Service::Active && !makes_way(member));
    let aside = aside.map(|member| member.module.pose);
    let absent = bodies.iter();
    let absent = absent.filter(|body| !lists(&roster.members, body.module));
    let mut areas: Vec<Area> = aside.flat_map(|pose| form.areas(&[pose], 0, &[])).collect();
    for body in absent {
        let more = body_areas(form, body, areas.len(), &roster.members);
        areas.extend(more);
    }
    areas
}
