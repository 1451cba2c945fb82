//! No two bodies on one spot, over the whole run and whatever plans there were: judged from where the robots are, and of which
//! of them the members of a plan had received a state.
//!
//! A robot is where its drive is, or where its crashed process left it, until it is taken away. A robot is not judged while
//! it moves, where it was halted or failed on its way, or while it has a spot of its own to go to in the same plan. Nor is one judged
//! that was on its spot before the plan: hands may have put another there.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::{
    ModuleId, ModulePhase, ModuleState, Pose, Roster, Service, SpotId, Target, Whereabouts,
};

use super::covering::{is_covered, is_on};
use super::ways::cut_off;
use super::{Monitor, ViolationKind, member};
use crate::cluster::Cluster;

impl Monitor {
    /// A module settles, or stands by without a spot: no other one stands on the same spot.
    pub(super) fn check_bodies(&mut self, at: Duration, state: &ModuleState, cluster: &Cluster) {
        let module = state.module;
        if cluster.is_moving(module) {
            return;
        }
        let place = self.place_of(state);
        if let Some((spot, pose)) = place {
            let others = cluster.modules().into_iter();
            let roster = state.epoch.and_then(|epoch| self.rosters.get(&epoch));
            let own = roster.and_then(|known| member(&known.roster, module));
            if own.is_some_and(|own| own.module.pin == Some(spot)) {
                return;
            }
            let is_seen = |other| roster.is_some_and(|roster| roster.seen.contains(&other));
            let seen = others.filter(|&other| other != module && is_seen(other));
            let on_it: Vec<ModuleId> = seen
                .filter(|&other| !cluster.is_moving(other) && !self.has_yet_to_go(other, state))
                .filter(|&other| cluster.body(other).is_some_and(|body| is_on(&body, &pose)))
                .collect();
            for other in on_it {
                let detail = format!("{module} settles on {spot}, where {other} stands");
                self.violate(at, ViolationKind::TwoBodiesOnOneSpot, detail);
            }
        } else if state.phase == ModulePhase::Spare
            && state.service != Service::MotionFailed
            && self.takes_part(state)
            && state.digest.is_some()
            && let Some(body) = cluster.body(module)
        {
            let settled = self.settled_on.iter();
            // Modules that a blocked spot separates from the plan stand by as well, where they settled before.
            let is_of_plan = |other: ModuleId| {
                self.state(cluster, other).is_some_and(|other| {
                    other.phase == ModulePhase::Settled && other.epoch == state.epoch
                })
            };
            let taken = settled.filter(|(run, _)| run.module != module && is_of_plan(run.module));
            let taken = taken.filter_map(|(run, (spot, roster))| {
                let pose = roster.target.target.as_ref()?.spot(*spot)?.pose;
                let holds = cluster
                    .body(run.module)
                    .is_some_and(|body| is_on(&body, &pose));
                (holds && is_on(&body, &pose)).then_some((run.module, *spot))
            });
            for (other, spot) in taken.collect::<Vec<_>>() {
                let detail = format!("{module} stands by on {spot}, where {other} stands");
                self.violate(at, ViolationKind::TwoBodiesOnOneSpot, detail);
            }
        }
    }

    /// Whether a module has another spot in the same plan as this state, to which it goes later, or would have gone: when its
    /// process ends, another member may have set off already.
    fn has_yet_to_go(&self, module: ModuleId, state: &ModuleState) -> bool {
        let plan = state.epoch.zip(state.digest);
        let spot = plan.and_then(|plan| self.assigned.get(&(plan, module)));
        spot.is_some_and(|&spot| Some(spot) != state.spot)
    }

    /// Whether the bodies that the modules of a group report block every spot of the target: of the latest one, or for modules that
    /// are cut off from its publisher, of the latest that reached any of them.
    pub(super) fn all_is_blocked(&self, cluster: &Cluster, group: &BTreeSet<ModuleId>) -> bool {
        let received = group.iter();
        let received = received.filter_map(|&module| cluster.received_announcement(module));
        let parts = cluster.parts();
        let is_reachable = parts.first().is_some_and(|part| group.is_subset(part));
        let announcement = if is_reachable {
            cluster.announcement().map(|announcement| &**announcement)
        } else {
            received.max_by_key(|announcement| announcement.revision)
        };
        let Some(target) = announcement.and_then(|announced| announced.target.as_ref()) else {
            return false;
        };
        let states = group
            .iter()
            .filter_map(|&module| self.state(cluster, module));
        let bodies = states.clone().flat_map(|state| &state.bodies);
        let absent = bodies.filter(|body| !group.contains(&body.module));
        let failed = states.filter(|state| state.service == Service::MotionFailed);
        let failed = failed.map(|state| Whereabouts::Halted(state.pose));
        let absent = absent.map(|body| body.whereabouts.clone());
        blocks_all(target, failed.chain(absent))
    }

    /// Whether the plan of a module lets it move: none that was out of service for want of a path takes part before the next.
    fn takes_part(&self, state: &ModuleState) -> bool {
        let roster = state.epoch.and_then(|epoch| self.rosters.get(&epoch));
        let listed = roster.and_then(|known| member(&known.roster, state.module));
        listed.is_none_or(|member| member.service != Service::MotionFailed)
    }

    /// The spot on which a module has just settled.
    fn place_of(&self, state: &ModuleState) -> Option<(SpotId, Pose)> {
        let roster = self.rosters.get(&state.epoch?)?;
        let spot = state.spot.filter(|_| state.phase == ModulePhase::Settled)?;
        let target = roster.roster.target.target.as_ref()?;
        Some((spot, target.spot(spot)?.pose))
    }
}

/// Whether bodies there block every spot of a target.
pub fn blocks_all(target: &Target, bodies: impl Iterator<Item = Whereabouts>) -> bool {
    let lines: Vec<(Pose, Pose)> = bodies.flat_map(|body| lines_of(&body)).collect();
    let mut spots = target.spots().iter();
    spots.all(|spot| is_covered(&spot.pose, &lines, target))
}

/// The number of connected spots that the active members of a roster can surely fill: without those that the bodies may cover which
/// it lists, and those of members that cannot move, and by those alone that have a way. Of a body that is turned against the axes,
/// the box around it counts. Pinned members stay, so with pins, spots connected to theirs count.
#[must_use]
pub fn room(roster: &Roster, target: &Target, active: usize) -> usize {
    let failed = roster
        .members
        .iter()
        .filter(|member| member.service == Service::MotionFailed)
        .map(|member| (member.module.pose, member.module.pose));
    let absent = roster.bodies.iter();
    let absent = absent.filter(|body| member(roster, body.module).is_none());
    let absent = absent.flat_map(|body| lines_of(&body.whereabouts));
    let lines: Vec<(Pose, Pose)> = failed.chain(absent).collect();
    let held: Vec<SpotId> = roster
        .members
        .iter()
        .filter(|member| member.service == Service::Active)
        .filter_map(|member| member.module.pin)
        .collect();
    let is_open = |position: usize| {
        let spot = target.spots()[position];
        held.contains(&spot.id) || !is_covered(&spot.pose, &lines, target)
    };
    let mut left: Vec<usize> = (0..target.spots().len())
        .filter(|&one| is_open(one))
        .collect();
    let mut most = 0;
    while let Some(first) = left.pop() {
        let mut part = vec![first];
        let mut next = 0;
        while let Some(&spot) = part.get(next) {
            let neighbours = target.topology().neighbours(spot);
            let (reached, others) = left.into_iter().partition(|one| neighbours.contains(one));
            left = others;
            part.extend::<Vec<usize>>(reached);
            next += 1;
        }
        let is_held = |&position: &usize| held.contains(&target.spots()[position].id);
        if held.is_empty() || part.iter().any(is_held) {
            let part: Vec<Pose> = part
                .iter()
                .map(|&position| target.spots()[position].pose)
                .collect();
            let cut_off = cut_off(roster, target, &part, &lines);
            most = most.max(part.len().min(active.saturating_sub(cut_off)));
        }
    }
    most
}

/// The lines on which a body may stand.
fn lines_of(whereabouts: &Whereabouts) -> Vec<(Pose, Pose)> {
    let poses = whereabouts.poses();
    match poses {
        [pose] => vec![(*pose, *pose)],
        _ => poses.windows(2).map(|pair| (pair[0], pair[1])).collect(),
    }
}
