//! No two bodies on one spot, over the whole run and whatever plans there were: judged from where the robots are, and of which
//! of them the members of a plan had received a state.
//!
//! A robot is where its drive is, or where its crashed process left it, until it is taken away. Drives pass through each
//! other, and robots start anywhere; so a robot is not judged while it moves, where it was halted or failed on its way, or
//! while it has a spot of its own to go to in the same plan. Nor is one judged that was on its spot before the plan: another
//! may have ended in passing it.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::{
    ModuleId, ModulePhase, ModuleState, MotionMode, Pose, Roster, Service, SpotId, Target,
    Whereabouts,
};

use super::contact::nearest;
use super::{Monitor, ViolationKind, member};
use crate::cluster::Cluster;

/// A body of any width stands on a spot if it is nearer to it than half the pitch of the lattice.
const HALF_WIDTH_UNITS: f64 = 0.5;

/// Poses are whole millionths of a unit.
const ROUNDING_UNITS: f64 = 1e-6;

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
        let Some((announcement, target)) =
            announcement.and_then(|announced| Some((announced, announced.target.as_ref()?)))
        else {
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
        blocks_all(target, announcement.parameters.motion, failed.chain(absent))
    }

    /// The spot on which a module has just settled.
    fn place_of(&self, state: &ModuleState) -> Option<(SpotId, Pose)> {
        let roster = self.rosters.get(&state.epoch?)?;
        let spot = state.spot.filter(|_| state.phase == ModulePhase::Settled)?;
        let target = roster.roster.target.target.as_ref()?;
        Some((spot, target.spot(spot)?.pose))
    }
}

/// Whether bodies there block every spot of a target for modules that move in this way.
pub fn blocks_all(
    target: &Target,
    motion: MotionMode,
    bodies: impl Iterator<Item = Whereabouts>,
) -> bool {
    let lines: Vec<(Pose, Pose)> = bodies.flat_map(|body| lines_of(&body)).collect();
    let mut spots = target.spots().iter();
    spots.all(|spot| is_covered(&spot.pose, &lines, motion, target))
}

/// The greatest number of connected spots that the active members of a roster can fill: without those that the bodies cover
/// which it lists, and those of members that cannot move. Pinned members stay, so with pins, spots connected to theirs count.
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
        let motion = roster.target.parameters.motion;
        held.contains(&spot.id) || !is_covered(&spot.pose, &lines, motion, target)
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
            most = most.max(part.len().min(active));
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

/// Whether bodies on these lines keep all others off a spot.
fn is_covered(spot: &Pose, lines: &[(Pose, Pose)], motion: MotionMode, target: &Target) -> bool {
    let width = target.surroundings().body_width().to_units();
    let along_paths = motion == MotionMode::Paths;
    lines.iter().any(|(from, to)| {
        is_near_line(spot, from, to) || along_paths && reaches_into_cell(spot, (from, to), width)
    })
}

/// Whether a square body of this width that goes from one pose to another comes into the cell of a spot, whose sides are one unit.
fn reaches_into_cell(spot: &Pose, (from, to): (&Pose, &Pose), width: f64) -> bool {
    let reach = |pose: &Pose| {
        let heading = pose.theta.to_units();
        (heading.cos().abs() + heading.sin().abs()) * width / 2.0
    };
    // The part of the line on which body and cell overlap along both axes.
    let limit = HALF_WIDTH_UNITS + reach(from).max(reach(to)) - ROUNDING_UNITS;
    let ((x, y), (from_x, from_y), (to_x, to_y)) = (units(spot), units(from), units(to));
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for (begin, end) in [(from_x - x, to_x - x), (from_y - y, to_y - y)] {
        let way = end - begin;
        if way.abs() <= ROUNDING_UNITS {
            if begin.abs() >= limit {
                return false;
            }
            continue;
        }
        let (one, other) = ((-limit - begin) / way, (limit - begin) / way);
        first = first.max(one.min(other));
        last = last.min(one.max(other));
    }
    first <= last
}

fn units(pose: &Pose) -> (f64, f64) {
    (pose.x.to_units(), pose.y.to_units())
}

fn is_on(body: &Pose, spot: &Pose) -> bool {
    is_near_line(spot, body, body)
}

/// Whether a point is nearer than half a module to the line between two others.
fn is_near_line(point: &Pose, from: &Pose, to: &Pose) -> bool {
    let ((x, y), (from_x, from_y), (to_x, to_y)) = (units(point), units(from), units(to));
    nearest((from_x - x, from_y - y), (to_x - x, to_y - y)) < HALF_WIDTH_UNITS
}
