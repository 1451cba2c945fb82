//! What bodies cover that take no part in a plan.

use crate::blocked_spots::lists;
use crate::body_form::BodyForm;
use crate::{Area, Roster, Service};

/// The bodies that stand in the way: those of the members that take no part in the plan, and those of absent modules.
pub fn standing_bodies(roster: &Roster) -> Vec<Area> {
    let form = BodyForm::of(roster.target.target.as_deref());
    let members = roster.members.iter();
    let aside = members.filter(|member| member.service != Service::Active);
    let aside = aside.map(|member| member.module.pose);
    let bodies = roster.bodies.iter();
    let absent = bodies.filter(|body| !lists(&roster.members, body.module));
    let mut areas: Vec<Area> = aside.flat_map(|pose| form.areas(&[pose], 0)).collect();
    for body in absent {
        let more = form.areas(body.whereabouts.poses(), areas.len());
        areas.extend(more);
    }
    areas
}
