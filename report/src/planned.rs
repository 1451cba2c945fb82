//! The course of a plan: its turns, then the motions of all units along their paths.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use formation_event_log::{Entry, LogEvent, ModuleSnapshot, milliseconds};
use formation_model::{
    Epoch, MICRO_PER_UNIT, MicroUnits, ModuleId, ModulePhase, PlanningProblem, Pose, SpotId, Step,
    StepKind, UnitMotion,
};
use formation_motion::{MotionGoal, PlannedMotion, SimulatedDrive};
use formation_planner::PlanOutcome;

/// Into how many straight parts an arc is divided.
const ARC_PARTS: u32 = 6;

/// The course of a plan whose modules move by simulated drives at this speed.
///
/// Turns take no time here; motions take what the drives take.
#[must_use]
pub fn course_of_plan(
    problem: &PlanningProblem,
    outcome: &PlanOutcome,
    motion: &PlannedMotion,
    speed_units_per_s: f64,
) -> Vec<Entry> {
    let epoch = Epoch {
        number: 1,
        convener: problem.modules()[0].id,
    };
    let mut course = Course::begin(problem, outcome, epoch);
    for (turn, decision) in &outcome.decisions {
        course.note(LogEvent::Claim {
            epoch,
            turn: turn.number,
            claimant: turn.claimant,
            decision: decision.clone(),
        });
    }
    course.wait_for_turns();
    match motion {
        PlannedMotion::Paths(paths) => course.follow_paths(&paths.units, speed_units_per_s),
        PlannedMotion::Refused(_) => {}
    }
    course.entries
}

struct Course<'a> {
    problem: &'a PlanningProblem,
    outcome: &'a PlanOutcome,
    now: Duration,
    modules: BTreeMap<ModuleId, ModuleSnapshot>,
    /// The module of each spot.
    holders: BTreeMap<SpotId, ModuleId>,
    entries: Vec<Entry>,
}

impl<'a> Course<'a> {
    fn begin(problem: &'a PlanningProblem, outcome: &'a PlanOutcome, epoch: Epoch) -> Self {
        let mut course = Self {
            problem,
            outcome,
            now: Duration::ZERO,
            modules: BTreeMap::new(),
            holders: outcome
                .plan
                .assignments
                .iter()
                .map(|(&module, &spot)| (spot, module))
                .collect(),
            entries: Vec::new(),
        };
        for module in problem.modules() {
            course.publish(ModuleSnapshot {
                module: module.id,
                phase: ModulePhase::Gathered,
                pose: module.pose,
                links: module.links.clone(),
                spot: module.pin,
                unit: None,
                in_service: true,
            });
        }
        course.note(LogEvent::Roster {
            epoch,
            modules: problem.modules().iter().map(|module| module.id).collect(),
            out_of_service: Vec::new(),
            problem: Some(problem.digest()),
        });
        course
    }

    fn note(&mut self, event: LogEvent) {
        self.entries.push(Entry {
            at_ms: milliseconds(self.now),
            event,
        });
    }

    fn publish(&mut self, state: ModuleSnapshot) {
        self.modules.insert(state.module, state.clone());
        self.note(LogEvent::State(state));
    }

    /// Changes the state of a module, and publishes it if it differs.
    fn change(&mut self, module: ModuleId, change: impl FnOnce(&mut ModuleSnapshot)) {
        if let Some(known) = self.modules.get(&module) {
            let mut state = known.clone();
            change(&mut state);
            if state != *known {
                self.publish(state);
            }
        }
    }

    /// All members have agreed; those with a spot wait for the turn of their unit.
    fn wait_for_turns(&mut self) {
        let plan = &self.outcome.plan;
        let units = plan.assembly.unit_of_each();
        for module in self.problem.modules() {
            self.change(module.id, |state| {
                state.spot = plan.assignments.get(&module.id).copied();
                let unit = units.get(&module.id);
                state.unit = unit.map(|unit| unit.lead);
                state.phase = match unit {
                    Some(unit) if unit.pinned => ModulePhase::Settled,
                    Some(_) => ModulePhase::Waiting,
                    None => ModulePhase::Spare,
                };
            });
        }
    }

    /// All units move along their paths, as the plan times them: a step takes as long as a cell.
    fn follow_paths(&mut self, units: &[UnitMotion], speed_units_per_s: f64) {
        let mut moments: Vec<Moment> = units.iter().flat_map(moments_of).collect();
        moments.sort_by(|one, other| one.time.total_cmp(&other.time));
        let begin = self.now;
        for Moment { time, module, what } in moments {
            let passed = Duration::try_from_secs_f64(time / speed_units_per_s);
            self.now = begin + passed.unwrap_or_default();
            match what {
                What::Becomes(phase) => self.change(module, |state| state.phase = phase),
                What::Undocks => self.undock(module),
                What::IsAt(pose) => {
                    if let Some(state) = self.modules.get_mut(&module) {
                        state.pose = pose;
                        self.note(LogEvent::Pose { module, pose });
                    }
                }
                What::Docks(spot) => self.settle(module, spot),
            }
        }
    }

    /// A module has arrived at its spot, and docks to those that are there.
    fn settle(&mut self, module: ModuleId, spot: SpotId) {
        let Some(spot) = self.problem.target().spot(spot).copied() else {
            return;
        };
        let docked = self.docked_at(spot.id);
        for &other in &docked {
            self.change(other, |state| {
                state.links.insert(module);
            });
        }
        self.change(module, |state| {
            state.pose = spot.pose;
            state.phase = ModulePhase::Settled;
            state.links.extend(docked);
        });
    }

    /// Undocks from the links that the plan does not keep.
    fn undock(&mut self, module: ModuleId) {
        let kept = &self.outcome.plan.kept_links;
        let broken: BTreeSet<ModuleId> = self
            .modules
            .get(&module)
            .into_iter()
            .flat_map(|state| state.links.iter().copied())
            .filter(|&other| !kept.contains(&(module.min(other), module.max(other))))
            .collect();
        for other in &broken {
            self.change(*other, |state| {
                state.links.remove(&module);
            });
        }
        self.change(module, |state| {
            state.links.retain(|other| !broken.contains(other));
        });
    }

    /// The settled modules on the neighbours of a spot.
    fn docked_at(&self, spot: SpotId) -> BTreeSet<ModuleId> {
        let neighbours = self.problem.target().neighbours_of(spot);
        neighbours
            .filter_map(|spot| self.modules.get(self.holders.get(&spot)?))
            .filter(|state| state.phase == ModulePhase::Settled)
            .map(|state| state.module)
            .collect()
    }
}

/// Something that a module does at a time of the plan.
struct Moment {
    time: f64,
    module: ModuleId,
    what: What,
}

enum What {
    Becomes(ModulePhase),
    Undocks,
    IsAt(Pose),
    Docks(SpotId),
}

/// What the modules of a unit do, in the order of its steps.
fn moments_of(unit: &UnitMotion) -> Vec<Moment> {
    let mut moments = Vec::new();
    for module in &unit.modules {
        let mut add = |time: f64, what| {
            let module = module.module;
            moments.push(Moment { time, module, what });
        };
        let ends = module.waypoints.windows(2);
        let mut number = 0;
        for (step, ends) in unit.steps.iter().zip(ends) {
            let begin = f64::from(step.begin);
            if number == 0 {
                add(begin, What::Becomes(ModulePhase::Moving));
            }
            if number == unit.joint_steps {
                add(begin, What::Undocks);
            }
            number += 1;
            // It has stood there since the end of the step before.
            add(begin, What::IsAt(ends[0].pose));
            let length = f64::from(ends[1].time) - begin;
            for (share, pose) in along(step, ends[0].pose, ends[1].pose) {
                add(begin + length * share, What::IsAt(pose));
            }
        }
        let end = module.waypoints.last().map_or(0, |last| last.time);
        match (module.spot, unit.docked_at) {
            (Some(spot), Some(docked)) => add(f64::from(docked), What::Docks(spot)),
            _ if number > 0 => add(f64::from(end), What::Becomes(ModulePhase::Spare)),
            _ => {}
        }
    }
    moments
}

/// The poses of a module in a step, each at a share of its time; several where it goes along an arc.
fn along(step: &Step, from: Pose, to: Pose) -> Vec<(f64, Pose)> {
    let StepKind::Turn { centre, .. } = step.kind else {
        return vec![(1.0, to)];
    };
    let goal = MotionGoal {
        pose: to,
        unit_distance: MicroUnits(MICRO_PER_UNIT),
        pivot: Some(centre),
    };
    let mut drive = SimulatedDrive::new(from, 1.0, Duration::MAX);
    drive.go(Duration::ZERO, goal);
    let whole = drive.time_left(Duration::ZERO).unwrap_or_default();
    (1..=ARC_PARTS)
        .map(|part| {
            let pose = drive.pose_at(whole * part / ARC_PARTS);
            (f64::from(part) / f64::from(ARC_PARTS), pose)
        })
        .collect()
}
