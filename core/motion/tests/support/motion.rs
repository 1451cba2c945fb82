//! Motion plans of generated problems, executed by their waits.

use std::sync::Arc;

use formation_generate::{Apart, GeneratorParameters, Grouping, generate, set_apart};
use formation_model::{
    Area, MicroUnits, ModuleId, MotionPlan, PlanningProblem, Scenario, SpotId, StepKind,
    UnitMotion, Wait,
};
use formation_motion::paths::{MotionError, MotionParameters, MotionRequest, plan_motion};
use formation_planner::PlanOutcome;

use super::Numbers;
use super::bodies::{CELL, Contact, Delays, contacts, execute};

pub struct Case {
    pub modules: usize,
    pub spots: usize,
    pub percent: u32,
    pub grouping: Grouping,
    pub apart: Apart,
    pub seed: u64,
}

impl Case {
    pub fn problem(&self) -> Arc<PlanningProblem> {
        let parameters = GeneratorParameters::new(self.modules, self.spots, self.seed);
        let mut raw = generate(&parameters.grouped(self.grouping)).unwrap();
        set_apart(&mut raw, self.apart, self.percent, self.seed);
        Arc::new(Scenario::try_from(raw).unwrap().problem().clone())
    }
}

pub fn motion(
    problem: &PlanningProblem,
    outcome: &PlanOutcome,
    obstacles: &[Area],
    parameters: MotionParameters,
) -> Result<MotionPlan, MotionError> {
    plan_motion(&MotionRequest {
        problem,
        plan: &outcome.plan,
        obstacles,
        walls: None,
        parameters,
    })
}

pub fn waits_of(plan: &MotionPlan) -> Vec<Vec<Wait>> {
    plan.units.iter().map(|unit| unit.waits.clone()).collect()
}

/// Executes a plan once without and some times with delays; the contacts between cells.
pub fn run(
    plan: &MotionPlan,
    waits: &[Vec<Wait>],
    repeats: usize,
    numbers: &mut Numbers,
) -> Vec<Contact> {
    run_with_bodies(plan, waits, repeats, numbers, CELL)
}

/// The contacts between bodies of that width.
pub fn run_with_bodies(
    plan: &MotionPlan,
    waits: &[Vec<Wait>],
    repeats: usize,
    numbers: &mut Numbers,
    width: f64,
) -> Vec<Contact> {
    let mut found = Vec::new();
    for round in 0..=repeats {
        let delays = if round == 0 {
            Delays::None
        } else {
            Delays::Random
        };
        match execute(plan, waits, delays, numbers) {
            Ok(execution) => {
                if round == 0 {
                    let ends = execution.times.iter().flatten().map(|&(_, end)| end);
                    let makespan = ends.fold(0.0, f64::max);
                    assert!(
                        makespan <= f64::from(plan.makespan) + 1.0e-9,
                        "{makespan} {}",
                        plan.makespan
                    );
                }
                found.extend(contacts(plan, &execution, width));
            }
            Err(stuck) => panic!("deadlock of {stuck:?}"),
        }
    }
    found
}

/// All modules end on their spots, next to their parents, and blocks that do not fold stay rigid.
pub fn assert_sound(problem: &PlanningProblem, outcome: &PlanOutcome, plan: &MotionPlan) {
    assert_sound_within(0.0, problem, outcome, plan);
}

/// The same for poses that are off by up to `off` units in each direction.
pub fn assert_sound_within(
    off: f64,
    problem: &PlanningProblem,
    outcome: &PlanOutcome,
    plan: &MotionPlan,
) {
    for unit in &plan.units {
        for module in &unit.modules {
            assert_eq!(module.waypoints.len(), unit.steps.len() + 1);
            let expected = outcome.plan.assignments.get(&module.module).copied();
            assert_eq!(module.spot, expected);
            let last = module.waypoints.last().unwrap().pose;
            // A pinned module stays where it was measured.
            let is_pinned = problem.module(module.module).unwrap().pin.is_some();
            if let Some(spot) = expected.filter(|_| !is_pinned) {
                let spot = problem.target().spot(spot).unwrap().pose;
                assert!(
                    last.distance_to(&spot) <= MicroUnits(5_000),
                    "{} is off",
                    module.module
                );
            }
        }
        for (index, step) in unit.steps.iter().enumerate() {
            if !matches!(step.kind, StepKind::Move | StepKind::Shift) {
                continue;
            }
            let shift = |module: usize| {
                let points = &unit.modules[module].waypoints;
                let (from, to) = (points[index].pose, points[index + 1].pose);
                (
                    to.x.to_units() - from.x.to_units(),
                    to.y.to_units() - from.y.to_units(),
                )
            };
            // A block that is turned by less than the slack comes into line while it shifts.
            let turned = match step.kind {
                StepKind::Shift => 0.04,
                _ => 0.01,
            };
            let first = shift(0);
            assert!(
                first.0.hypot(first.1) <= 1.01 + 2.0 * off,
                "{:?}",
                unit.lead
            );
            for module in 1..unit.modules.len() {
                let (x, y) = shift(module);
                assert!(
                    (x - first.0).hypot(y - first.1) < turned + 4.0 * off,
                    "{:?} is not rigid",
                    unit.lead
                );
            }
        }
        for step in unit.steps.windows(2) {
            assert!(step[0].begin < step[1].begin);
        }
    }
    assert_next_to_parents(problem, plan);
}

fn assert_next_to_parents(problem: &PlanningProblem, plan: &MotionPlan) {
    let modules = |lead: ModuleId| -> &UnitMotion {
        plan.units.iter().find(|unit| unit.lead == lead).unwrap()
    };
    for unit in &plan.units {
        let Some(parent) = unit.parent else { continue };
        let pairs = unit.modules.iter().flat_map(|one| {
            modules(parent)
                .modules
                .iter()
                .map(move |other| (one, other))
        });
        let position = |spot: Option<SpotId>| problem.target().position_of(spot.unwrap()).unwrap();
        let topology = problem.target().topology();
        let docks = pairs
            .into_iter()
            .any(|(one, other)| topology.has_edge(position(one.spot), position(other.spot)));
        assert!(docks, "{} is not next to {parent}", unit.lead);
    }
}

pub fn cases(seeds: std::ops::Range<u64>) -> impl Iterator<Item = Case> {
    cases_up_to(60, seeds)
}

/// Cases of 5 to `modules_max` modules.
pub fn cases_up_to(modules_max: usize, seeds: std::ops::Range<u64>) -> impl Iterator<Item = Case> {
    seeds.map(move |seed| {
        let mut numbers = Numbers(seed);
        let modules = 5 + numbers.below(modules_max - 4);
        let groupings = [
            Grouping::Singletons,
            Grouping::Mixed,
            Grouping::Configurations(1 + modules / 7),
        ];
        Case {
            modules,
            spots: modules - numbers.below(modules.min(4)) + numbers.below(3),
            percent: 200 + 25 * u32::try_from(numbers.below(5)).unwrap(),
            grouping: groupings[numbers.below(3)],
            apart: [Apart::Circles, Apart::Cells][numbers.below(2)],
            seed,
        }
    })
}
