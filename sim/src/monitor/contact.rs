//! Whether bodies meet while modules move along paths: judged from where the drives are, at every moment.
//!
//! A body is a square or a circle of the width that the target states, 0.9 units by default, around its module. Between two reports
//! of its drive a module moves evenly, so two round bodies, and two whose sides lie along the axes, are compared exactly over the
//! whole time. Where one of two squares is turned, they are compared at 17 moments between two reports, from one to the next of
//! which a body moves by less than its clearance. Modules that are docked to each other, directly or through others, are one body.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use formation_model::{Area, MicroUnits, ModuleId, Pose, Surroundings};

use super::{Monitor, ViolationKind};
use crate::cluster::Cluster;

/// A body is turned if its heading is further than this from a quarter turn, in radians.
const TURNED: f64 = 0.01;
/// Drives report more often than this while they move.
const REMEMBERED: Duration = Duration::from_secs(1);
/// Into how many parts a leg is divided if a body is turned.
const MOMENTS: u32 = 16;
/// Clocks and poses are exact to a few millionths.
const SLACK: f64 = 0.001;

/// A module's movement between two reports of its drive.
#[derive(Clone, Copy, Debug)]
struct Leg {
    begin: Duration,
    end: Duration,
    from: Pose,
    to: Pose,
}

/// A place and a heading.
type Placed = ((f64, f64), f64);

/// Where one module was lately.
struct Track {
    since: Duration,
    pose: Pose,
    legs: VecDeque<Leg>,
    /// The modules that were docked to it at its last report, directly or through others.
    docked: BTreeSet<ModuleId>,
}

/// Where all modules were lately.
#[derive(Default)]
pub(super) struct ContactWatch {
    tracks: BTreeMap<ModuleId, Track>,
    /// The pairs that were found to overlap, which are reported once; a module and itself for an obstacle.
    found: BTreeSet<(ModuleId, ModuleId)>,
    /// The pairs that a hand made meet, that met as parts of one body, or of which one did not know of the other, until they part.
    excused: BTreeSet<(ModuleId, ModuleId)>,
}

impl Monitor {
    /// A drive reports: compares the way of its module since the last report with the bodies of all others.
    pub(super) fn follow_body(
        &mut self,
        at: Duration,
        module: ModuleId,
        pose: Pose,
        cluster: &Cluster,
    ) {
        let docked = docked_to(module, cluster);
        let tracks = &mut self.bodies.tracks;
        let track = tracks.entry(module).or_insert_with(|| Track {
            since: at,
            pose,
            legs: VecDeque::new(),
            docked: docked.clone(),
        });
        let leg = Leg {
            begin: track.since,
            end: at,
            from: track.pose,
            to: pose,
        };
        if leg.from != leg.to && leg.begin + REMEMBERED < leg.end {
            // Its process restarted and placed it there.
            (track.since, track.pose, track.docked) = (at, pose, docked);
            track.legs.clear();
            return;
        }
        let mut exempt = std::mem::replace(&mut track.docked, docked.clone());
        exempt.extend(docked);
        (track.since, track.pose) = (at, pose);
        track.legs.push_back(leg);
        while track
            .legs
            .front()
            .is_some_and(|leg| leg.end + REMEMBERED < at)
        {
            track.legs.pop_front();
        }
        if leg.from != leg.to && leg.begin < leg.end {
            self.compare(module, leg, &exempt, cluster);
        }
    }

    /// Compares a leg with all bodies, if it is part of a path. It counts against the members of its plan, those that its roster lists,
    /// and those of which a member had received a state.
    fn compare(
        &mut self,
        module: ModuleId,
        leg: Leg,
        exempt: &BTreeSet<ModuleId>,
        cluster: &Cluster,
    ) {
        let Some(plan) = cluster.last_plan_in_motion(module) else {
            return;
        };
        let Some(known) = self.rosters.get(&plan.0) else {
            return;
        };
        let target = known.roster.target.target.as_ref();
        let plain = Surroundings::default();
        let body = Body::of(target.map_or(&plain, |target| target.surroundings()));
        let mut found = Vec::new();
        let listed = known.roster.bodies.iter().map(|body| body.module);
        let known = known.members.iter().chain(&known.seen).copied();
        let known: BTreeSet<ModuleId> = known.chain(listed).collect();
        for other in cluster.modules() {
            let pair = (module.min(other), module.max(other));
            if other == module || self.bodies.found.contains(&pair) {
                continue;
            }
            let Some(stands) = cluster.body(other) else {
                continue;
            };
            let track = self.bodies.tracks.get(&other);
            let is_excused = !known.contains(&other)
                || exempt.contains(&other)
                || track.is_some_and(|track| track.docked.contains(&module));
            let meets = match track {
                None => meet(&leg, &Leg::at_rest(Duration::ZERO, leg.end, stands), body),
                Some(track) => {
                    let rest = Leg::at_rest(track.since, leg.end, track.pose);
                    let rest = Some(rest).filter(|_| !cluster.is_moving(other));
                    track
                        .legs
                        .iter()
                        .chain(&rest)
                        .any(|other| meet(&leg, other, body))
                }
            };
            if meets && is_excused {
                self.bodies.excused.insert(pair);
            } else if meets {
                found.push(pair);
            } else {
                self.bodies.excused.remove(&pair);
            }
        }
        if let Some(target) = target
            && leaves_the_field(&leg, target.surroundings())
            && self.bodies.found.insert((module, module))
        {
            let detail = format!("{module} meets an obstacle or a wall in {}", plan.0);
            self.violate(leg.end, ViolationKind::BodiesOverlap, detail);
        }
        for pair in found {
            if self.hands.made_contact(pair, leg.end) {
                self.bodies.excused.insert(pair);
            }
            if self.bodies.excused.contains(&pair) {
                continue;
            }
            self.bodies.found.insert(pair);
            let detail = format!("{} and {} in {}", pair.0, pair.1, plan.0);
            self.violate(leg.end, ViolationKind::BodiesOverlap, detail);
        }
    }
}

/// The modules that are docked to a module, directly or through others.
fn docked_to(module: ModuleId, cluster: &Cluster) -> BTreeSet<ModuleId> {
    let mut docked = BTreeSet::new();
    let mut open = vec![module];
    while let Some(next) = open.pop() {
        let links = cluster.links(next).into_iter().flatten();
        open.extend(links.copied().filter(|&link| docked.insert(link)));
    }
    docked
}

impl ContactWatch {
    /// A hand has put a module here.
    pub fn put(&mut self, at: Duration, module: ModuleId, pose: Pose, cluster: &Cluster) {
        let track = Track {
            since: at,
            pose,
            legs: VecDeque::new(),
            docked: docked_to(module, cluster),
        };
        self.tracks.insert(module, track);
    }
}

impl Leg {
    fn at_rest(begin: Duration, end: Duration, pose: Pose) -> Self {
        Self {
            begin,
            end,
            from: pose,
            to: pose,
        }
    }

    /// Where its module is at a time, and its heading.
    fn pose(&self, at: Duration) -> Placed {
        let coordinates = |pose: &Pose| {
            let (x, y) = (pose.x.to_units(), pose.y.to_units());
            (x, y, pose.theta.to_units())
        };
        let (from, to) = (coordinates(&self.from), coordinates(&self.to));
        let length = (self.end - self.begin).as_secs_f64();
        if self.from == self.to || length <= 0.0 {
            return ((to.0, to.1), to.2);
        }
        let share = (at - self.begin).as_secs_f64() / length;
        let between = |from: f64, to: f64| from + (to - from) * share;
        let turn = (to.2 - from.2 + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU)
            - std::f64::consts::PI;
        let place = (between(from.0, to.0), between(from.1, to.1));
        (place, from.2 + turn * share)
    }

    /// Whether its sides lie along the axes all the time.
    fn is_straight(&self) -> bool {
        let quarters = self.to.theta.to_units() / std::f64::consts::FRAC_PI_2;
        let off = (quarters - quarters.round()).abs() * std::f64::consts::FRAC_PI_2;
        off < TURNED && self.from.heading_difference(&self.to).to_units() < TURNED
    }
}

/// What a module looks like from above.
#[derive(Clone, Copy, Debug)]
struct Body {
    width: f64,
    is_round: bool,
}

impl Body {
    fn of(surroundings: &Surroundings) -> Self {
        Self {
            width: surroundings.body_width().to_units(),
            is_round: surroundings.body().is_round(),
        }
    }
}

/// Whether two bodies overlap at any moment that both legs have in common.
fn meet(one: &Leg, other: &Leg, Body { width, is_round }: Body) -> bool {
    let (begin, end) = (one.begin.max(other.begin), one.end.min(other.end));
    if begin >= end {
        return false;
    }
    let gap = |at: Duration| {
        let (first, second) = (one.pose(at).0, other.pose(at).0);
        (first.0 - second.0, first.1 - second.1)
    };
    let (before, after) = (gap(begin), gap(end));
    if is_round {
        return nearest(before, after) < width - SLACK;
    }
    if nearest(before, after) > width * std::f64::consts::SQRT_2 {
        return false;
    }
    if one.is_straight() && other.is_straight() {
        let across = within(before.0, after.0, width);
        let along = within(before.1, after.1, width);
        return matches!((across, along), (Some(x), Some(y)) if x.0.max(y.0) < x.1.min(y.1));
    }
    (0..=MOMENTS).any(|moment| {
        let at = begin + (end - begin) * moment / MOMENTS;
        squares_overlap(one.pose(at), other.pose(at), width)
    })
}

/// Whether the box around a body touches an obstacle or a wall at any of some moments of a leg.
fn leaves_the_field(leg: &Leg, surroundings: &Surroundings) -> bool {
    if surroundings.is_open() {
        return false;
    }
    let Body { width, is_round } = Body::of(surroundings);
    (0..=MOMENTS).any(|moment| {
        let ((x, y), heading) = leg.pose(leg.begin + (leg.end - leg.begin) * moment / MOMENTS);
        let turned = heading.cos().abs() + heading.sin().abs();
        let reach = width / 2.0 * if is_round { 1.0 } else { turned } - SLACK;
        let (left, right, bottom, top) = (x - reach, x + reach, y - reach, y + reach);
        let ends = |area: &Area| {
            let ((from_x, from_y), (to_x, to_y)) = (area.low, area.high);
            [from_x, from_y, to_x, to_y].map(MicroUnits::to_units)
        };
        let meets = surroundings.obstacles().iter().any(|area| {
            let [from_x, from_y, to_x, to_y] = ends(area);
            let off = (x - x.clamp(from_x, to_x)).hypot(y - y.clamp(from_y, to_y));
            left < to_x
                && from_x < right
                && bottom < to_y
                && from_y < top
                && !(is_round && off >= reach)
        });
        let is_out = surroundings.arena().is_some_and(|area| {
            let [from_x, from_y, to_x, to_y] = ends(&area);
            left < from_x || bottom < from_y || right > to_x || top > to_y
        });
        meets || is_out
    })
}

/// Whether two squares overlap: no side of either separates them.
fn squares_overlap(one: Placed, other: Placed, width: f64) -> bool {
    let (right, up) = (other.0.0 - one.0.0, other.0.1 - one.0.1);
    let reach = |turn: f64| width / 2.0 * (turn.cos().abs() + turn.sin().abs());
    let apart = width / 2.0 + reach(one.1 - other.1) - SLACK;
    [one.1, other.1].into_iter().all(|heading| {
        let (sine, cosine) = heading.sin_cos();
        let (along, across) = (right * cosine + up * sine, up * cosine - right * sine);
        along.abs() < apart && across.abs() < apart
    })
}

/// For which shares of the time a number that goes evenly from `before` to `after` is within a body's width of zero.
fn within(before: f64, after: f64, width: f64) -> Option<(f64, f64)> {
    let width = width - SLACK;
    if (after - before).abs() < 1.0e-12 {
        return (before.abs() < width).then_some((0.0, 1.0));
    }
    let share = |value: f64| (value - before) / (after - before);
    let (one, other) = (share(-width), share(width));
    let (from, until) = (one.min(other).max(0.0), one.max(other).min(1.0));
    (from < until).then_some((from, until))
}

/// The least distance from zero to a point that moves evenly.
pub(super) fn nearest(before: (f64, f64), after: (f64, f64)) -> f64 {
    let way = (after.0 - before.0, after.1 - before.1);
    let length = way.0 * way.0 + way.1 * way.1;
    let share = if length > 0.0 {
        (-(before.0 * way.0 + before.1 * way.1) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (before.0 + way.0 * share).hypot(before.1 + way.1 * share)
}

#[cfg(test)]
mod tests {
    use formation_model::{RawArea, RawSurroundings};

    use super::*;

    fn leg(from: (f64, f64, f64), to: (f64, f64, f64)) -> Leg {
        let pose = |(x, y, theta)| Pose::from_units(x, y, theta).unwrap();
        Leg {
            begin: Duration::ZERO,
            end: Duration::from_secs(1),
            from: pose(from),
            to: pose(to),
        }
    }

    fn square(width: f64) -> Body {
        Body {
            width,
            is_round: false,
        }
    }

    fn meet(one: &Leg, other: &Leg) -> bool {
        super::meet(one, other, square(0.9))
    }

    #[test]
    fn round_bodies_pass_each_other_at_their_corners() {
        let round = Body {
            width: 0.9,
            is_round: true,
        };
        let right = leg((0.0, 0.0, 0.0), (4.0, 0.0, 0.0));
        let above = leg((2.0, 0.91, 0.3), (2.0, 0.91, 0.3));
        assert!(meet(&right, &above) && !super::meet(&right, &above, round));
        assert!(super::meet(
            &right,
            &leg((2.0, 0.89, 0.0), (2.0, 0.89, 0.0)),
            round
        ));
        let askew = leg((0.5, -0.7, 0.0), (0.5, -0.7, 0.0));
        let stands = leg((0.0, 0.0, 0.0), (0.0, 0.0, 0.0));
        assert!(super::meet(&stands, &askew, round));
        let further = leg((0.64, -0.64, 0.0), (0.64, -0.64, 0.0));
        assert!(meet(&stands, &further) && !super::meet(&stands, &further, round));
    }

    #[test]
    fn bodies_meet_between_reports() {
        let right = leg((0.0, 0.0, 0.0), (4.0, 0.0, 0.0));
        assert!(meet(&right, &leg((2.0, 0.5, 0.0), (2.0, 0.5, 0.0))));
        assert!(!meet(&right, &leg((2.0, 1.0, 0.0), (2.0, 1.0, 0.0))));
        assert!(meet(&right, &leg((4.0, 0.5, 0.0), (0.0, 0.5, 0.0))));
        assert!(!meet(&right, &leg((1.0, 0.0, 0.0), (5.0, 0.0, 0.0))));
        let ahead = leg((0.8, 0.0, 0.0), (4.8, 0.0, 0.0));
        assert!(meet(&right, &ahead));
        assert!(!super::meet(&right, &ahead, square(0.7)), "narrower bodies");
    }

    #[test]
    fn obstacles_and_walls_are_met_between_reports() {
        let boxed = |x, y, width, height| RawArea {
            x,
            y,
            width,
            height,
        };
        let surroundings = Surroundings::try_from(RawSurroundings {
            body: formation_model::BodyShape::Square,
            body_width: None,
            obstacles: vec![boxed(2.0, 1.0, 1.0, 1.0)],
            arena: Some(boxed(2.0, 0.0, 6.0, 4.0)),
        })
        .unwrap();
        let leaves = |from, to| leaves_the_field(&leg(from, to), &surroundings);
        assert!(!leaves((0.0, 0.0, 0.0), (4.0, 0.0, 0.0)));
        assert!(leaves((0.0, 0.1, 0.0), (4.0, 0.1, 0.0)), "the obstacle");
        assert!(!leaves((0.0, -1.5, 0.0), (4.0, -1.5, 0.0)));
        assert!(leaves((0.0, -1.5, 0.0), (4.6, -1.5, 0.0)), "a wall");
        assert!(leaves((0.0, -1.5, 0.5), (0.0, -1.5, 0.5)), "a corner");
    }

    #[test]
    fn turned_bodies_meet_with_their_corners() {
        let eighth = std::f64::consts::FRAC_PI_4;
        let right = leg((0.0, 0.0, 0.0), (4.0, 0.0, 0.0));
        // The corner reaches 0.636 units down.
        assert!(meet(&right, &leg((2.0, 1.05, eighth), (2.0, 1.05, eighth))));
        assert!(!meet(&right, &leg((2.0, 1.1, eighth), (2.0, 1.1, eighth))));
        assert!(meet(
            &right,
            &leg((2.0, 1.05, 0.0), (2.0, 1.05, 2.0 * eighth))
        ));
        let askew = leg((0.0, 0.0, eighth), (4.0, 0.0, eighth));
        assert!(meet(&askew, &leg((2.0, 1.2, eighth), (2.0, 1.2, eighth))));
        assert!(!meet(&askew, &leg((2.0, 1.3, eighth), (2.0, 1.3, eighth))));
    }
}
