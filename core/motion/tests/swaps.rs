//! Equal units swap their spots where nothing can carry out the claims.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "maps are small"
)]

use std::collections::BTreeSet;
use std::sync::Arc;

use formation_model::{
    Area, MicroUnits, ModuleId, MotionPlan, Plan, PlanningProblem, Policy, Pose, Scenario, SpotId,
};
use formation_motion::PlannedMotion;
use formation_motion::paths::{MotionError, Obstruction};
use formation_planner::plan;

use crate::support::Numbers;
use crate::support::motion::{assert_sound, run, waits_of};
use crate::support::walls::{Cell, Field};

/// The motion of a problem and its plan, without contact in any execution.
pub fn planned(problem: &Arc<PlanningProblem>) -> Result<(MotionPlan, Plan), MotionError> {
    let mut outcome = plan(Arc::clone(problem));
    let claimed = outcome.plan.clone();
    let (motion, plan) = PlannedMotion::of(problem, outcome.plan);
    let motion = match motion {
        PlannedMotion::Paths(motion) => motion,
        PlannedMotion::Refused(error) => return Err(error),
    };
    let spots = |plan: &Plan| -> BTreeSet<SpotId> { plan.assignments.values().copied().collect() };
    assert_eq!(spots(&plan), spots(&claimed));
    let again = PlannedMotion::of(problem, claimed);
    assert_eq!(again, (PlannedMotion::Paths(motion.clone()), plan.clone()));
    outcome.plan = plan;
    assert_sound(problem, &outcome, &motion);
    let found = run(&motion, &waits_of(&motion), 3, &mut Numbers(1));
    assert!(found.is_empty(), "{:?}", &found[..1]);
    Ok((motion, outcome.plan))
}

fn assert_swapped(field: &Field) -> (MotionPlan, Plan) {
    let found = planned(&field.problem());
    let (motion, plan) = found.unwrap_or_else(|error| panic!("{error}\n{field:?}"));
    assert!(!plan.swaps.is_empty(), "{plan:?}");
    (motion, plan)
}

/// A lane of twice `side` cells to the right and as many up, with modules at its begin and spots at its end.
fn bent(count: i64, side: i64) -> Field {
    let right = (0..=2 * side).map(|x| (x, 0));
    let lane: Vec<Cell> = right.chain((1..2 * side).map(|y| (2 * side, y))).collect();
    Field::lane(&lane, count as usize)
}

#[test]
fn rows_pass_a_bent_lane_in_their_order() {
    for (count, makespan) in [(10, 40), (20, 80)] {
        let (motion, plan) = assert_swapped(&bent(count, count));
        assert!(motion.makespan <= makespan, "{}", motion.makespan);
        let mut order: Vec<_> = plan.assignments.iter().collect();
        order.sort_unstable();
        assert!(order.is_sorted_by_key(|(_, spot)| **spot), "{order:?}");
    }
}

/// Two bends, a spiral, and lanes whose legs differ.
#[test]
fn rows_pass_lanes_with_several_bends() {
    let turns: [&[(i64, i64, i64)]; 3] = [
        &[(1, 0, 12), (0, 1, 12), (1, 0, 12)],
        &[(1, 0, 9), (0, 1, 9), (-1, 0, 7), (0, -1, 6), (1, 0, 4)],
        &[(0, 1, 5), (1, 0, 14), (0, 1, 9)],
    ];
    for legs in turns {
        let mut lane = vec![(0, 0)];
        for &(right, up, steps) in legs {
            for _ in 0..steps {
                let &(x, y) = lane.last().unwrap();
                lane.push((x + right, y + up));
            }
        }
        for count in [4, 7, 10] {
            let (_, plan) = planned(&Field::lane(&lane, count).problem()).unwrap();
            let order: Vec<SpotId> = plan.assignments.values().copied().collect();
            assert!(order.is_sorted(), "{order:?}");
        }
    }
}

#[test]
fn modules_swap_in_lanes_of_other_kinds() {
    let maps = [
        // A dead end.
        "
        abcdef.....
        ##########.
        ##########.
        ##########1
        ##########2
        ##########3
        ##########4
        ##########5
        ##########6
        ",
        // Two more modules than spots.
        "
        abcdefgh.....
        ############.
        ############.
        ############1
        ############2
        ############3
        ############4
        ############5
        ############6
        ",
        // A lane that parts, with spots in both arms.
        "
        ..321456..
        ####.#####
        ####.#####
        ####.#####
        ####f#####
        ####e#####
        ####d#####
        ####c#####
        ####b#####
        ####a#####
        ",
        // Two cells wide.
        "
        ########12
        ########34
        ########56
        ########78
        ########..
        ########..
        aceg......
        bdfh......
        ",
    ];
    for map in maps {
        let field = Field::drawn(map);
        planned(&field.problem()).unwrap_or_else(|error| panic!("{error}: {map}"));
    }
    assert_swapped(&Field::drawn(maps[0]));
}

/// In mazes of lanes one cell wide, most of whose cells are taken.
#[test]
fn few_targets_in_lanes_are_refused() {
    let (mut swapped, mut refused) = (0, 0);
    for seed in 0..60 {
        let mut numbers = Numbers(seed);
        let field = Field::lanes(6, 20 * (seed as usize % 2), &mut numbers);
        let free = (field.width * field.height) as usize - field.walls.len();
        let count = free * 3 / 10;
        let mut field = field.filled(count, &mut numbers);
        if seed % 4 < 2 {
            field = field.started_together(count, &mut numbers);
        }
        match planned(&field.problem()) {
            Ok((_, plan)) => swapped += usize::from(!plan.swaps.is_empty()),
            Err(_) => refused += 1,
        }
    }
    assert!(swapped >= 5 && refused <= 1, "{swapped} {refused}");
}

/// A lane with a row of pairs, whose spots lie round the bend.
fn pairs(policy: Policy) -> Arc<PlanningProblem> {
    let spot = |id: u32| format!("{{id: {id}, x: 20, y: {}}}", 9 + id);
    let spots: Vec<String> = (1..=8).map(spot).collect();
    let edges: Vec<String> = (1..8).map(|id| format!("[{id}, {}]", id + 1)).collect();
    let pair = |pair: u32| {
        let (one, other) = (2 * pair + 1, 2 * pair + 2);
        format!(
            "{{id: {one}, modules: [{{id: {one}, x: {}, y: 0}}, {{id: {other}, x: {}, y: 0}}], edges: [[{one}, {other}]]}}",
            2 * pair,
            2 * pair + 1,
        )
    };
    let configurations: Vec<String> = (0..4).map(pair).collect();
    let text = format!(
        "target: {{spots: [{}], edges: [{}]}}\nconfigurations: [{}]\n\
         obstacles: [{{x: 9.5, y: 9, width: 20, height: 17}}]\n\
         arena: {{x: 10, y: 8.5, width: 21, height: 18}}\nplanner: {{policy: {}}}\n",
        spots.join(", "),
        edges.join(", "),
        configurations.join(", "),
        match policy {
            Policy::Paper => "paper",
            _ => "exact",
        },
    );
    Arc::new(Scenario::from_yaml(&text).unwrap().problem().clone())
}

/// No rigid pair gets round the bend, so all move as single modules.
#[test]
fn pairs_are_taken_apart_in_a_bent_lane() {
    let problem = pairs(Policy::Exact);
    let claimed = plan(Arc::clone(&problem)).plan;
    let (motion, plan) = planned(&problem).unwrap();
    assert!(!plan.swaps.is_empty());
    assert_eq!(motion.taken_apart, claimed.blocks);
    assert!(plan.blocks.is_empty() && plan.kept_links.is_empty());
}

#[test]
fn the_policy_paper_swaps_nothing() {
    assert!(planned(&pairs(Policy::Paper)).is_err());
}

/// Pair 1 and 2 stands before pair 3 and 4 and is to go behind it.
#[test]
fn equal_blocks_swap_and_stay_whole() {
    let straight = "
target: {spots: [{id: 1, x: 9, y: 0}, {id: 2, x: 10, y: 0}, {id: 3, x: 11, y: 0}, {id: 4, x: 12, y: 0}], edges: [[1, 2], [2, 3], [3, 4]]}
configurations:
  - {id: 1, modules: [{id: 1, x: 0, y: 0}, {id: 2, x: 1, y: 0}], edges: [[1, 2]]}
  - {id: 2, modules: [{id: 3, x: 2, y: 0}, {id: 4, x: 3, y: 0}], edges: [[3, 4]]}
arena: {x: 6, y: 0, width: 13, height: 1}
";
    let scenario = Scenario::from_yaml(straight).unwrap();
    let problem = scenario.problem();
    let mut claimed = plan(Arc::new(problem.clone())).plan;
    // Claims that nothing can carry out: the pair behind goes in front.
    let far = [(1, 3), (2, 4), (3, 1), (4, 2)];
    claimed.assignments = far
        .map(|(module, spot)| (ModuleId(module), SpotId(spot)))
        .into();
    for unit in &mut claimed.assembly.units {
        for (module, spot) in &mut unit.placements {
            *spot = claimed.assignments[module];
        }
    }
    let (motion, plan) = PlannedMotion::of(problem, claimed.clone());
    assert!(motion.paths().unwrap().taken_apart.is_empty());
    assert_eq!(plan.blocks, claimed.blocks);
    assert_eq!(plan.kept_links, claimed.kept_links);
    assert_eq!(plan.assignments[&ModuleId(4)], SpotId(4));
    assert_eq!(plan.swaps.len(), 4);
}

/// Module 1 is pinned in the mouth of the lane and lets nobody in.
#[test]
fn pinned_modules_swap_nothing() {
    let field = Field::drawn("b.A2");
    let problem = field.problem();
    let mut modules = problem.modules().to_vec();
    modules[0].pin = Some(SpotId(1));
    let target = Arc::clone(problem.target());
    let problem = PlanningProblem::new(target, *problem.parameters(), modules).unwrap();
    let problem = Arc::new(problem);
    if let Ok((_, plan)) = planned(&problem) {
        assert!(plan.swaps.is_empty(), "{:?}", plan.swaps);
    }
}

/// The pair stands in a bay of absent bodies and finds no way as a block. The field in which its modules swap spots with module 8, which
/// comes onto the lattice, is not the one in which the claims were looked at.
#[test]
fn a_swap_that_changes_the_field_is_left_out() {
    let bay = "
target:
  spots: [{id: 1, x: 8, y: 8}, {id: 2, x: 8, y: 9}, {id: 3, x: 8, y: 7}, {id: 5, x: 9, y: 9}, {id: 7, x: 7, y: 7}]
  edges: [[1, 2], [1, 3], [2, 5], [3, 7]]
configurations:
  - {id: 1, modules: [{id: 1, x: 6, y: 5, theta: 1.570796}, {id: 2, x: 6, y: 6, theta: 1.570796}], edges: [[1, 2]]}
singletons: [{id: 6, x: 9, y: 9}, {id: 8, x: 9.29712, y: 8}]
";
    let at = |x, y| Pose::from_units(x, y, 0.0).unwrap();
    let lines = [
        ((5.0, 5.0), (5.0, 8.0)),
        ((5.0, 8.0), (7.0, 8.0)),
        ((6.0, 4.0), (6.0, 4.0)),
        ((7.0, 5.0), (7.0, 4.0)),
        ((7.0, 4.0), (8.0, 4.0)),
        ((8.0, 4.0), (8.0, 6.0)),
    ];
    let width = MicroUnits(900_000);
    let bodies = lines.map(|(from, to): ((f64, f64), (f64, f64))| {
        Area::around_line((&at(from.0, from.1), &at(to.0, to.1)), width)
    });
    let scenario = Scenario::from_yaml(bay).unwrap();
    let problem = scenario.problem().clone().with_bodies(bodies.to_vec());
    let problem = Arc::new(problem);
    let refused = planned(&problem).map(|(_, plan)| plan.swaps).unwrap_err();
    let expected = MotionError::Unreachable {
        modules: vec![ModuleId(2)],
        spots: vec![SpotId(7)],
        reason: Obstruction::NoTurn,
    };
    assert_eq!(refused, expected);
}
