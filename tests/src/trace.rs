//! Judges a trace on its own: squares that move straight on from one line of their module to its next. It uses none of
//! our code, so it cannot share a fault with the planner, the agents or the verifier.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2, TAU};

use serde_json::Value;

/// The side of a body, in units.
const WIDTH: f64 = 0.9;
/// Bodies are compared at moments between which they come nearer by at most this, in units.
const STRIDE: f64 = 0.02;

/// Two bodies at the moment at which they overlap the most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// The two modules, the lower first.
    pub modules: (u64, u64),
    /// When, as in the trace.
    pub t: f64,
    /// How far they would have to be shifted to part, in units.
    pub depth: f64,
}

/// One line of a module.
struct Moment {
    t: f64,
    /// x, y and heading.
    pose: [f64; 3],
    links: BTreeSet<u64>,
}

type Trace = BTreeMap<u64, Vec<Moment>>;

/// All pairs of modules whose bodies overlap at any time. Modules that are docked, directly or through others, count as one
/// body: they fold through each other, and start their steps one message after the other.
///
/// # Panics
/// When a line is no state of a module.
#[must_use]
pub fn overlaps(trace: &str) -> Vec<Overlap> {
    let trace = read(trace);
    let modules: Vec<u64> = trace.keys().copied().collect();
    let mut found = Vec::new();
    for (index, &one) in modules.iter().enumerate() {
        for &other in &modules[index + 1..] {
            found.extend(deepest(&trace, one, other));
        }
    }
    found
}

fn read(trace: &str) -> Trace {
    let mut modules = Trace::new();
    for line in trace.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        let number = |key: &str| line[key].as_f64().unwrap();
        let links = line["links"].as_array().unwrap().iter();
        let moment = Moment {
            t: number("t"),
            pose: ["x", "y", "theta"].map(number),
            links: links.map(|link| link.as_u64().unwrap()).collect(),
        };
        let module = line["module"].as_u64().unwrap();
        modules.entry(module).or_default().push(moment);
    }
    modules
}

fn deepest(trace: &Trace, one: u64, other: u64) -> Option<Overlap> {
    let (ours, theirs) = (&trace[&one], &trace[&other]);
    let mut times: Vec<f64> = ours.iter().chain(theirs).map(|moment| moment.t).collect();
    times.sort_by(f64::total_cmp);
    // Before its first line a module is not known to be anywhere.
    let from = ours[0].t.max(theirs[0].t);
    times.retain(|&t| t >= from);
    let mut worst: Option<Overlap> = None;
    for pair in times.windows(2) {
        let gap = |t: f64| {
            let (one, other) = (at(ours, t), at(theirs, t));
            (other[0] - one[0], other[1] - one[1], other[2] - one[2])
        };
        let (begin, end) = (gap(pair[0]), gap(pair[1]));
        let nearer = (end.0 - begin.0).hypot(end.1 - begin.1) + (end.2 - begin.2).abs();
        if begin.0.hypot(begin.1) - nearer > WIDTH * SQRT_2 {
            continue;
        }
        let parts = (nearer / STRIDE).ceil().max(1.0);
        let mut part = 0.0;
        while part <= parts {
            let t = pair[0] + (pair[1] - pair[0]) * part / parts;
            let depth = depth(at(ours, t), at(theirs, t));
            let is_worse = worst.is_none_or(|worst| depth > worst.depth);
            if depth > 1.0e-6 && is_worse && !are_docked(trace, one, other, t) {
                let modules = (one, other);
                worst = Some(Overlap { modules, t, depth });
            }
            part += 1.0;
        }
    }
    worst
}

/// The line that holds at a time.
fn line_at(moments: &[Moment], t: f64) -> usize {
    moments.partition_point(|moment| moment.t <= t).max(1) - 1
}

fn at(moments: &[Moment], t: f64) -> [f64; 3] {
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

/// How deep two squares overlap; negative if a line along a side of either parts them.
fn depth(one: [f64; 3], other: [f64; 3]) -> f64 {
    let corners = |[x, y, heading]: [f64; 3]| {
        [0.0, 1.0, 2.0, 3.0].map(|quarter| {
            let (sine, cosine) = (heading + PI / 4.0 + FRAC_PI_2 * quarter).sin_cos();
            (x + WIDTH / SQRT_2 * cosine, y + WIDTH / SQRT_2 * sine)
        })
    };
    let (ours, theirs) = (corners(one), corners(other));
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
fn are_docked(trace: &Trace, one: u64, other: u64, t: f64) -> bool {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn line(t: f64, module: u64, place: (f64, f64), links: &[u64]) -> String {
        serde_json::json!({
            "t": t, "module": module, "x": place.0, "y": place.1, "theta": 0.0, "links": links, "folding": false,
        })
        .to_string()
    }

    fn judged(lines: &[String]) -> Vec<Overlap> {
        overlaps(&lines.join("\n"))
    }

    #[test]
    fn an_overlap_in_a_trace_is_found_with_modules_time_and_depth() {
        let lines = [
            line(10.0, 7, (0.0, 0.0), &[]),
            line(12.0, 7, (4.0, 0.0), &[]),
            line(9.0, 3, (2.0, 0.5), &[]),
        ];
        let found = judged(&lines);
        let [overlap] = found[..] else {
            panic!("{found:?}");
        };
        assert_eq!(overlap.modules, (3, 7));
        assert!((overlap.depth - 0.4).abs() < 1e-6, "{overlap:?}");
        assert!((10.7..11.3).contains(&overlap.t), "{overlap:?}");
    }

    #[test]
    fn modules_that_pass_in_time_or_are_docked_are_not_found() {
        // The first is gone when the second comes.
        let mut lines = vec![
            line(10.0, 7, (0.0, 0.0), &[]),
            line(11.0, 7, (0.0, 2.0), &[]),
            line(11.0, 3, (-2.0, 0.0), &[]),
            line(12.0, 3, (2.0, 0.0), &[]),
        ];
        assert_eq!(judged(&lines), []);
        lines[1] = line(13.0, 7, (0.0, 2.0), &[]);
        assert_eq!(judged(&lines).len(), 1);
        let lines = [
            line(10.0, 7, (0.0, 0.0), &[5]),
            line(11.0, 7, (2.0, 0.0), &[5]),
            line(9.0, 5, (0.0, 1.0), &[3, 7]),
            line(9.0, 3, (1.0, 0.0), &[5]),
        ];
        assert_eq!(judged(&lines), []);
    }
}
