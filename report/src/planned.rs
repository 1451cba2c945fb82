//! The course of a plan: its turns, then the motions of one unit after another on straight paths.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use formation::event_log::{Entry, Event, ModuleSnapshot, milliseconds};
use formation::model::{ActingUnit, Epoch, ModuleId, ModulePhase, PlanningProblem, Pose, SpotId};
use formation::motion::SimulatedDrive;
use formation::planner::PlanOutcome;
use formation::protocol::MotionGoal;

/// The course of a plan whose modules move by simulated drives at this speed.
///
/// Turns take no time here; motions take what the drives take.
#[must_use]
pub fn course_of_plan(
    problem: &PlanningProblem,
    outcome: &PlanOutcome,
    speed_units_per_s: f64,
) -> Vec<Entry> {
    let epoch = Epoch {
        number: 1,
        convener: problem.modules()[0].id,
    };
    let mut course = Course::begin(problem, outcome, epoch);
    for (turn, decision) in &outcome.decisions {
        course.note(Event::Claim {
            epoch,
            turn: turn.number,
            claimant: turn.claimant,
            decision: decision.clone(),
        });
    }
    course.wait_for_turns();
    for unit in outcome
        .plan
        .assembly
        .units
        .iter()
        .filter(|unit| !unit.pinned)
    {
        course.act(unit, speed_units_per_s);
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
            });
        }
        course.note(Event::Roster {
            epoch,
            modules: problem.modules().iter().map(|module| module.id).collect(),
            out_of_service: Vec::new(),
            problem: Some(problem.digest()),
        });
        course
    }

    fn note(&mut self, event: Event) {
        self.entries.push(Entry {
            at_ms: milliseconds(self.now),
            event,
        });
    }

    fn publish(&mut self, state: ModuleSnapshot) {
        self.modules.insert(state.module, state.clone());
        self.note(Event::State(state));
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

    /// A unit undocks from the links that the plan breaks, moves and docks.
    fn act(&mut self, unit: &ActingUnit, speed_units_per_s: f64) {
        let placements = &unit.placements;
        for &(module, _) in placements {
            self.undock(module);
            self.change(module, |state| state.phase = ModulePhase::Moving);
        }
        let longest = placements
            .iter()
            .filter_map(|&(module, spot)| {
                let spot = self.problem.target().spot(spot)?;
                Some(self.modules.get(&module)?.pose.distance_to(&spot.pose))
            })
            .max()
            .unwrap_or_default();
        // All drives of a unit take the time of its longest path.
        let goal = MotionGoal {
            pose: Pose::default(),
            pivot: None,
            unit_distance: longest,
        };
        let mut drive = SimulatedDrive::new(goal.pose, speed_units_per_s, Duration::MAX);
        drive.go(Duration::ZERO, goal);
        self.now += drive.time_left(Duration::ZERO).unwrap_or_default();
        for &(module, spot) in placements {
            let Some(spot) = self.problem.target().spot(spot).copied() else {
                continue;
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
