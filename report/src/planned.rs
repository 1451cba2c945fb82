//! What carrying out a plan would look like: its turns, then one unit after another on straight ways.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use formation::event_log::{Entry, Event, ModuleSnapshot};
use formation::model::{
    ActingUnit, Epoch, MicroUnits, ModuleId, ModulePhase, PlanningProblem, SpotId,
};
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
    /// Who takes which spot.
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
            course.tell(ModuleSnapshot {
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
        });
        course
    }

    fn note(&mut self, event: Event) {
        self.entries.push(Entry {
            at_ms: u64::try_from(self.now.as_millis()).unwrap_or(u64::MAX),
            event,
        });
    }

    fn tell(&mut self, told: ModuleSnapshot) {
        self.modules.insert(told.module, told.clone());
        self.note(Event::State(told));
    }

    /// Lets a module tell that something about it has changed.
    fn change(&mut self, module: ModuleId, change: impl FnOnce(&mut ModuleSnapshot)) {
        if let Some(known) = self.modules.get(&module) {
            let mut told = known.clone();
            change(&mut told);
            if told != *known {
                self.tell(told);
            }
        }
    }

    /// All have agreed; those with a spot wait for their unit's turn.
    fn wait_for_turns(&mut self) {
        let plan = &self.outcome.plan;
        let units: BTreeMap<ModuleId, &ActingUnit> = plan
            .assembly
            .units
            .iter()
            .flat_map(|unit| {
                unit.placements
                    .iter()
                    .map(move |&(module, _)| (module, unit))
            })
            .collect();
        for module in self.problem.modules() {
            self.change(module.id, |told| {
                told.spot = plan.assignments.get(&module.id).copied();
                let unit = units.get(&module.id);
                told.unit = unit.map(|unit| unit.lead);
                told.phase = match unit {
                    Some(unit) if unit.pinned => ModulePhase::Settled,
                    Some(_) => ModulePhase::Waiting,
                    None => ModulePhase::Spare,
                };
            });
        }
    }

    /// A unit lets go of what the plan breaks, goes and docks.
    fn act(&mut self, unit: &ActingUnit, speed_units_per_s: f64) {
        let ways: Vec<(ModuleId, SpotId)> = unit.placements.clone();
        for &(module, _) in &ways {
            self.undock(module);
            self.change(module, |told| told.phase = ModulePhase::Moving);
        }
        let longest = ways
            .iter()
            .filter_map(|&(module, spot)| {
                let spot = self.problem.target().spot(spot)?;
                Some(self.modules.get(&module)?.pose.distance_to(&spot.pose))
            })
            .max()
            .unwrap_or_default();
        self.now += self.travel_time(unit, longest, speed_units_per_s);
        for &(module, spot) in &ways {
            let Some(spot) = self.problem.target().spot(spot).copied() else {
                continue;
            };
            let docked = self.docked_at(spot.id);
            for &other in &docked {
                self.change(other, |told| {
                    told.links.insert(module);
                });
            }
            self.change(module, |told| {
                told.pose = spot.pose;
                told.phase = ModulePhase::Settled;
                told.links.extend(docked);
            });
        }
    }

    /// How long the drives of a unit take, which all take equally long.
    fn travel_time(
        &self,
        unit: &ActingUnit,
        longest: MicroUnits,
        speed_units_per_s: f64,
    ) -> Duration {
        let journeys = unit.placements.iter().filter_map(|&(module, spot)| {
            let spot = self.problem.target().spot(spot)?;
            let pose = self.modules.get(&module)?.pose;
            let mut drive = SimulatedDrive::new(pose, speed_units_per_s, Duration::MAX);
            let goal = MotionGoal {
                pose: spot.pose,
                unit_distance: longest,
            };
            drive.go(Duration::ZERO, goal);
            drive.time_left(Duration::ZERO)
        });
        journeys.max().unwrap_or_default()
    }

    /// Lets go of the links that the plan does not keep.
    fn undock(&mut self, module: ModuleId) {
        let kept = &self.outcome.plan.kept_links;
        let broken: BTreeSet<ModuleId> = self
            .modules
            .get(&module)
            .into_iter()
            .flat_map(|told| told.links.iter().copied())
            .filter(|&other| !kept.contains(&(module.min(other), module.max(other))))
            .collect();
        for other in &broken {
            self.change(*other, |told| {
                told.links.remove(&module);
            });
        }
        self.change(module, |told| {
            told.links.retain(|other| !broken.contains(other));
        });
    }

    /// The settled modules beside a spot.
    fn docked_at(&self, spot: SpotId) -> BTreeSet<ModuleId> {
        let beside = self.problem.target().neighbours_of(spot);
        beside
            .filter_map(|spot| self.modules.get(self.holders.get(&spot)?))
            .filter(|told| told.phase == ModulePhase::Settled)
            .map(|told| told.module)
            .collect()
    }
}
