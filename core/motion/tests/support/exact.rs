//! The bodies of modules as they are, round or square and however turned, compared at many moments of an execution. Shares
//! nothing with the planner.

#![allow(clippy::unwrap_used, reason = "helpers of tests fail the test")]

use formation_model::{BodyShape, ModuleMotion, MotionPlan, Pose, StepKind, Target, UnitMotion};

use super::Numbers;
use super::bodies::{Delays, Execution, execute, turned_by};
use super::motion::waits_of;

/// How far bodies may overlap: poses are exact to thousandths.
const SLACK: f64 = 0.003;
/// Bodies are compared at moments that are at most this far apart, in durations of a step.
const STRIDE: f64 = 0.04;

/// What a module covers: its middle and heading, or the disc in which its unit folds.
#[derive(Clone, Copy, Debug)]
enum Placed {
    Body(f64, f64, f64),
    Disc(f64, f64, f64, usize),
}

/// What a body covers that stands at a pose.
fn body_at(pose: &Pose) -> Placed {
    Placed::Body(pose.x.to_units(), pose.y.to_units(), pose.theta.to_units())
}

/// Where a module is at a time.
fn placed(
    unit: &UnitMotion,
    index: usize,
    module: &ModuleMotion,
    times: &[(f64, f64)],
    time: f64,
) -> Placed {
    let done = times.iter().take_while(|(_, end)| *end <= time).count();
    let from = &module.waypoints[done].pose;
    let is_fold = |step: usize| {
        matches!(
            unit.steps.get(step).map(|it| it.kind),
            Some(StepKind::Fold { .. })
        )
    };
    // Between the halves of a fold the unit is folding, too.
    let halves = (0..done).rev().take_while(|&step| is_fold(step)).count();
    let step = unit.steps.get(done).zip(times.get(done));
    let Some((step, &(begin, end))) = step.filter(|(_, times)| times.0 <= time || halves % 2 == 1)
    else {
        return body_at(from);
    };
    let to = &module.waypoints[done + 1].pose;
    let share = ((time - begin) / (end - begin)).max(0.0);
    let between = |from: f64, to: f64| from + (to - from) * share;
    let turned = turned_by(from.theta.to_units(), to.theta.to_units());
    let heading = from.theta.to_units() + turned * share;
    match step.kind {
        StepKind::Fold { centre, radius } => Placed::Disc(
            centre.x.to_units(),
            centre.y.to_units(),
            radius.to_units(),
            index,
        ),
        StepKind::Turn { centre, .. } => {
            let (x, y) = (centre.x.to_units(), centre.y.to_units());
            let (right, up) = (from.x.to_units() - x, from.y.to_units() - y);
            let (sine, cosine) = (centre.theta.to_units() * share).sin_cos();
            Placed::Body(
                x + right * cosine - up * sine,
                y + right * sine + up * cosine,
                heading,
            )
        }
        StepKind::Shift | StepKind::Regroup | StepKind::Move => Placed::Body(
            between(from.x.to_units(), to.x.to_units()),
            between(from.y.to_units(), to.y.to_units()),
            heading,
        ),
    }
}

/// Whether two bodies of a width overlap.
fn overlap(one: Placed, other: Placed, shape: BodyShape, width: f64) -> bool {
    let half = width / 2.0;
    let disc_meets = |(x, y, radius): (f64, f64, f64), (bx, by, heading): (f64, f64, f64)| {
        let (sine, cosine) = heading.sin_cos();
        let (right, up) = (x - bx, y - by);
        if shape.is_round() {
            return right.hypot(up) < radius + half - SLACK;
        }
        let (along, across) = (right * cosine + up * sine, up * cosine - right * sine);
        (along.abs() - half)
            .max(0.0)
            .hypot((across.abs() - half).max(0.0))
            < radius - SLACK
    };
    match (one, other) {
        (Placed::Disc(x, y, radius, of), Placed::Disc(to_x, to_y, reach, other)) => {
            of != other && (to_x - x).hypot(to_y - y) < radius + reach - SLACK
        }
        (Placed::Disc(x, y, radius, _), Placed::Body(bx, by, heading))
        | (Placed::Body(bx, by, heading), Placed::Disc(x, y, radius, _)) => {
            disc_meets((x, y, radius), (bx, by, heading))
        }
        (Placed::Body(x, y, heading), Placed::Body(to_x, to_y, other)) => {
            let (right, up) = (to_x - x, to_y - y);
            if shape.is_round() {
                return right.hypot(up) < width - SLACK;
            }
            let reach = (other - heading).sin().abs() + (other - heading).cos().abs();
            let apart = half * (1.0 + reach) - SLACK;
            [heading, other].into_iter().all(|heading| {
                let (sine, cosine) = heading.sin_cos();
                let along = (right * cosine + up * sine).abs();
                along.max((up * cosine - right * sine).abs()) < apart
            })
        }
    }
}

/// The first overlap of two bodies in an execution, or of one with a body that stands at one of these poses.
fn first_contact(
    plan: &MotionPlan,
    target: &Target,
    execution: &Execution,
    standing: &[Pose],
) -> Option<String> {
    let shape = target.surroundings().body();
    let width = target.surroundings().body_width().to_units();
    let end = execution
        .times
        .iter()
        .flatten()
        .map(|time| time.1)
        .fold(0.0, f64::max);
    let moments = std::iter::successors(Some(0.0), |time| Some(time + STRIDE));
    moments
        .take_while(|&time| time < end + STRIDE)
        .find_map(|time| {
            let units = plan.units.iter().zip(&execution.times).enumerate();
            let moving = units.flat_map(|(index, (unit, times))| {
                let modules = unit.modules.iter();
                modules.map(move |module| {
                    let place = placed(unit, index, module, times, time);
                    (Some(module.module), place)
                })
            });
            let all: Vec<_> = standing
                .iter()
                .map(|pose| (None, body_at(pose)))
                .chain(moving)
                .collect();
            all.iter().enumerate().find_map(|(index, one)| {
                let mut before = all[..index].iter();
                let other = before.find(|other| overlap(one.1, other.1, shape, width))?;
                Some(format!("{:?} and {:?} at {time}", one, other))
            })
        })
}

/// Executes a plan once without and some times with random delays; the first contact of bodies.
pub fn contact(
    plan: &MotionPlan,
    target: &Target,
    repeats: usize,
    numbers: &mut Numbers,
) -> Option<String> {
    let waits = waits_of(plan);
    (0..=repeats).find_map(|round| {
        let delays = if round == 0 {
            Delays::None
        } else {
            Delays::Random
        };
        let execution = execute(plan, &waits, delays, numbers);
        let execution = execution.unwrap_or_else(|stuck| panic!("deadlock of {stuck:?}"));
        first_contact(plan, target, &execution, &[])
    })
}

/// Whether bodies of a target at two poses overlap.
pub fn overlap_at(one: &Pose, other: &Pose, target: &Target) -> bool {
    let (shape, width) = (
        target.surroundings().body(),
        target.surroundings().body_width(),
    );
    overlap(body_at(one), body_at(other), shape, width.to_units())
}

/// Executes a plan once; the first contact of bodies, those that stand at these poses among them.
pub fn contact_with_standing(
    plan: &MotionPlan,
    target: &Target,
    standing: &[Pose],
) -> Option<String> {
    let mut numbers = Numbers(1);
    let execution = execute(plan, &waits_of(plan), Delays::None, &mut numbers);
    let execution = execution.unwrap_or_else(|stuck| panic!("deadlock of {stuck:?}"));
    first_contact(plan, target, &execution, standing)
}
