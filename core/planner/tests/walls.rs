//! Obstacles, walls, bodies and settled modules in the choice of spots.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt::Write as _;
use std::sync::Arc;

use formation_model::{
    Area, Decision, MicroUnits, ModuleId, PlannerParameters, PlanningProblem, Policy, Scenario,
    SpotId,
};
use formation_planner::{Barrier, Explanation, PlanOutcome, Planning, plan};
use formation_verify::{check_plan, hole_of};

use crate::support::{Numbers, with_parameters};

const POLICIES: [Policy; 4] = [
    Policy::Exact,
    Policy::Paper,
    Policy::Auction,
    Policy::Hungarian,
];

/// Two rooms without a door. Module 2 is nearest to spot 2, in the other room.
const ROOMS: &str = "
target: {spots: [{id: 1, x: 3, y: 0}, {id: 2, x: 3, y: 1}], edges: [[1, 2]]}
singletons: [{id: 1, x: 2, y: 0}, {id: 2, x: 5, y: 1}, {id: 3, x: -4, y: 1}]
obstacles: [{x: 4, y: 0, width: 1, height: 9}]
arena: {x: 1.5, y: 0, width: 14, height: 9}
";

/// A wall with an open end, between module 1 and the spot.
const SCREEN: &str = "
target: {spots: [{id: 1, x: 0, y: 0}], edges: []}
singletons: [{id: 1, x: 2, y: 0}, {id: 2, x: -4, y: 0}]
obstacles: [{x: 1, y: 0, width: 1, height: 5}]
";

fn read(text: &str) -> Arc<PlanningProblem> {
    Arc::new(Scenario::from_yaml(text).unwrap().problem().clone())
}

fn under(problem: &PlanningProblem, policy: Policy) -> Arc<PlanningProblem> {
    let parameters = match policy {
        Policy::Paper => PlannerParameters::of_paper(formation_model::PaperBundle::Literal),
        _ => PlannerParameters {
            policy,
            ..PlannerParameters::default()
        },
    };
    with_parameters(problem, parameters)
}

fn assignments(outcome: &PlanOutcome) -> Vec<(u32, u32)> {
    let assignments = outcome.plan.assignments.iter();
    assignments
        .map(|(module, spot)| (module.0, spot.0))
        .collect()
}

fn assert_sound(problem: &PlanningProblem, outcome: &PlanOutcome) {
    let decisions: Vec<Decision> = outcome
        .decisions
        .iter()
        .map(|(_, decision)| decision.clone())
        .collect();
    let checked = check_plan(problem, &decisions, &outcome.plan);
    assert_eq!(checked.err(), None);
}

#[test]
fn what_cannot_be_reached_is_no_candidate_under_any_policy() {
    for policy in POLICIES {
        let problem = under(&read(ROOMS), policy);
        let outcome = plan(Arc::clone(&problem));
        assert_eq!(assignments(&outcome), [(1, 1), (3, 2)], "{policy:?}");
        assert_eq!(outcome.cut_off, [ModuleId(2)]);
        assert_eq!(outcome.unassigned, [ModuleId(2)]);
        assert_sound(&problem, &outcome);
        assert_eq!(hole_of(&problem, &outcome.plan), []);
        let cut_off = Explanation::of(&problem, &outcome, ModuleId(2)).unwrap();
        assert!(cut_off.cut_off && cut_off.alternatives.is_empty());
        let wall = problem.target().surroundings().obstacles()[0];
        assert_eq!(cut_off.barrier, Some(Barrier::Obstacle(wall)));
    }
}

#[test]
fn spots_stay_open_for_which_there_are_too_few_modules_within_reach() {
    for policy in POLICIES {
        let text = ROOMS.replace("{id: 3, x: -4, y: 1}", "{id: 3, x: 6, y: 1}");
        let problem = under(&read(&text), policy);
        let outcome = plan(Arc::clone(&problem));
        assert_eq!(outcome.plan.assignments.len(), 1, "{policy:?}");
        assert_eq!(outcome.open_spots.len(), 1);
        assert_eq!(outcome.cut_off, [ModuleId(2), ModuleId(3)]);
        assert_sound(&problem, &outcome);
        assert_ne!(hole_of(&problem, &outcome.plan), []);
        // Where none is within reach, nothing is formed.
        let none = under(&read(&text.replace("x: 2, y: 0", "x: 7, y: 0")), policy);
        let outcome = plan(Arc::clone(&none));
        assert!(outcome.plan.assignments.is_empty() && outcome.decisions.is_empty());
        assert_eq!(outcome.open_spots.len(), 2);
        assert_sound(&none, &outcome);
        assert_ne!(hole_of(&none, &outcome.plan), []);
    }
}

#[test]
fn a_module_behind_a_wall_is_as_far_as_its_way() {
    for (policy, nearest) in [
        (Policy::Exact, 2),
        (Policy::Auction, 2),
        (Policy::Hungarian, 2),
        // The paper knows straight ways only.
        (Policy::Paper, 1),
    ] {
        let problem = under(&read(SCREEN), policy);
        let outcome = plan(Arc::clone(&problem));
        assert_eq!(assignments(&outcome), [(nearest, 1)], "{policy:?}");
        assert_eq!(outcome.cut_off, []);
    }
    let problem = read(SCREEN);
    let outcome = plan(Arc::clone(&problem));
    let behind = Explanation::of(&problem, &outcome, ModuleId(1)).unwrap();
    let [alternative] = behind.alternatives.as_slice() else {
        panic!("{behind:?}");
    };
    // Up by three, over, and down again.
    assert_eq!(alternative.detour, MicroUnits(6_000_000));
    let wall = problem.target().surroundings().obstacles()[0];
    assert_eq!(alternative.barrier, Some(Barrier::Obstacle(wall)));
}

#[test]
fn walls_off_all_ways_change_nothing() {
    let open = "
target: {spots: [{id: 1, x: 0, y: 0}, {id: 2, x: 1, y: 0}, {id: 3, x: 2, y: 0}], edges: [[1, 2], [2, 3]]}
singletons: [{id: 1, x: 2.3, y: 4}, {id: 2, x: -4, y: 0.7}, {id: 3, x: 5, y: 1, theta: 0.4}, {id: 4, x: 3, y: -3}]
";
    let plain = plan(read(open));
    for walls in [
        "obstacles: [{x: 40, y: 0, width: 3, height: 90}]",
        "arena: {x: 0, y: 0, width: 30, height: 30}",
        "obstacles: [{x: -900000, y: 0, width: 100, height: 100}]",
    ] {
        let walled = plan(read(&format!("{open}{walls}")));
        assert_eq!(walled.decisions, plain.decisions, "{walls}");
        assert_eq!(walled.total_utility, plain.total_utility);
    }
}

/// A body that is half over two cells closes both; a start between two cells may use either.
#[test]
fn a_start_off_the_lattice_uses_the_cells_under_its_body() {
    let text = |x: f64| {
        format!(
            "
target: {{spots: [{{id: 1, x: 0, y: 0}}], edges: []}}
singletons: [{{id: 1, x: {x}, y: 0}}]
obstacles: [{{x: 2, y: 0, width: 1, height: 3}}]
arena: {{x: 0, y: 0, width: 9, height: 3}}
"
        )
    };
    for (x, reaches) in [(1.3, true), (1.0, true), (2.7, false), (3.4, false)] {
        let outcome = plan(read(&text(x)));
        assert_eq!(outcome.cut_off.is_empty(), reaches, "{x}");
    }
}

#[test]
fn a_body_in_the_door_bars_it() {
    let text = "
target: {spots: [{id: 1, x: 0, y: 0}], edges: []}
singletons: [{id: 1, x: 3, y: 0}, {id: 2, x: -4, y: 0}]
obstacles: [{x: 1, y: 2, width: 1, height: 3}, {x: 1, y: -2, width: 1, height: 3}]
arena: {x: 0, y: 0, width: 11, height: 7}
";
    let open = read(text);
    assert_eq!(assignments(&plan(Arc::clone(&open))), [(1, 1)]);
    let door = |low: i64, high: i64| (MicroUnits(low), MicroUnits(high));
    let body = Area {
        low: door(600_000, -450_000),
        high: door(1_400_000, 450_000),
    };
    let barred = Arc::new(PlanningProblem::clone(&open).with_bodies(vec![body]));
    let outcome = plan(Arc::clone(&barred));
    assert_eq!(assignments(&outcome), [(2, 1)]);
    assert_eq!(outcome.cut_off, [ModuleId(1)]);
    let explained = Explanation::of(&barred, &outcome, ModuleId(1)).unwrap();
    assert_eq!(explained.barrier, Some(Barrier::Body));
    assert_ne!(open.digest(), barred.digest());
}

/// A row with a gap on its far side: the spare on that side fills it, though the other is nearer through the row.
#[test]
fn settled_modules_are_walls_and_never_cut_off() {
    let mut text = String::from("target:\n  spots:\n");
    for (id, x, y) in [
        (1, -1, 0),
        (2, 0, 0),
        (3, 1, 0),
        (4, -1, 1),
        (5, 1, 1),
        (6, 0, 1),
    ] {
        writeln!(text, "    - {{id: {id}, x: {x}, y: {y}}}").unwrap();
    }
    text.push_str("  edges: [[1, 2], [2, 3], [1, 4], [3, 5], [2, 6]]\nsingletons:\n");
    for (id, x, y) in [
        (1, -1, 0),
        (2, 0, 0),
        (3, 1, 0),
        (4, -1, 1),
        (5, 1, 1),
        (7, 0, -1),
        (8, 0, 4),
    ] {
        writeln!(text, "  - {{id: {id}, x: {x}, y: {y}}}").unwrap();
    }
    let free = read(&text);
    let settled = |walled_in: bool| {
        let modules = free.modules().iter().cloned().map(|mut module| {
            module.pin = (module.id.0 <= 5).then_some(SpotId(module.id.0));
            if walled_in && module.id == ModuleId(8) {
                module.pose = free.modules()[5].pose;
                module.pose.y.0 -= 1_000_000;
            }
            module
        });
        let target = Arc::clone(free.target());
        let parameters = *free.parameters();
        Arc::new(PlanningProblem::new(target, parameters, modules.collect()).unwrap())
    };
    let outcome = plan(settled(false));
    assert_eq!(outcome.plan.assignments[&ModuleId(8)], SpotId(6));
    assert_eq!(outcome.cut_off, []);
    let outcome = plan(settled(true));
    assert_eq!(outcome.plan.assignments[&ModuleId(7)], SpotId(6));
}

/// The steps from one cell to all others within a box that is large enough.
fn steps_from(from: (i64, i64), closed: &BTreeSet<(i64, i64)>) -> BTreeMap<(i64, i64), i64> {
    let mut steps = BTreeMap::from([(from, 0)]);
    let mut queue = VecDeque::from([from]);
    while let Some((x, y)) = queue.pop_front() {
        let onward = steps[&(x, y)] + 1;
        for cell in [(x + 1, y), (x, y + 1), (x - 1, y), (x, y - 1)] {
            let is_within = cell.0.abs() <= 20 && cell.1.abs() <= 20;
            if is_within && !closed.contains(&cell) && !steps.contains_key(&cell) {
                steps.insert(cell, onward);
                queue.push_back(cell);
            }
        }
    }
    steps
}

#[test]
fn detours_are_those_of_a_plain_search() {
    let (mut detours, mut cut_off) = (0, 0);
    for seed in 0..200 {
        let mut numbers = Numbers(seed);
        let mut draw = |count: i64| numbers.within(-count, count);
        let spots: Vec<(i64, i64)> = (0..3).map(|x| (x, 0)).collect();
        let mut starts: BTreeSet<(i64, i64)> = (0..6).map(|_| (draw(6), draw(6))).collect();
        starts.retain(|start| !spots.contains(start));
        let mut closed: BTreeSet<(i64, i64)> = (0..60).map(|_| (draw(7), draw(7))).collect();
        closed.retain(|cell| !spots.contains(cell) && !starts.contains(cell));
        if starts.len() < 3 {
            continue;
        }
        let mut text = String::from(
            "target: {spots: [{id: 0, x: 0, y: 0}, {id: 1, x: 1, y: 0}, {id: 2, x: 2, y: 0}], edges: [[0, 1], [1, 2]]}\nsingletons:\n",
        );
        for (id, (x, y)) in starts.iter().enumerate() {
            writeln!(text, "  - {{id: {id}, x: {x}, y: {y}}}").unwrap();
        }
        text.push_str("obstacles:\n");
        for (x, y) in &closed {
            writeln!(text, "  - {{x: {x}, y: {y}, width: 1, height: 1}}").unwrap();
        }
        let problem = read(&text);
        let planning = Planning::new(Arc::clone(&problem));
        let steps: Vec<_> = spots
            .iter()
            .map(|&spot| steps_from(spot, &closed))
            .collect();
        for (module, &(x, y)) in starts.iter().enumerate() {
            let is_cut_off = !steps[0].contains_key(&(x, y));
            assert_eq!(problem.is_cut_off(module), is_cut_off, "seed {seed}");
            cut_off += usize::from(is_cut_off);
            let instance = planning.instance();
            for (spot, place) in instance.target.spots().iter().enumerate() {
                let at = spots[place.id.0 as usize];
                let open = (x - at.0).abs() + (y - at.1).abs();
                let way = steps[place.id.0 as usize].get(&(x, y)).copied();
                let expected = way.unwrap_or(open) - open;
                let detour = instance.utilities.detour(module, spot);
                assert_eq!(detour, MicroUnits(expected * 1_000_000), "seed {seed}");
                detours += usize::from(expected > 0);
            }
        }
        assert_sound(&problem, &plan(Arc::clone(&problem)));
    }
    assert!(detours > 100 && cut_off > 4, "{detours} {cut_off}");
}
