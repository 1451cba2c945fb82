//! Judges where modules were, on its own: squares that move on a line from one moment of their module to its next. It uses
//! nothing of the observer, so it cannot share a fault with the planner, the agents or the rest of this crate.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2, TAU};

/// Two bodies are compared at moments between which they come nearer by at most this, in units.
const STRIDE: f64 = 0.02;
/// Bodies that overlap by less touch, in units.
const TOUCH: f64 = 1.0e-6;

/// Where a module was, and when.
#[derive(Clone, Debug, PartialEq)]
pub struct TracePoint {
    /// In seconds.
    pub t: f64,
    /// x and y in units, and the heading in radians.
    pub pose: [f64; 3],
    /// The modules that it was docked to.
    pub links: BTreeSet<u32>,
}

/// The moments of each module, by identifier, in the order of their times.
pub type Trace = BTreeMap<u32, Vec<TracePoint>>;

/// Two bodies at the moment at which they overlap the most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// The two modules, the lower first.
    pub modules: (u32, u32),
    /// When, as in the trace.
    pub t: f64,
    /// How far they would have to be shifted to part, in units.
    pub depth: f64,
}

/// All pairs of modules whose bodies, of this width in units, overlap at any time. Modules that are docked, directly or through
/// others, count as one body: they fold through each other, and start their steps one message after the other.
pub fn overlaps(trace: &Trace, width: f64) -> Vec<Overlap> {
    let modules: Vec<u32> = trace.keys().copied().collect();
    let mut found = Vec::new();
    for (index, &one) in modules.iter().enumerate() {
        for &other in &modules[index + 1..] {
            found.extend(deepest(trace, (one, other), width));
        }
    }
    found
}

/// When `is_wrong` first says so of the corners of a module's body; `None` if never.
pub fn first_where(
    moments: &[TracePoint],
    width: f64,
    is_wrong: impl Fn([(f64, f64); 4]) -> bool,
) -> Option<f64> {
    moments.iter().enumerate().find_map(|(index, moment)| {
        let next = moments.get(index + 1).unwrap_or(moment);
        let [dx, dy] = [0, 1].map(|axis| next.pose[axis] - moment.pose[axis]);
        let parts = parts_of(dx.hypot(dy));
        (0..=parts)
            .map(|part| moment.t + (next.t - moment.t) * f64::from(part) / f64::from(parts))
            .find(|&t| is_wrong(corners(at(moments, t), width)))
    })
}

/// Into how many parts a way is divided, each of at most [`STRIDE`].
fn parts_of(way: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a float is cut at the bounds of the integer"
    )]
    let parts = (way / STRIDE).ceil().clamp(1.0, 1.0e6) as u32;
    parts
}

fn deepest(trace: &Trace, modules: (u32, u32), width: f64) -> Option<Overlap> {
    let (ours, theirs) = (trace.get(&modules.0)?, trace.get(&modules.1)?);
    let mut times: Vec<f64> = ours.iter().chain(theirs).map(|moment| moment.t).collect();
    times.sort_by(f64::total_cmp);
    // Before its first line a module is not known to be anywhere.
    let from = ours.first()?.t.max(theirs.first()?.t);
    times.retain(|&t| t >= from);
    let mut worst: Option<Overlap> = None;
    for pair in times.windows(2) {
        let gap = |t: f64| {
            let (one, other) = (at(ours, t), at(theirs, t));
            (other[0] - one[0], other[1] - one[1], other[2] - one[2])
        };
        let (begin, end) = (gap(pair[0]), gap(pair[1]));
        let nearer = (end.0 - begin.0).hypot(end.1 - begin.1) + (end.2 - begin.2).abs();
        if begin.0.hypot(begin.1) - nearer > width * SQRT_2 {
            continue;
        }
        let parts = parts_of(nearer);
        for part in 0..=parts {
            let t = pair[0] + (pair[1] - pair[0]) * f64::from(part) / f64::from(parts);
            let depth = depth(at(ours, t), at(theirs, t), width);
            let is_worse = worst.is_none_or(|worst| depth > worst.depth);
            if depth > TOUCH && is_worse && !are_docked(trace, modules, t) {
                worst = Some(Overlap { modules, t, depth });
            }
        }
    }
    worst
}

/// The line that holds at a time.
fn line_at(moments: &[TracePoint], t: f64) -> usize {
    moments.partition_point(|moment| moment.t <= t).max(1) - 1
}

fn at(moments: &[TracePoint], t: f64) -> [f64; 3] {
    let index = line_at(moments, t);
    let from = &moments[index];
    let Some(to) = moments.get(index + 1).filter(|to| to.t > from.t) else {
        return from.pose;
    };
    let share = ((t - from.t) / (to.t - from.t)).clamp(0.0, 1.0);
    let turn = (to.pose[2] - from.pose[2] + PI).rem_euclid(TAU) - PI;
    let [dx, dy] = [to.pose[0] - from.pose[0], to.pose[1] - from.pose[1]];
    [
        from.pose[0] + dx * share,
        from.pose[1] + dy * share,
        from.pose[2] + turn * share,
    ]
}

/// The corners of a square body.
fn corners([x, y, heading]: [f64; 3], width: f64) -> [(f64, f64); 4] {
    [0.0, 1.0, 2.0, 3.0].map(|quarter| {
        let (sine, cosine) = (heading + PI / 4.0 + FRAC_PI_2 * quarter).sin_cos();
        (x + width / SQRT_2 * cosine, y + width / SQRT_2 * sine)
    })
}

/// How deep two squares overlap; negative if a line along a side of either parts them.
fn depth(one: [f64; 3], other: [f64; 3], width: f64) -> f64 {
    let (ours, theirs) = (corners(one, width), corners(other, width));
    let headings = [one[2], one[2] + FRAC_PI_2, other[2], other[2] + FRAC_PI_2];
    let depths = headings.map(|heading| {
        let along = |(x, y): (f64, f64)| x * heading.cos() + y * heading.sin();
        let reach = |corners: [(f64, f64); 4]| {
            let along = corners.map(along);
            let low = along.into_iter().fold(f64::INFINITY, f64::min);
            (low, along.into_iter().fold(f64::NEG_INFINITY, f64::max))
        };
        let (ours, theirs) = (reach(ours), reach(theirs));
        (ours.1 - theirs.0).min(theirs.1 - ours.0)
    });
    depths.into_iter().fold(f64::INFINITY, f64::min)
}

/// Whether two modules are docked, directly or through others.
fn are_docked(trace: &Trace, (one, other): (u32, u32), t: f64) -> bool {
    let mut block = BTreeSet::from([one]);
    let mut open = vec![one];
    while let Some(next) = open.pop() {
        let Some(moments) = trace.get(&next) else {
            continue;
        };
        let links = &moments[line_at(moments, t)].links;
        open.extend(links.iter().filter(|&&link| block.insert(link)));
    }
    block.contains(&other)
}
