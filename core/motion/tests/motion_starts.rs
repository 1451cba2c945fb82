//! Where motion plans may start: apart, halted on the way, measured with errors, between obstacles.

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_model::{
    Area, BODY_WIDTH, MicroUnits, ModuleId, MotionPlan, PlanningModule, PlanningProblem, Pose,
    Scenario, SpotId, StepKind, UnitMotion,
};
use formation_motion::paths::{MotionError, MotionParameters, Obstruction, StartFault};
use formation_planner::plan;

use crate::support::Numbers;
use crate::support::bodies::MEASURED_BODY;
use crate::support::exact::{contact_with_standing, overlap_at};
use crate::support::motion::{
    assert_sound, assert_sound_within, cases, motion, run, run_with_bodies, waits_of,
};

/// Where a module is at a time of the plan, half-way through a step if need be.
fn pose_at(unit: &UnitMotion, module: usize, time: f64) -> Pose {
    let points = &unit.modules[module].waypoints;
    let mut pose = points[0].pose;
    for (step, pair) in unit.steps.iter().zip(points.windows(2)) {
        let share = (time - f64::from(step.begin)).clamp(0.0, 1.0);
        let between = |from: MicroUnits, to: MicroUnits| {
            from.to_units() + (to.to_units() - from.to_units()) * share
        };
        if share > 0.0 {
            let (from, to) = (pair[0].pose, pair[1].pose);
            let (x, y) = (between(from.x, to.x), between(from.y, to.y));
            pose = Pose::from_units(x, y, to.theta.to_units()).unwrap();
        }
    }
    pose
}

/// The problem that is left when all stop at a time: what has docked is pinned, blocks keep their links. None while a
/// group turns or a block folds.
fn stopped_at(problem: &PlanningProblem, plan: &MotionPlan, time: f64) -> Option<PlanningProblem> {
    let mut modules = Vec::new();
    for unit in &plan.units {
        for step in &unit.steps {
            let begin = f64::from(step.begin);
            let stays_on = !matches!(step.kind, StepKind::Turn { .. } | StepKind::Fold { .. });
            let is_turned = !matches!(step.kind, StepKind::Turn { .. }) || begin + 1.0 <= time;
            if !is_turned || (!stays_on && begin - 1.0 < time && time < begin + 2.0) {
                return None;
            }
        }
        let has_docked = unit
            .docked_at
            .is_some_and(|docked| f64::from(docked) <= time);
        let ids: BTreeSet<ModuleId> = unit.modules.iter().map(|module| module.module).collect();
        for (index, module) in unit.modules.iter().enumerate() {
            let old = problem.module(module.module).unwrap();
            let links = &old.links & &ids;
            modules.push(PlanningModule {
                pose: pose_at(unit, index, time),
                pin: module.spot.filter(|_| has_docked),
                links: if time > f64::from(unit.joint_steps) {
                    links
                } else {
                    old.links.clone()
                },
                ..old.clone()
            });
        }
    }
    let target = Arc::clone(problem.target());
    Some(PlanningProblem::new(target, *problem.parameters(), modules).unwrap())
}

#[test]
fn what_is_left_after_a_stop_is_planned_again() {
    let (mut replans, mut with_pins) = (0, 0);
    for case in cases(400..500) {
        let problem = case.problem();
        let outcome = plan(Arc::clone(&problem));
        let planned = motion(&problem, &outcome, &[], MotionParameters::default()).unwrap();
        let mut numbers = Numbers(case.seed);
        let quarters = numbers.below(4 * planned.makespan as usize + 1);
        let time = quarters as f64 / 4.0;
        let Some(rest) = stopped_at(&problem, &planned, time).map(Arc::new) else {
            continue;
        };
        let outcome = plan(Arc::clone(&rest));
        let again = motion(&rest, &outcome, &[], MotionParameters::default());
        let again = again.unwrap_or_else(|error| panic!("seed {} at {time}: {error}", case.seed));
        assert_sound(&rest, &outcome, &again);
        let found = run(&again, &waits_of(&again), 2, &mut numbers);
        assert!(
            found.is_empty(),
            "seed {} at {time}: {:?}",
            case.seed,
            &found[..1]
        );
        replans += 1;
        with_pins += usize::from(rest.modules().iter().any(|module| module.pin.is_some()));
    }
    assert!(replans >= 30 && with_pins >= 15, "{replans} {with_pins}");
}

/// All stand on cells, next to each other, and are measured with an error in position and heading.
#[test]
fn measured_poses_are_starts() {
    const ERROR_MICRO: u32 = 12_000;
    let (mut replans, mut refused) = (0, Vec::new());
    for case in cases(600..700) {
        let problem = case.problem();
        let outcome = plan(Arc::clone(&problem));
        let planned = motion(&problem, &outcome, &[], MotionParameters::default()).unwrap();
        let mut numbers = Numbers(case.seed);
        let time = 3 + numbers.below(planned.makespan as usize);
        let Some(rest) = stopped_at(&problem, &planned, time as f64) else {
            continue;
        };
        let mut measured = |value: MicroUnits| {
            let error = i64::try_from(numbers.below(2 * ERROR_MICRO as usize + 1)).unwrap()
                - i64::from(ERROR_MICRO);
            MicroUnits(value.0 + error)
        };
        let modules = rest.modules().iter().map(|module| PlanningModule {
            pose: Pose {
                x: measured(module.pose.x),
                y: measured(module.pose.y),
                theta: measured(module.pose.theta),
            },
            ..module.clone()
        });
        let target = Arc::clone(rest.target());
        let rest = PlanningProblem::new(target, *rest.parameters(), modules.collect());
        let rest = Arc::new(rest.unwrap());
        let outcome = plan(Arc::clone(&rest));
        replans += 1;
        match motion(&rest, &outcome, &[], MotionParameters::default()) {
            Ok(again) => {
                let off = f64::from(ERROR_MICRO) / 1.0e6;
                assert_sound_within(off, &rest, &outcome, &again);
                let waits = waits_of(&again);
                let found = run_with_bodies(&again, &waits, 1, &mut numbers, MEASURED_BODY);
                assert!(found.is_empty(), "seed {}: {:?}", case.seed, &found[..1]);
            }
            Err(error) => refused.push((case.seed, error.to_string())),
        }
    }
    assert!(replans >= 50 && refused.is_empty(), "{replans} {refused:?}");
}

fn area(low: (f64, f64), high: (f64, f64)) -> Area {
    let micro = |value: f64| MicroUnits::from_units(value).unwrap();
    Area {
        low: (micro(low.0), micro(low.1)),
        high: (micro(high.0), micro(high.1)),
    }
}

/// A scenario of singles in a text: the spots, joined in a row, and the starts.
fn row(spots: &[(f64, f64)], starts: &[(f64, f64, f64)]) -> Arc<PlanningProblem> {
    let mut text = "target:\n  spots:\n".to_owned();
    for (id, (x, y)) in spots.iter().enumerate() {
        text += &format!("    - {{id: {}, x: {x:?}, y: {y:?}}}\n", id + 1);
    }
    text += "  edges: [";
    for id in 1..spots.len() {
        text += &format!("[{id}, {}], ", id + 1);
    }
    text += "]\nsingletons:\n";
    for (id, (x, y, theta)) in starts.iter().enumerate() {
        text += &format!(
            "  - {{id: {}, x: {x:?}, y: {y:?}, theta: {theta:?}}}\n",
            id + 1
        );
    }
    Arc::new(Scenario::from_yaml(&text).unwrap().problem().clone())
}

#[test]
fn starts_that_are_too_close_are_named() {
    let problem = row(
        &[(0.0, 0.0), (1.0, 0.0)],
        &[(5.0, 5.0, 0.5), (5.8, 5.0, 0.5)],
    );
    let outcome = plan(Arc::clone(&problem));
    let found = motion(&problem, &outcome, &[], MotionParameters::default());
    let expected = StartFault::NotApart(ModuleId(1), ModuleId(2));
    assert_eq!(found, Err(MotionError::Starts(vec![expected])));
    // Where they do not overlap, they shift to where there is room to turn; with headings along the axes nothing has to.
    for heading in [0.5, 0.0] {
        let problem = row(
            &[(0.0, 0.0), (1.0, 0.0)],
            &[(5.0, 5.0, heading), (6.2, 5.0, heading)],
        );
        let outcome = plan(Arc::clone(&problem));
        let found = motion(&problem, &outcome, &[], MotionParameters::default());
        assert!(found.is_ok(), "{found:?}");
    }
}

/// Three docked modules that were halted at different moments, and a single one at the corner of the third.
fn askew_next_to_a_single(single: (f64, f64)) -> Arc<PlanningProblem> {
    let starts = [(8.0, 7.0, 0.0), (8.0, 8.0, 0.0), (8.1, 8.9, 0.0)];
    let starts: Vec<_> = starts
        .into_iter()
        .chain([(single.0, single.1, 0.0)])
        .collect();
    let singles = row(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)], &starts);
    let modules = singles.modules().iter().map(|module| PlanningModule {
        links: match module.id.0 {
            2 => [1, 3].map(ModuleId).into(),
            1 | 3 => [ModuleId(2)].into(),
            _ => BTreeSet::new(),
        },
        ..module.clone()
    });
    let modules = modules.collect();
    let problem =
        PlanningProblem::new(Arc::clone(singles.target()), *singles.parameters(), modules);
    Arc::new(problem.unwrap())
}

/// In line, the third would be apart from the single one. It is not where it stands.
#[test]
fn docked_modules_that_are_out_of_line_are_compared_where_they_stand() {
    let problem = askew_next_to_a_single((9.0, 8.0));
    let outcome = plan(Arc::clone(&problem));
    let found = motion(&problem, &outcome, &[], MotionParameters::default());
    let expected = StartFault::NotApart(ModuleId(3), ModuleId(4));
    assert_eq!(found, Err(MotionError::Starts(vec![expected])));

    let problem = askew_next_to_a_single((9.1, 8.0));
    let outcome = plan(Arc::clone(&problem));
    let planned = motion(&problem, &outcome, &[], MotionParameters::default()).unwrap();
    assert_sound_within(0.1, &problem, &outcome, &planned);
    let mut numbers = Numbers(1);
    let waits = waits_of(&planned);
    let contacts = run_with_bodies(&planned, &waits, 20, &mut numbers, MEASURED_BODY);
    assert!(contacts.is_empty(), "{contacts:?}");
}

/// Such as a module that restarts with a pose of its own, away from the modules that it is docked to.
#[test]
fn modules_that_report_docks_over_a_distance_are_no_rigid_block() {
    let singles = row(
        &[(0.0, 0.0), (1.0, 0.0)],
        &[(5.0, 5.0, 0.0), (8.1, 5.0, 0.0)],
    );
    let modules = singles.modules().iter().map(|module| PlanningModule {
        links: BTreeSet::from([ModuleId(3 - module.id.0)]),
        ..module.clone()
    });
    let modules = modules.collect();
    let problem =
        PlanningProblem::new(Arc::clone(singles.target()), *singles.parameters(), modules);
    let problem = Arc::new(problem.unwrap());
    let outcome = plan(Arc::clone(&problem));
    let planned = motion(&problem, &outcome, &[], MotionParameters::default()).unwrap();
    assert_sound(&problem, &outcome, &planned);
    let first = planned.units.iter().flat_map(|unit| unit.steps.first());
    assert!(first.clone().count() > 0);
    assert!(
        first.clone().all(|step| step.kind == StepKind::Regroup),
        "{:?}",
        first.collect::<Vec<_>>()
    );
}

#[test]
fn spots_on_which_bodies_overlap_are_named() {
    let problem = row(
        &[(0.0, 0.0), (0.89, 0.4)],
        &[(5.0, 5.0, 0.0), (8.0, 5.0, 0.0)],
    );
    let outcome = plan(Arc::clone(&problem));
    let found = motion(&problem, &outcome, &[], MotionParameters::default()).unwrap_err();
    assert_eq!(found.to_string(), "target: spots 1 and 2: bodies overlap");
}

#[test]
fn obstacles_are_gone_around_or_named() {
    let problem = row(
        &[(0.0, 0.0), (1.0, 0.0)],
        &[(0.0, 6.0, 0.0), (1.0, 6.0, 0.0)],
    );
    let outcome = plan(Arc::clone(&problem));
    let wall = [area((-4.0, 2.6), (4.0, 3.4))];
    let planned = motion(&problem, &outcome, &wall, MotionParameters::default()).unwrap();
    assert!(planned.bound >= 14, "{}", planned.bound);
    for unit in &planned.units {
        for waypoint in &unit.modules[0].waypoints {
            let (x, y) = (waypoint.pose.x.to_units(), waypoint.pose.y.to_units());
            assert!(x.abs() > 4.0 || (y - 3.0).abs() > 0.8, "({x}, {y})");
        }
    }
    let ring = [
        area((-2.5, 1.5), (3.5, 2.5)),
        area((-2.5, -2.5), (3.5, -1.5)),
        area((-2.5, -2.5), (-1.5, 2.5)),
        area((2.5, -2.5), (3.5, 2.5)),
    ];
    let found = motion(&problem, &outcome, &ring, MotionParameters::default()).unwrap_err();
    assert!(
        matches!(
            &found,
            MotionError::Unreachable {
                reason: Obstruction::Obstacles,
                ..
            }
        ),
        "{found}"
    );
    let covered = motion(
        &problem,
        &outcome,
        &[area((0.6, -0.4), (1.4, 0.4))],
        MotionParameters::default(),
    );
    assert_eq!(covered, Err(MotionError::CoveredSpot(SpotId(2))));
}

/// The third of a row of three that is turned against the lattice has died: the other two have no room to turn beside it.
#[test]
fn a_group_shifts_away_from_a_body_beside_it_before_it_turns() {
    let scenario = Scenario::from_yaml(
        "
target: {map: 'o-o'}
configurations:
  - id: 1
    modules: [{id: 1, x: 20.0, y: 0.0, theta: 0.5}, {id: 2, x: 20.877583, y: 0.479426, theta: 0.5}]
    edges: [[1, 2]]
",
    );
    let body = Pose::from_units(21.755165, 0.958851, 0.5).unwrap();
    let problem = Arc::new(scenario.unwrap().problem().clone());
    let outcome = plan(Arc::clone(&problem));
    let beside = Area::of_turned_body(&body, BODY_WIDTH);
    let found = motion(&problem, &outcome, &beside, MotionParameters::default()).unwrap();
    assert_eq!(found.units.len(), 1, "it stays one block");
    let kinds = found.units[0].steps.iter().map(|step| step.kind);
    let first: Vec<StepKind> = kinds.take(2).collect();
    assert!(matches!(
        first[..],
        [StepKind::Shift, StepKind::Turn { .. }]
    ));
}

/// Beside a body that stays, a module has no room to turn. Wherever it stands there, and however it is turned, it shifts away without
/// touching that body, or says that it cannot.
#[test]
fn a_module_shifts_away_from_a_body_beside_it_without_touching_it() {
    let beside = Pose::from_units(0.0, 0.0, 0.0).unwrap();
    let obstacles = [Area::of_body(&beside, BODY_WIDTH)];
    let mut ways = 0;
    let steps = |first: f64, count: u32| (0..count).map(move |step| first + f64::from(step) * 0.04);
    for heading in [0.2, 0.391626, 0.7, -0.4] {
        for (x, y) in steps(0.92, 6).flat_map(|x| steps(-0.8, 40).map(move |y| (x, y))) {
            let problem = row(&[(6.0, 0.0)], &[(x, y, heading)]);
            if overlap_at(&problem.modules()[0].pose, &beside, problem.target()) {
                continue;
            }
            let outcome = plan(Arc::clone(&problem));
            let found = motion(&problem, &outcome, &obstacles, MotionParameters::default());
            let Ok(found) = found else { continue };
            let contact = contact_with_standing(&found, problem.target(), &[beside]);
            assert_eq!(contact, None, "from {x} {y} {heading}");
            ways += 1;
        }
    }
    assert!(ways > 100, "{ways}");
}
