//! Executes motion plans by their waits alone and looks for contact, in continuous time. Shares nothing with the planner.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail the test")]

use std::collections::BTreeMap;

use formation::model::{MicroUnits, ModuleId, Pose};
use formation::motion::paths::{ModuleMotion, MotionPlan, StepKind, UnitMotion, Wait};

use super::Numbers;

/// How far bodies may overlap: targets and poses are exact to thousandths.
const SLACK: f64 = 0.005;
/// The width of a module's cell, of which no other cell may take any.
pub const CELL: f64 = 1.0;
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

/// A body during some time: a square along the axes that moves evenly, or a disc that stands still.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Square { from: (f64, f64), to: (f64, f64) },
    Disc { centre: (f64, f64), radius: f64 },
}

#[derive(Clone, Copy, Debug)]
struct Segment {
    begin: f64,
    end: f64,
    shape: Shape,
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

/// The bodies of a plan in an execution, by name.
fn bodies(plan: &MotionPlan, execution: &Execution) -> Vec<(String, Vec<Segment>)> {
    let mut bodies = Vec::new();
    for (unit, times) in plan.units.iter().zip(&execution.times) {
        let hidden = discs(unit, times);
        // A group that turns has one disc, which its first unit shows.
        let is_first = unit.joint_with.iter().all(|&other| other > unit.lead);
        let shown = hidden.iter().filter(|disc| is_first || disc.begin > 0.0);
        let shown: Vec<Segment> = shown.copied().collect();
        if !shown.is_empty() {
            bodies.push((format!("disc of {}", unit.lead), shown));
        }
        for module in &unit.modules {
            bodies.push((module.module.to_string(), squares(module, times, &hidden)));
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
            // The planner keeps others off what regrouping modules sweep; among each other they may overlap.
            StepKind::Regroup => (Pose::default(), MicroUnits(0), 0.0),
            StepKind::Shift | StepKind::Move => continue,
        };
        let (centre, radius) = (at(&centre), radius.to_units());
        discs.push(Segment {
            begin,
            end,
            shape: Shape::Disc { centre, radius },
        });
    }
    assert!(folding.is_none(), "{} ends half folded", unit.lead);
    discs
}

/// The square of a module while it is not within a disc of its unit.
fn squares(module: &ModuleMotion, times: &[(f64, f64)], hidden: &[Segment]) -> Vec<Segment> {
    let is_hidden = |time: f64| {
        hidden
            .iter()
            .any(|disc| disc.begin <= time && time < disc.end)
    };
    let mut segments = Vec::new();
    let mut add = |begin: f64, end: f64, from: &Pose, to: &Pose| {
        if begin < end && !is_hidden(begin) {
            assert!(
                is_quarter(from) && is_quarter(to),
                "{} is askew",
                module.module
            );
            let (from, to) = (at(from), at(to));
            segments.push(Segment {
                begin,
                end,
                shape: Shape::Square { from, to },
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

/// All pairs of bodies of this width that overlap.
pub fn contacts(plan: &MotionPlan, execution: &Execution, width: f64) -> Vec<Contact> {
    let bodies = bodies(plan, execution);
    let mut found = Vec::new();
    for (index, (name, segments)) in bodies.iter().enumerate() {
        for (other, others) in &bodies[..index] {
            let (mut left, mut right) = (0, 0);
            while let (Some(one), Some(two)) = (segments.get(left), others.get(right)) {
                let (begin, end) = (one.begin.max(two.begin), one.end.min(two.end));
                if begin < end && overlap(one, two, (begin, end), width) {
                    found.push(Contact {
                        bodies: (other.clone(), name.clone()),
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

/// The position of a square at a time.
fn position(segment: &Segment, time: f64) -> (f64, f64) {
    match segment.shape {
        Shape::Disc { centre, .. } => centre,
        Shape::Square { from, to } => {
            if from == to {
                return from;
            }
            let share = (time - segment.begin) / (segment.end - segment.begin);
            (
                from.0 + (to.0 - from.0) * share,
                from.1 + (to.1 - from.1) * share,
            )
        }
    }
}

fn overlap(one: &Segment, two: &Segment, (begin, end): (f64, f64), width: f64) -> bool {
    // Beyond the last event nothing moves.
    let end = if end.is_finite() { end } else { begin + 1.0 };
    match (one.shape, two.shape) {
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
