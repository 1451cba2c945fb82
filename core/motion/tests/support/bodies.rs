//! Executes motion plans by their waits alone and looks for contact, in continuous time. Shares nothing with the planner.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail the test")]

use std::collections::BTreeMap;

use formation_model::{ModuleId, ModuleMotion, MotionPlan, Pose, StepKind, UnitMotion, Wait};

use super::Numbers;

/// How far bodies may overlap: targets and poses are exact to thousandths.
const SLACK: f64 = 0.005;
/// The width of a module's cell, of which no other cell may take any.
pub const CELL: f64 = 1.0;
/// The width of a module's body.
pub const BODY: f64 = 0.9;
/// Turned bodies are compared at this many moments of the time during which neither begins or ends a step.
const MOMENTS: u32 = 32;
/// The side of the box around a body of 0.9 units that is turned by up to 0.034.
pub const MEASURED_BODY: f64 = 0.9 * 1.034;

/// When each step of each unit begins and ends.
pub struct Execution {
    pub times: Vec<Vec<(f64, f64)>>,
}

/// How long steps take.
#[derive(Clone, Copy)]
pub enum Delays {
    None,
    /// Steps take 1 to 5 times as long, and in one unit of five one step takes 20 more.
    Random,
}

/// How long the steps of one unit take.
fn durations(steps: usize, delays: Delays, numbers: &mut Numbers) -> Vec<f64> {
    let mut durations: Vec<f64> = (0..steps)
        .map(|_| match delays {
            Delays::None => 1.0,
            Delays::Random => 1.0 + numbers.below(4_001) as f64 / 1_000.0,
        })
        .collect();
    if matches!(delays, Delays::Random) && steps > 0 && numbers.chance(20) {
        durations[numbers.below(steps)] += 20.0;
    }
    durations
}

/// Executes a plan with waits that may be fewer than its own; the units that never end if there is a deadlock.
pub fn execute(
    plan: &MotionPlan,
    waits: &[Vec<Wait>],
    delays: Delays,
    numbers: &mut Numbers,
) -> Result<Execution, Vec<ModuleId>> {
    let index: BTreeMap<ModuleId, usize> = plan
        .units
        .iter()
        .enumerate()
        .map(|(index, unit)| (unit.lead, index))
        .collect();
    let mut times: Vec<Vec<(f64, f64)>> = vec![Vec::new(); plan.units.len()];
    let durations: Vec<Vec<f64>> = plan
        .units
        .iter()
        .map(|unit| durations(unit.steps.len(), delays, numbers))
        .collect();
    let earliest = |unit: usize, times: &[Vec<(f64, f64)>]| -> Option<f64> {
        let step = times[unit].len() + 1;
        let mut begin = times[unit].last().map_or(0.0, |last| last.1);
        for wait in waits[unit].iter().filter(|wait| wait.step as usize == step) {
            let done = wait.steps_done as usize;
            begin = begin.max(times[index[&wait.unit]].get(done - 1)?.1);
        }
        Some(begin)
    };
    loop {
        let mut progressed = false;
        for unit in 0..plan.units.len() {
            let motion = &plan.units[unit];
            while times[unit].len() < motion.steps.len() {
                let step = times[unit].len();
                let mut team = vec![unit];
                if step < motion.joint_steps as usize {
                    team.extend(motion.joint_with.iter().map(|lead| index[lead]));
                }
                if team.iter().any(|&member| times[member].len() != step) {
                    break;
                }
                let begins: Option<Vec<f64>> = team
                    .iter()
                    .map(|&member| earliest(member, &times))
                    .collect();
                let Some(begins) = begins else { break };
                let begin = begins.into_iter().fold(0.0, f64::max);
                let end = begin + durations[unit][step];
                for &member in &team {
                    times[member].push((begin, end));
                }
                progressed = true;
            }
        }
        if !progressed {
            break;
        }
    }
    let stuck: Vec<ModuleId> = plan
        .units
        .iter()
        .zip(&times)
        .filter(|(unit, times)| times.len() < unit.steps.len())
        .map(|(unit, _)| unit.lead)
        .collect();
    if stuck.is_empty() {
        Ok(Execution { times })
    } else {
        Err(stuck)
    }
}

/// A body during some time: a square along the axes that moves evenly, one of [`BODY`] that moves and turns evenly, or a disc
/// that stands still.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Square { from: (f64, f64), to: (f64, f64) },
    Turned { from: Pose, to: Pose },
    Disc { centre: (f64, f64), radius: f64 },
}

#[derive(Clone, Copy, Debug)]
struct Segment {
    begin: f64,
    end: f64,
    shape: Shape,
    /// Whether the module comes onto the lattice together with those that were docked to it at the start.
    is_joint: bool,
}

/// A module, or the disc of a unit, throughout an execution.
struct Body {
    name: String,
    /// The lowest lead of the units that were docked to each other at the start.
    group: ModuleId,
    segments: Vec<Segment>,
}

/// Two bodies that overlap at some time.
#[derive(Clone, Debug)]
#[allow(dead_code, reason = "shown when a test fails")]
pub struct Contact {
    pub bodies: (String, String),
    pub from: f64,
    pub until: f64,
}

fn at(pose: &Pose) -> (f64, f64) {
    (pose.x.to_units(), pose.y.to_units())
}

fn is_quarter(pose: &Pose) -> bool {
    let quarters = pose.theta.to_units() / std::f64::consts::FRAC_PI_2;
    (quarters - quarters.round()).abs() < 0.034 / std::f64::consts::FRAC_PI_2
}

/// The bodies of a plan in an execution.
fn bodies(plan: &MotionPlan, execution: &Execution) -> Vec<Body> {
    let mut bodies = Vec::new();
    for (unit, times) in plan.units.iter().zip(&execution.times) {
        let hidden = discs(unit, times);
        // A group that turns has one disc, which its first unit shows.
        let is_first = unit.joint_with.iter().all(|&other| other > unit.lead);
        let group = unit.joint_with.iter().copied().fold(unit.lead, Ord::min);
        let shown = hidden.iter().filter(|disc| is_first || disc.begin > 0.0);
        let segments: Vec<Segment> = shown.copied().collect();
        if !segments.is_empty() {
            bodies.push(Body {
                name: format!("disc of {}", unit.lead),
                group,
                segments,
            });
        }
        let joint_until = (unit.joint_steps as usize).checked_sub(1);
        let joint_until = joint_until.map_or(0.0, |last| times[last].1);
        for module in &unit.modules {
            bodies.push(Body {
                name: module.module.to_string(),
                group,
                segments: squares(module, times, &hidden, joint_until),
            });
        }
    }
    bodies
}

/// The discs in which a unit turns, with its group, from the start, and folds.
fn discs(unit: &UnitMotion, times: &[(f64, f64)]) -> Vec<Segment> {
    let mut discs: Vec<Segment> = Vec::new();
    let mut folding = None;
    for (step, &(begin, end)) in unit.steps.iter().zip(times) {
        let (centre, radius, begin) = match step.kind {
            StepKind::Turn { centre, radius } => (centre, radius, 0.0),
            StepKind::Fold { centre, radius } => match folding.take() {
                None => {
                    folding = Some(begin);
                    continue;
                }
                Some(first) => (centre, radius, first),
            },
            StepKind::Regroup | StepKind::Shift | StepKind::Move => continue,
        };
        let (centre, radius) = (at(&centre), radius.to_units());
        discs.push(Segment {
            begin,
            end,
            shape: Shape::Disc { centre, radius },
            is_joint: false,
        });
    }
    assert!(folding.is_none(), "{} ends half folded", unit.lead);
    discs
}

/// The square of a module while it is not within a disc of its unit.
fn squares(
    module: &ModuleMotion,
    times: &[(f64, f64)],
    hidden: &[Segment],
    joint_until: f64,
) -> Vec<Segment> {
    let is_hidden = |time: f64| {
        hidden
            .iter()
            .any(|disc| disc.begin <= time && time < disc.end)
    };
    let mut segments = Vec::new();
    let mut add = |begin: f64, end: f64, from: &Pose, to: &Pose| {
        if begin < end && !is_hidden(begin) {
            let is_joint = begin < joint_until;
            let is_square = is_quarter(from) && is_quarter(to);
            assert!(is_square || is_joint, "{} is askew", module.module);
            let shape = if is_square {
                let (from, to) = (at(from), at(to));
                Shape::Square { from, to }
            } else {
                let (from, to) = (*from, *to);
                Shape::Turned { from, to }
            };
            segments.push(Segment {
                begin,
                end,
                shape,
                is_joint,
            });
        }
    };
    let mut since = 0.0;
    for (pair, &(begin, end)) in module.waypoints.windows(2).zip(times) {
        add(since, begin, &pair[0].pose, &pair[0].pose);
        add(begin, end, &pair[0].pose, &pair[1].pose);
        since = end;
    }
    let last = &module.waypoints.last().unwrap().pose;
    add(since, f64::INFINITY, last, last);
    segments
}

/// All pairs of bodies of this width that overlap. Modules that come onto the lattice as one body may overlap each other.
pub fn contacts(plan: &MotionPlan, execution: &Execution, width: f64) -> Vec<Contact> {
    let bodies = bodies(plan, execution);
    let mut found = Vec::new();
    for (index, body) in bodies.iter().enumerate() {
        for other in &bodies[..index] {
            let (mut left, mut right) = (0, 0);
            while let (Some(one), Some(two)) = (body.segments.get(left), other.segments.get(right))
            {
                let (begin, end) = (one.begin.max(two.begin), one.end.min(two.end));
                let are_one = body.group == other.group && one.is_joint && two.is_joint;
                if begin < end && !are_one && overlap(one, two, (begin, end), width) {
                    found.push(Contact {
                        bodies: (other.name.clone(), body.name.clone()),
                        from: begin,
                        until: end,
                    });
                    break;
                }
                if one.end <= two.end {
                    left += 1;
                } else {
                    right += 1;
                }
            }
        }
    }
    found
}

/// The position of the middle of a body at a time.
fn position(segment: &Segment, time: f64) -> (f64, f64) {
    let (from, to) = match segment.shape {
        Shape::Disc { centre, .. } => (centre, centre),
        Shape::Square { from, to } => (from, to),
        Shape::Turned { from, to } => (at(&from), at(&to)),
    };
    if from == to {
        return from;
    }
    let share = (time - segment.begin) / (segment.end - segment.begin);
    (
        from.0 + (to.0 - from.0) * share,
        from.1 + (to.1 - from.1) * share,
    )
}

/// The heading of a body at a time.
fn heading(segment: &Segment, time: f64) -> f64 {
    match segment.shape {
        Shape::Disc { .. } | Shape::Square { .. } => 0.0,
        Shape::Turned { from, to } if from == to => from.theta.to_units(),
        Shape::Turned { from, to } => {
            let share = (time - segment.begin) / (segment.end - segment.begin);
            let (from, to) = (from.theta.to_units(), to.theta.to_units());
            from + turned_by(from, to) * share
        }
    }
}

/// The shorter turn from one heading to another.
pub fn turned_by(from: f64, to: f64) -> f64 {
    let full = std::f64::consts::TAU;
    let turned = (to - from).rem_euclid(full);
    if turned > full / 2.0 {
        turned - full
    } else {
        turned
    }
}

/// Half the width of a body.
fn half_of(segment: &Segment, width: f64) -> f64 {
    match segment.shape {
        Shape::Disc { radius, .. } => radius,
        Shape::Square { .. } => width / 2.0,
        Shape::Turned { .. } => BODY / 2.0,
    }
}

/// Whether two bodies of which one is turned overlap at a time: no side of a square separates them, nor the line from a disc to
/// the square.
fn overlap_at(one: &Segment, two: &Segment, time: f64, width: f64) -> bool {
    let (first, second) = (position(one, time), position(two, time));
    let between = (second.0 - first.0, second.1 - first.1);
    let seen_from = |angle: f64| {
        let (sine, cosine) = angle.sin_cos();
        let (x, y) = between;
        ((x * cosine + y * sine).abs(), (y * cosine - x * sine).abs())
    };
    let (half, its_half) = (half_of(one, width), half_of(two, width));
    let disc_meets = |angle: f64, half: f64, radius: f64| {
        let (x, y) = seen_from(angle);
        (x - half).max(0.0).hypot((y - half).max(0.0)) < radius - SLACK
    };
    match (one.shape, two.shape) {
        (Shape::Disc { .. }, _) => disc_meets(heading(two, time), its_half, half),
        (_, Shape::Disc { .. }) => disc_meets(heading(one, time), half, its_half),
        _ => {
            let (own, other) = (heading(one, time), heading(two, time));
            let (sine, cosine) = (other - own).sin_cos();
            let reach = sine.abs() + cosine.abs();
            let is_within = |angle: f64, half: f64, its_half: f64| {
                let (x, y) = seen_from(angle);
                x.max(y) < half + its_half * reach - SLACK
            };
            is_within(own, half, its_half) && is_within(other, its_half, half)
        }
    }
}

fn overlap(one: &Segment, two: &Segment, (begin, end): (f64, f64), width: f64) -> bool {
    // Beyond the last event nothing moves.
    let end = if end.is_finite() { end } else { begin + 1.0 };
    match (one.shape, two.shape) {
        (Shape::Turned { .. }, _) | (_, Shape::Turned { .. }) => (0..=MOMENTS).any(|moment| {
            let share = f64::from(moment) / f64::from(MOMENTS);
            overlap_at(one, two, begin + (end - begin) * share, width)
        }),
        (
            Shape::Disc { centre, radius },
            Shape::Disc {
                centre: other,
                radius: reach,
            },
        ) => (centre.0 - other.0).hypot(centre.1 - other.1) < radius + reach - SLACK,
        (Shape::Disc { centre, radius }, Shape::Square { .. }) => {
            disc_meets(centre, radius, two, (begin, end), width)
        }
        (Shape::Square { .. }, Shape::Disc { centre, radius }) => {
            disc_meets(centre, radius, one, (begin, end), width)
        }
        (Shape::Square { .. }, Shape::Square { .. }) => {
            let gap = |time: f64| {
                let (first, second) = (position(one, time), position(two, time));
                (first.0 - second.0, first.1 - second.1)
            };
            let (before, after) = (gap(begin), gap(end));
            let across = inside(before.0, after.0, width);
            let along = inside(before.1, after.1, width);
            matches!((across, along), (Some(x), Some(y)) if x.0.max(y.0) < x.1.min(y.1))
        }
    }
}

/// For which shares of the time a number that goes evenly from `before` to `after` is within a body's width of zero.
fn inside(before: f64, after: f64, width: f64) -> Option<(f64, f64)> {
    let width = width - SLACK;
    if (after - before).abs() < 1.0e-12 {
        return (before.abs() < width).then_some((0.0, 1.0));
    }
    let at = |value: f64| (value - before) / (after - before);
    let (one, other) = (at(-width), at(width));
    let (from, until) = (one.min(other).max(0.0), one.max(other).min(1.0));
    (from < until).then_some((from, until))
}

/// The distance of a point from an evenly moving square is convex in time, so its least value can be closed in on.
fn disc_meets(
    centre: (f64, f64),
    radius: f64,
    square: &Segment,
    (begin, end): (f64, f64),
    width: f64,
) -> bool {
    let distance = |time: f64| {
        let (x, y) = position(square, time);
        let gap = |from: f64, to: f64| ((from - to).abs() - width / 2.0).max(0.0);
        gap(x, centre.0).hypot(gap(y, centre.1))
    };
    let (mut low, mut high) = (begin, end);
    for _ in 0..60 {
        let (one, two) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if distance(one) <= distance(two) {
            high = two;
        } else {
            low = one;
        }
    }
    distance(low) < radius - SLACK
}
