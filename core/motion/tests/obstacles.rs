//! Obstacles and walls of a target: paths lead around them, and what they close is named.

use std::sync::Arc;

use formation_model::{ModuleId, Scenario, SpotId};
use formation_motion::PlannedMotion;
use formation_motion::paths::Obstruction;
use formation_planner::plan;

/// How the modules of a scenario move.
fn planned(text: &str) -> PlannedMotion {
    let scenario = Scenario::from_yaml(text).unwrap();
    let problem = Arc::new(scenario.problem().clone());
    let outcome = plan(Arc::clone(&problem));
    PlannedMotion::of(&problem, outcome.plan).0
}

#[test]
fn paths_lead_around_the_obstacles_of_a_target_however_long() {
    // The wall is longer than the margin around starts and spots.
    let text = "
target: {map: 'o-o-o'}
singletons: [{id: 1, x: 0, y: 5}, {id: 2, x: 2, y: 5}, {id: 3, x: 4, y: 5}]
obstacles: [{x: 0, y: 2, width: 61, height: 1}]
";
    let PlannedMotion::Paths(motion) = planned(text) else {
        panic!("{:?}", planned(text));
    };
    assert!(motion.bound > 50, "{}", motion.bound);
    let waypoints = motion.units.iter().flat_map(|unit| &unit.modules);
    for waypoint in waypoints.flat_map(|module| &module.waypoints) {
        let (x, y) = (waypoint.pose.x.to_units(), waypoint.pose.y.to_units());
        assert!((y - 2.0).abs() > 0.99 || x.abs() > 30.99, "{x} {y}");
    }
}

/// Modules stand on spots, and between them and the walls.
#[test]
fn an_open_ring_is_formed_in_an_arena_of_its_size() {
    let text = "
arena: {x: 2.0, y: 1.0, width: 5.0, height: 3.0}
target:
  map: |
    o-o-o
        |
        o
        |
    o-o-o
modules:
  map: |
    a b   d e

    f   h i

    k
";
    let motion = planned(text);
    assert!(matches!(motion, PlannedMotion::Paths(_)), "{motion:?}");
}

#[test]
fn no_module_moves_through_obstacles_and_the_reason_is_named() {
    let cases = [
        (
            "arena: {x: 1.5, y: 0, width: 4, height: 1}
target: {spots: [{id: 1, x: 3, y: 0, theta: 1.5708}], edges: []}
singletons: [{id: 1, x: 0, y: 0}]
",
            "module 1 cannot reach spot 1: no room to turn on the path",
        ),
        (
            "target: {map: 'o-o'}
singletons: [{id: 1, x: 5, y: 0}, {id: 2, x: 8, y: 0}]
obstacles: [{x: 8.8, y: 0, width: 1, height: 1}]
",
            "starts: module 2 is on an obstacle or another body, or beyond the walls",
        ),
    ];
    for (text, expected) in cases {
        match planned(text) {
            PlannedMotion::Refused(error) => assert_eq!(error.to_string(), expected),
            other => panic!("{other:?} {expected}"),
        }
    }
}

#[test]
fn the_spots_that_wall_in_are_listed_by_number() {
    let walled = Obstruction::WalledIn(vec![SpotId(3), SpotId(7)]);
    assert_eq!(walled.to_string(), "walled in by spots 3 and 7");
    let passed = Obstruction::NoPassing(vec![ModuleId(4)]);
    assert_eq!(passed.to_string(), "no way past module 4");
}
