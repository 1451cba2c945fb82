//! Spots off the lattice are reached by exits: every plan is executed with random delays and its bodies are compared.

use std::fmt::Write;
use std::sync::Arc;

use formation_model::{Area, MicroUnits, MotionPlan, PlanningProblem, Pose, Scenario};
use formation_motion::PlannedMotion;
use formation_planner::plan;

use crate::support::Numbers;
use crate::support::exact::contact;

const ROW: f64 = 0.866_025_4;

struct Planned {
    problem: Arc<PlanningProblem>,
    motion: PlannedMotion,
}

fn planned(text: &str) -> Planned {
    planned_among(text, &[])
}

/// With bodies of other modules in the way.
fn planned_among(text: &str, bodies: &[Area]) -> Planned {
    let scenario = Scenario::from_yaml(text).unwrap();
    let problem = scenario.problem().clone().with_bodies(bodies.to_vec());
    let problem = Arc::new(problem);
    let outcome = plan(Arc::clone(&problem));
    let motion = PlannedMotion::of(&problem, outcome.plan).0;
    Planned { problem, motion }
}

/// A failed module rests on a spot of a hexagon, turned; the spots beside it are filled.
#[test]
fn a_round_body_at_rest_leaves_room_beside_it() {
    let text = format!(
        "body: circle
target:
  spots:
    - {{id: 1, x: 0, y: 0}}
    - {{id: 2, x: 1, y: 0}}
    - {{id: 4, x: -0.5, y: {ROW}}}
    - {{id: 5, x: -1, y: 0}}
    - {{id: 6, x: -0.5, y: -{ROW}}}
    - {{id: 7, x: 0.5, y: -{ROW}}}
  edges: [[1, 2], [1, 4], [1, 5], [1, 6], [1, 7]]
singletons:
  - {{id: 1, x: 6, y: 0}}
  - {{id: 2, x: 6, y: 2}}
  - {{id: 3, x: 6, y: 4}}
  - {{id: 4, x: 8, y: 0}}
  - {{id: 5, x: 8, y: 2}}
  - {{id: 6, x: 8, y: 4}}
"
    );
    let body = Pose::from_units(0.5, ROW, 0.6).unwrap();
    let width = MicroUnits(900_000);
    let bodies = Area::of_round_body(&body, width);
    let found = planned_among(&text, &bodies).motion;
    assert!(matches!(found, PlannedMotion::Paths(_)), "{found:?}");
    let square = planned_among(&text, &[Area::of_body(&body, width)]).motion;
    assert!(!matches!(square, PlannedMotion::Paths(_)), "{square:?}");
}

/// Forms a target without contact; every module comes to its spot.
fn formed(text: &str) -> MotionPlan {
    let Planned { problem, motion } = planned(text);
    let PlannedMotion::Paths(motion) = motion else {
        panic!("{motion:?}\n{text}");
    };
    let target = problem.target();
    let mut taken = 0;
    for module in motion.units.iter().flat_map(|unit| &unit.modules) {
        let Some(spot) = module.spot else { continue };
        let last = module.waypoints.last().unwrap().pose;
        let goal = target.spot(spot).unwrap().pose;
        let turned = (last.theta.0 - goal.theta.0).rem_euclid(6_283_185);
        let turned = turned.min(6_283_185 - turned);
        assert!(
            last.distance_to(&goal).0 < 5_000 && turned < 5_000,
            "{last:?} is not {goal:?}"
        );
        taken += 1;
    }
    assert_eq!(taken, target.spots().len().min(problem.modules().len()));
    for unit in &motion.units {
        for module in &unit.modules {
            assert_eq!(module.waypoints.len(), unit.steps.len() + 1);
            for leg in module.waypoints.windows(2) {
                assert!(leg[0].time < leg[1].time);
            }
        }
    }
    let met = contact(&motion, target, 6, &mut Numbers(7));
    assert_eq!(met, None, "{text}");
    motion
}

/// A target of these poses in which spots at most so far apart are joined, and modules that start in rows beside it.
fn scenario(spots: &[(f64, f64, f64)], joined: f64, more: &str) -> String {
    let mut text = format!("{more}\ntarget:\n  spots:\n");
    for (index, (x, y, theta)) in spots.iter().enumerate() {
        writeln!(
            text,
            "    - {{id: {}, x: {x}, y: {y}, theta: {theta}}}",
            index + 1
        )
        .unwrap();
    }
    let mut edges = Vec::new();
    for (index, one) in spots.iter().enumerate() {
        for (before, other) in spots[..index].iter().enumerate() {
            if (one.0 - other.0).hypot(one.1 - other.1) < joined {
                edges.push(format!("[{}, {}]", before + 1, index + 1));
            }
        }
    }
    writeln!(text, "  edges: [{}]", edges.join(", ")).unwrap();
    if more.contains("configurations") || more.contains("singletons") {
        return text;
    }
    text.push_str("singletons:\n");
    for index in 0..spots.len() {
        let (x, y) = (12 + 2 * (index % 5), 2 * (index / 5));
        writeln!(text, "  - {{id: {}, x: {x}, y: {y}}}", index + 1).unwrap();
    }
    text
}

/// The spots of a hexagonal disc.
fn hexagon(radius: i32) -> Vec<(f64, f64, f64)> {
    let mut spots = Vec::new();
    for row in -radius..=radius {
        for column in (-radius).max(-radius - row)..=radius.min(radius - row) {
            let (column, row) = (f64::from(column), f64::from(row));
            spots.push((column + row / 2.0, row * ROW, 0.0));
        }
    }
    spots
}

/// A block of spots whose frame is at a point and turned.
fn block(width: u32, height: u32, (x, y): (f64, f64), turned: f64) -> Vec<(f64, f64, f64)> {
    let (sine, cosine) = turned.sin_cos();
    let cells = (0..height).flat_map(|up| (0..width).map(move |right| (right, up)));
    cells
        .map(|(right, up)| (f64::from(right), f64::from(up)))
        .map(|(right, up)| {
            (
                x + right * cosine - up * sine,
                y + right * sine + up * cosine,
                turned,
            )
        })
        .collect()
}

#[test]
fn round_modules_form_hexagons() {
    for radius in 1..=3 {
        formed(&scenario(&hexagon(radius), 1.1, "body: circle"));
    }
}

#[test]
fn rows_offset_by_half_are_laid_like_bricks() {
    for offset in [0.5, 0.25] {
        let spots: Vec<_> = (0..4)
            .flat_map(|row| (0..5).map(move |column| (row, f64::from(column))))
            .map(|(row, column)| (column + offset * f64::from(row % 2), f64::from(row), 0.0))
            .collect();
        formed(&scenario(&spots, 1.2, ""));
    }
}

#[test]
fn gaps_of_any_width_are_left() {
    let row: Vec<_> = (0..6)
        .map(|index| (1.3 * f64::from(index), 0.0, 0.0))
        .collect();
    formed(&scenario(&row, 1.4, ""));
    let sparse: Vec<_> = (0..6)
        .map(|index| (2.0 * f64::from(index), 0.0, 0.0))
        .collect();
    formed(&scenario(&sparse, 2.1, ""));
    let groups = [block(3, 2, (0.0, 0.0), 0.0), block(3, 3, (4.4, 0.7), 0.0)].concat();
    formed(&scenario(&groups, 2.6, ""));
    let narrow: Vec<_> = (0..6)
        .map(|index| (0.95 * f64::from(index), 0.0, 0.0))
        .collect();
    formed(&scenario(&narrow, 1.0, ""));
}

#[test]
fn one_spot_beside_a_block_is_off_its_lattice() {
    for spot in [
        (3.2, 0.4, 0.0),
        (1.4, 3.0, 0.0),
        (-1.3, 1.1, 0.6),
        (1.0, 3.3, 3.0),
    ] {
        for spots in [
            [block(3, 3, (0.0, 0.0), 0.0), vec![spot]].concat(),
            [vec![spot], block(3, 3, (0.0, 0.0), 0.0)].concat(),
        ] {
            formed(&scenario(&spots, 1.6, ""));
        }
    }
}

#[test]
fn parts_are_turned_against_each_other() {
    let turned = 20.0_f64.to_radians();
    formed(&scenario(&block(8, 1, (0.0, 0.0), turned), 1.1, ""));
    formed(&scenario(&block(3, 3, (0.0, 0.0), turned), 1.1, ""));
    let parts = [
        block(3, 3, (0.0, 0.0), 0.0),
        block(4, 2, (3.5, 1.0), turned),
    ]
    .concat();
    formed(&scenario(&parts, 1.7, ""));
    let parts = [
        block(3, 1, (0.0, 0.0), 0.0),
        block(3, 1, (3.2, 0.2), turned),
        block(2, 2, (6.5, 1.9), 0.8),
    ]
    .concat();
    formed(&scenario(&parts, 1.9, ""));
    formed(&scenario(&parts, 1.9, "body: circle"));
}

/// A row of docked modules for `scenario`: their identifiers from a first one, where the first stands, and the heading.
fn docked_row(first: u32, count: u32, (x, y): (f64, f64), heading: f64) -> String {
    let (sine, cosine) = heading.sin_cos();
    let mut text = format!("  - id: {first}\n    modules:\n");
    for index in 0..count {
        let along = f64::from(index);
        let (x, y) = (x + along * cosine, y + along * sine);
        let id = first + index;
        writeln!(
            text,
            "      - {{id: {id}, x: {x}, y: {y}, theta: {heading}}}"
        )
        .unwrap();
    }
    let edges = (first..first + count - 1).map(|id| format!("[{id}, {}]", id + 1));
    writeln!(
        text,
        "    edges: [{}]",
        edges.collect::<Vec<_>>().join(", ")
    )
    .unwrap();
    text
}

#[test]
fn configurations_leave_the_lattice_as_one_body() {
    let turned = 20.0_f64.to_radians();
    let row = docked_row(1, 3, (12.0, 0.0), 0.0);
    for heading in [0.0, turned, 1.2, 2.9] {
        let spots = block(3, 1, (0.0, 0.0), heading);
        let motion = formed(&scenario(&spots, 1.1, &format!("configurations:\n{row}")));
        assert!(motion.taken_apart.is_empty(), "{:?}", motion.taken_apart);
    }
    let rows = row + &docked_row(4, 3, (12.0, 5.0), 0.7);
    let more = format!("configurations:\n{rows}");
    let spots = [
        block(3, 1, (0.0, 0.0), 0.0),
        block(3, 1, (3.4, 0.1), turned),
    ]
    .concat();
    let motion = formed(&scenario(&spots, 1.5, &more));
    assert!(motion.taken_apart.is_empty(), "{:?}", motion.taken_apart);
    // A row bends into a part of a hexagon, and the rest fill up.
    formed(&scenario(
        &hexagon(1)[..6],
        1.1,
        &format!("body: circle\n{more}"),
    ));
}

#[test]
fn exits_keep_clear_of_walls_and_obstacles() {
    let spots: Vec<_> = (0..4)
        .map(|index| (1.3 * f64::from(index), 0.0, 0.0))
        .collect();
    let walls = "arena: {x: 9.0, y: 1.0, width: 24.0, height: 3.0}
obstacles: [{x: 1.5, y: 1.2, width: 7.0, height: 1.2}]";
    let motion = formed(&scenario(&spots, 1.4, walls));
    let waypoints = motion.units.iter().flat_map(|unit| &unit.modules);
    for waypoint in waypoints.flat_map(|module| &module.waypoints) {
        let (x, y) = (waypoint.pose.x.to_units(), waypoint.pose.y.to_units());
        assert!(y > -0.05 && (y < 0.15 || x > 5.45), "{x} {y}");
    }
}

#[test]
fn hexagons_are_starts_of_the_next_plan() {
    let mut modules = String::from("body: circle\nconfigurations:\n  - id: 1\n    modules:\n");
    let spots = hexagon(1);
    for (index, (x, y, _)) in spots.iter().enumerate() {
        writeln!(
            modules,
            "      - {{id: {}, x: {}, y: {y}}}",
            index + 1,
            x + 9.0
        )
        .unwrap();
    }
    modules.push_str("    edges: [[1, 2], [1, 3], [1, 4], [4, 5], [4, 6], [4, 7]]\n");
    for target in [block(7, 1, (0.0, 0.0), 0.0), spots] {
        formed(&scenario(&target, 1.1, &modules));
    }
}

#[test]
fn bodies_that_overlap_at_rest_are_refused_by_name() {
    for (spots, more) in [
        (hexagon(1), ""),
        (vec![(0.0, 0.0, 0.0), (0.89, 0.0, 0.0)], "body: circle"),
    ] {
        let PlannedMotion::Refused(error) = planned(&scenario(&spots, 1.1, more)).motion else {
            panic!("the bodies overlap");
        };
        assert_eq!(
            error.to_string(),
            "target: spots 1 and 2: bodies overlap"
                .replace("2", if more.is_empty() { "3" } else { "2" })
        );
    }
}

/// Without one wait of four, some execution has contact: the checker sees it.
#[test]
fn missing_waits_are_found_off_the_lattice() {
    let planned = planned(&scenario(&hexagon(2), 1.1, "body: circle"));
    let PlannedMotion::Paths(mut motion) = planned.motion else {
        panic!("{:?}", planned.motion);
    };
    let mut numbers = Numbers(1);
    for unit in &mut motion.units {
        unit.waits.retain(|_| !numbers.chance(25));
    }
    let met = contact(&motion, planned.problem.target(), 10, &mut numbers);
    assert!(met.is_some());
}

/// Spots at random places and headings, a quarter of them on the lattice, on which bodies do not overlap.
fn scattered(count: usize, is_round: bool, numbers: &mut Numbers) -> Vec<(f64, f64, f64)> {
    let reach = |heading: f64| {
        if is_round || heading == 0.0 {
            0.48
        } else {
            0.65
        }
    };
    let mut spots: Vec<(f64, f64, f64)> = Vec::new();
    while spots.len() < count {
        let mut drawn =
            |below: u32| f64::from(u32::try_from(numbers.below(below as usize)).unwrap()) / 1_000.0;
        let (mut x, mut y, mut heading) = (drawn(9_000), drawn(9_000), drawn(6_000) - 3.0);
        if numbers.chance(25) {
            (x, y, heading) = (x.round(), y.round(), 0.0);
        }
        // The corners of squares along the axes are farther than their sides.
        let corner = if is_round { 1.0 } else { 1.5 };
        let is_apart = |other: &(f64, f64, f64)| {
            (other.0 - x).hypot(other.1 - y) > corner * (reach(heading) + reach(other.2))
        };
        if spots.iter().all(is_apart) {
            spots.push((x, y, heading));
        }
    }
    spots
}

#[test]
fn scattered_spots_are_taken_without_contact() {
    let mut numbers = Numbers(44);
    for round in 0..60 {
        let is_round = round % 2 == 0;
        let spots = scattered(4 + numbers.below(7), is_round, &mut numbers);
        let more = if is_round { "body: circle" } else { "" };
        // All joined, as who docks to whom does not matter here.
        formed(&scenario(&spots, 30.0, more));
    }
}

/// A round module turns in a lane in which a square one has no room to.
#[test]
fn round_modules_turn_within_their_cells() {
    let lane = "
arena: {x: 4, y: 0, width: 9, height: 1}
target: {spots: [{id: 1, x: 0, y: 0, theta: 1.5707963}], edges: []}
singletons: [{id: 1, x: 6, y: 0}]
";
    assert!(matches!(planned(lane).motion, PlannedMotion::Refused(_)));
    formed(&format!("body: circle\n{lane}"));
}
