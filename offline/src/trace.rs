//! Judges a trace of a run, as `formation run --trace` writes it, against its scenario.

use std::collections::{BTreeMap, BTreeSet};

use formation_model::{ModuleId, Plan, PlanningProblem, Pose, RawArea, SpotId};
use formation_verify::hole_of;
use formation_verify::trace::{Overlap, Trace, TracePoint, first_where, overlaps};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How far a module may be off its spot, in units and radians.
const TOLERANCE: f64 = 0.05;
/// Bodies that overlap by less touch, in units: messages round times.
const CONTACT_MIN: f64 = 0.01;

/// A line that is no state of a module.
#[derive(Debug, Error)]
#[error("line {line}: {reason}")]
pub struct TraceError {
    /// The line, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub reason: String,
}

/// What a trace shows.
#[derive(Debug, Serialize)]
pub struct TraceVerdict {
    /// `COMPLETE`, `PARTIAL` or `FAILED`, as in verdicts.
    pub outcome: &'static str,
    /// The spot on which each module ended, ascending by module.
    pub assignments: BTreeMap<ModuleId, SpotId>,
    /// The spots that no module fills.
    pub open_spots: Vec<SpotId>,
    /// What is wrong, one sentence each.
    pub violations: Vec<String>,
}

#[derive(Deserialize)]
struct Line {
    t: f64,
    module: u32,
    x: f64,
    y: f64,
    theta: f64,
    #[serde(default)]
    links: BTreeSet<u32>,
}

/// Reads a trace, one JSON object a line; empty lines are skipped.
///
/// # Errors
/// Names the first line that is no state of a module, or is older than the one before it.
pub fn read_trace(text: &str) -> Result<Trace, TraceError> {
    let mut trace = Trace::new();
    for (line, content) in (1..).zip(text.lines()) {
        if content.trim().is_empty() {
            continue;
        }
        let wrong = |reason: String| TraceError { line, reason };
        let read: Line = serde_json::from_str(content)
            .map_err(|error| wrong(format!("is no state of a module: {error}")))?;
        let moments = trace.entry(read.module).or_default();
        if moments.last().is_some_and(|last| last.t > read.t) {
            let module = ModuleId(read.module);
            return Err(wrong(format!("{module} was at a later time before")));
        }
        moments.push(TracePoint {
            t: read.t,
            pose: [read.x, read.y, read.theta],
            links: read.links,
        });
    }
    Ok(trace)
}

/// Judges whether the modules of a problem end on its spots, docked, and were never in contact with each other, with an obstacle
/// or with a wall.
pub fn verify_trace(problem: &PlanningProblem, trace: &Trace) -> TraceVerdict {
    let mut violations = Vec::new();
    let unknown = trace
        .keys()
        .filter(|&&id| problem.module(ModuleId(id)).is_none());
    violations.extend(unknown.map(|&id| format!("{} is not in the scenario", ModuleId(id))));
    let absent = problem
        .modules()
        .iter()
        .filter(|one| !trace.contains_key(&one.id.0));
    violations.extend(absent.map(|one| format!("{} is not in the trace", one.id)));
    let assignments = ends(problem, trace, &mut violations);
    let filled: BTreeSet<SpotId> = assignments.values().copied().collect();
    let plan = Plan {
        assignments: assignments.clone(),
        ..Plan::default()
    };
    violations.extend(hole_of(problem, &plan).iter().map(ToString::to_string));
    violations.extend(undocked(problem, trace, &assignments));
    let width = problem.target().surroundings().body_width().to_units();
    let contacts = overlaps(trace, width).into_iter();
    violations.extend(contacts.filter(|one| one.depth > CONTACT_MIN).map(contact));
    violations.extend(wall_contacts(problem, trace, width));
    let spots = problem.target().spots().iter().map(|spot| spot.id);
    let open_spots: Vec<SpotId> = spots.filter(|spot| !filled.contains(spot)).collect();
    let outcome = match (violations.is_empty(), open_spots.is_empty()) {
        (false, _) => "FAILED",
        (true, true) => "COMPLETE",
        (true, false) => "PARTIAL",
    };
    TraceVerdict {
        outcome,
        assignments,
        open_spots,
        violations,
    }
}

/// The spot on which each module ended.
fn ends(
    problem: &PlanningProblem,
    trace: &Trace,
    violations: &mut Vec<String>,
) -> BTreeMap<ModuleId, SpotId> {
    let mut assignments = BTreeMap::new();
    let mut holders: BTreeMap<SpotId, ModuleId> = BTreeMap::new();
    for (&id, moments) in trace {
        let module = ModuleId(id);
        let Some(last) = moments.last() else { continue };
        let spots = problem.target().spots().iter();
        let Some(spot) = spots.clone().find(|spot| is_at(last, &spot.pose)) else {
            continue;
        };
        match holders.insert(spot.id, module) {
            None => {
                assignments.insert(module, spot.id);
            }
            Some(other) => violations.push(format!("{other} and {module} both end on {}", spot.id)),
        }
    }
    assignments
}

fn is_at(moment: &TracePoint, pose: &Pose) -> bool {
    let [x, y, theta] = moment.pose;
    let turn = (theta - pose.theta.to_units()).rem_euclid(std::f64::consts::TAU);
    let turn = turn.min(std::f64::consts::TAU - turn);
    (x - pose.x.to_units()).hypot(y - pose.y.to_units()) <= TOLERANCE && turn <= TOLERANCE
}

/// Modules that end on adjacent spots and do not both say that they are docked.
fn undocked(
    problem: &PlanningProblem,
    trace: &Trace,
    assignments: &BTreeMap<ModuleId, SpotId>,
) -> Vec<String> {
    let holders: BTreeMap<SpotId, ModuleId> = assignments
        .iter()
        .map(|(&module, &spot)| (spot, module))
        .collect();
    let names = |one: ModuleId, other: ModuleId| {
        let last = trace.get(&one.0).and_then(|moments| moments.last());
        last.is_some_and(|last| last.links.contains(&other.0))
    };
    let spots = problem.target().spots();
    let edges = problem.target().topology().edges().iter();
    let pairs = edges.filter_map(|&(one, other)| {
        let one = *holders.get(&spots[one].id)?;
        let other = *holders.get(&spots[other].id)?;
        (!names(one, other) || !names(other, one))
            .then(|| format!("{one} and {other} end on adjacent spots and are not docked"))
    });
    pairs.collect()
}

fn contact(overlap: Overlap) -> String {
    let (one, other) = overlap.modules;
    format!(
        "{} and {} overlap by {:.3} units at {:.3} s",
        ModuleId(one),
        ModuleId(other),
        overlap.depth,
        overlap.t
    )
}

/// Modules whose bodies reach into an obstacle, or out of the arena.
fn wall_contacts(problem: &PlanningProblem, trace: &Trace, width: f64) -> Vec<String> {
    let surroundings = problem.target().surroundings();
    let mut found = Vec::new();
    for (&id, moments) in trace {
        let module = ModuleId(id);
        for obstacle in surroundings.obstacles() {
            let area = obstacle.to_raw();
            if let Some(t) = first_where(moments, width, |corners| reaches_into(&corners, &area)) {
                let (x, y) = (area.x, area.y);
                found.push(format!(
                    "{module} touches the obstacle at ({x}, {y}) at {t:.3} s"
                ));
            }
        }
        let Some(arena) = surroundings.arena() else {
            continue;
        };
        let area = arena.to_raw();
        if let Some(t) = first_where(moments, width, |corners| leaves(&corners, &area)) {
            found.push(format!("{module} leaves the arena at {t:.3} s"));
        }
    }
    found
}

/// Whether a square and a box share more than a touch: no axis of either parts them.
fn reaches_into(corners: &[(f64, f64); 4], area: &RawArea) -> bool {
    let (half_width, half_height) = (area.width / 2.0, area.height / 2.0);
    let of_box = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
        .map(|(x, y)| (area.x + x * half_width, area.y + y * half_height));
    let side = (corners[1].0 - corners[0].0, corners[1].1 - corners[0].1);
    let length = side.0.hypot(side.1);
    let side = (side.0 / length, side.1 / length);
    let axes = [(1.0, 0.0), (0.0, 1.0), side, (-side.1, side.0)];
    axes.iter().all(|axis| {
        let reach = |corners: &[(f64, f64); 4]| {
            let along = corners.map(|corner| corner.0 * axis.0 + corner.1 * axis.1);
            let low = along.into_iter().fold(f64::INFINITY, f64::min);
            (low, along.into_iter().fold(f64::NEG_INFINITY, f64::max))
        };
        let (ours, theirs) = (reach(corners), reach(&of_box));
        (ours.1 - theirs.0).min(theirs.1 - ours.0) > CONTACT_MIN
    })
}

fn leaves(corners: &[(f64, f64); 4], area: &RawArea) -> bool {
    corners.iter().any(|&(x, y)| {
        (x - area.x).abs() > area.width / 2.0 + CONTACT_MIN
            || (y - area.y).abs() > area.height / 2.0 + CONTACT_MIN
    })
}
