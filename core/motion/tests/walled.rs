//! Between walls: whatever connected target lies in a connected free region, single modules form it.

#![allow(clippy::cast_possible_truncation, reason = "maps are small")]

use std::sync::Arc;

use formation_model::{ModuleId, MotionPlan, PlanningProblem, SpotId};
use formation_motion::paths::{MotionError, MotionParameters, MotionRequest, plan_motion};
use formation_planner::{PlanOutcome, plan};

use crate::support::Numbers;
use crate::support::motion::{assert_sound, run, waits_of};
use crate::support::walls::Field;

fn motion_of(problem: &PlanningProblem, outcome: &PlanOutcome) -> Result<MotionPlan, MotionError> {
    let surroundings = problem.target().surroundings();
    plan_motion(&MotionRequest {
        problem,
        plan: &outcome.plan,
        obstacles: surroundings.obstacles(),
        walls: surroundings.arena(),
        parameters: MotionParameters::default(),
    })
}

/// All modules keep to free cells, and no execution has contact.
fn assert_formed(field: &Field, seed: u64) -> MotionPlan {
    let problem = field.problem();
    let outcome = plan(Arc::clone(&problem));
    let found = motion_of(&problem, &outcome);
    let motion = found.unwrap_or_else(|error| panic!("seed {seed}: {error}\n{field:?}"));
    assert_sound(&problem, &outcome, &motion);
    let paths = motion.units.iter().flat_map(|unit| &unit.modules);
    for waypoint in paths.flat_map(|path| &path.waypoints) {
        let along = |of: f64| of.round() as i64;
        let (x, y) = (waypoint.pose.x.to_units(), waypoint.pose.y.to_units());
        assert!(field.is_free((along(x), along(y))), "({x}, {y}) is a wall");
    }
    let found = run(&motion, &waits_of(&motion), 3, &mut Numbers(seed));
    assert!(found.is_empty(), "seed {seed}: {:?}", &found[..1]);
    motion
}

/// The spots divide the free cells, and modules stand on each side.
#[test]
fn a_target_that_divides_the_free_cells_is_filled_from_each_side() {
    let maps = [
        "
        ..#.....
        ..#.b..e
        ..#.4###
        d.#3126.
        ..#.5...
        ..####..
        .a..c...
        ...f....
        ",
        "
        e....#..
        ..b..#..
        ..####..
        ...4....
        ..3126..
        ..#5c###
        f.#.a...
        d.#.....
        ",
        "
        d.......
        .......f
        53####..
        21#.....
        64#c....
        ..#..###
        ae#.....
        ..#..b..
        ",
    ];
    for map in maps {
        assert_formed(&Field::drawn(map), 1);
    }
}

#[test]
fn a_dead_end_is_filled_from_its_end() {
    assert_formed(
        &Field::drawn(
            "
            ..#..#..
            ...35#.f
            ..#12#..
            ..#46#c.
            ..#..#e.
            ..#..#..
            ..#.....
            bd#....a
            ",
        ),
        1,
    );
}

/// Module 1 stands in the mouth of the corridor. The total distance is the same whichever takes the spot at the end.
#[test]
fn a_module_leaves_a_corridor_for_one_that_goes_further_in() {
    let field = Field::drawn(
        "
        ...#####
        ..b.a12#
        ...#####
        ",
    );
    assert_formed(&field, 1);
}

/// The module that is farthest from the root of the target arrives first, and docks when the others are there.
#[test]
fn modules_arrive_before_those_to_which_they_dock() {
    let field = Field::drawn(
        "
        ####..........
        #1234...a.b.c.
        ####.....d....
        ",
    );
    let motion = assert_formed(&field, 1);
    let arrival = |module: ModuleId| {
        let unit = motion.units.iter().find(|unit| unit.lead == module);
        let unit = unit.unwrap();
        unit.modules[0].waypoints.last().unwrap().time
    };
    let waits_undocked = motion.units.iter().any(|unit| {
        unit.docked_at.unwrap() > arrival(unit.lead)
            && unit
                .parent
                .is_some_and(|parent| arrival(parent) > arrival(unit.lead))
    });
    assert!(waits_undocked, "{motion:?}");
}

fn assert_all_formed(fields: impl Fn(&mut Numbers) -> Field, seeds: std::ops::Range<u64>) {
    for seed in seeds {
        let mut numbers = Numbers(seed);
        let count = 10 * (1 + numbers.below(3));
        let field = fields(&mut numbers).filled(count, &mut numbers);
        assert_formed(&field, seed);
    }
}

#[test]
fn every_target_in_a_maze_is_formed() {
    assert_all_formed(Field::maze, 0..20);
}

#[test]
fn every_target_in_rooms_is_formed() {
    assert_all_formed(Field::rooms, 0..20);
}

/// Why there is no motion when each module takes the spot of its number.
fn refused(problem: &Arc<PlanningProblem>) -> String {
    let mut outcome = plan(Arc::clone(problem));
    let plan = &mut outcome.plan;
    let spots: Vec<SpotId> = plan.assignments.values().copied().collect();
    plan.assignments = spots.iter().map(|&spot| (ModuleId(spot.0), spot)).collect();
    for unit in &mut plan.assembly.units {
        unit.lead = ModuleId(unit.placements[0].1.0);
        for (module, spot) in &mut unit.placements {
            *module = ModuleId(spot.0);
        }
    }
    motion_of(problem, &outcome).unwrap_err().to_string()
}

#[test]
fn modules_that_cannot_pass_each_other_are_named() {
    assert_eq!(
        refused(&Field::drawn("b.a.12").problem()),
        "module 2 cannot reach spot 2: no way past module 1"
    );
}

/// A module that stays on its spot closes the corridor.
#[test]
fn a_pinned_module_that_closes_the_way_is_named() {
    let problem = Field::drawn("b.A2").problem();
    let mut modules = problem.modules().to_vec();
    modules[0].pin = Some(SpotId(1));
    let target = Arc::clone(problem.target());
    let problem = PlanningProblem::new(target, *problem.parameters(), modules).unwrap();
    assert_eq!(
        refused(&Arc::new(problem)),
        "module 2 cannot reach spot 2: walled in by spot 1"
    );
}

/// Both stand on spots, and no other cell is free.
#[test]
fn modules_without_a_free_cell_cannot_move() {
    let mut field = Field::drawn("12");
    field.starts = [(1, (1, 0)), (2, (0, 0))].into();
    assert_eq!(
        refused(&field.problem()),
        "module 2 cannot reach spot 2: the spots leave no cell free"
    );
}
