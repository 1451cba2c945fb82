#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use formation_model::Scenario;

use super::*;

const SECOND: Duration = Duration::from_secs(1);

/// Two modules that stand apart, two that are docked, an obstacle.
const FOUR: &str = "
name: four
target: {spots: [{id: 1, x: 0, y: 0}], edges: []}
singletons: [{id: 1, x: 0, y: 0}, {id: 2, x: 3, y: 0}]
configurations: [{id: 1, modules: [{id: 3, x: 0, y: 5}, {id: 4, x: 1, y: 5}], edges: [[3, 4]]}]
obstacles: [{x: -3, y: 0, width: 1, height: 1}]
";

const ONE: ModuleId = ModuleId(1);
const TWO: ModuleId = ModuleId(2);
const THREE: ModuleId = ModuleId(3);
const FOURTH: ModuleId = ModuleId(4);

fn world(options: WorldOptions) -> World {
    let scenario = Scenario::from_yaml(FOUR).unwrap();
    World::new(scenario.problem(), options)
}

fn pose(x: f64, y: f64, theta: f64) -> CorePose {
    CorePose::from_units(x, y, theta).unwrap()
}

/// Lets time pass in which goals repeat.
fn drive(world: &mut World, goals: &[(ModuleId, CorePose)], time: Duration) {
    let interval = Duration::from_millis(100);
    let mut passed = Duration::ZERO;
    while passed < time {
        for (module, goal) in goals {
            world.handle_goal(*module, goal);
        }
        world.advance(interval);
        passed += interval;
    }
}

fn at(world: &World, module: ModuleId) -> (f64, f64, f64) {
    let pose = world.true_pose(module).unwrap();
    (pose.x.to_units(), pose.y.to_units(), pose.theta.to_units())
}

#[track_caller]
fn assert_at(world: &World, module: ModuleId, expected: (f64, f64, f64), tolerance: f64) {
    let (x, y, theta) = at(world, module);
    let off = [x - expected.0, y - expected.1, theta - expected.2];
    assert!(
        off.iter().all(|off| off.abs() <= tolerance),
        "{module} is at {:?}, not at {expected:?}",
        (x, y, theta)
    );
}

fn dock(other: ModuleId, action: DockingAction, request: u64) -> DockingRequest {
    DockingRequest {
        request,
        action,
        other,
    }
}

/// Repeats a request like a module does, until it is answered or the time is up.
fn ask(
    world: &mut World,
    module: ModuleId,
    request: DockingRequest,
    time: Duration,
) -> Option<Result<(), String>> {
    let interval = Duration::from_millis(500);
    let mut passed = Duration::ZERO;
    while passed < time {
        world.handle_request(module, request);
        drive(world, &[], interval);
        passed += interval;
        if let Some((answered, result)) = world.poll_result() {
            assert_eq!((answered, result.request), (module, request.request));
            return Some(result.outcome);
        }
    }
    None
}

#[test]
fn a_holonomic_robot_reaches_its_goal_and_stops_without_one() {
    let mut world = world(WorldOptions::default());
    let goal = pose(1.0, 1.0, 1.5);
    drive(&mut world, &[(ONE, goal)], 4 * SECOND);
    assert_at(&world, ONE, (1.0, 1.0, 1.5), 0.01);
    drive(&mut world, &[(ONE, pose(20.0, 1.0, 1.5))], SECOND);
    drive(&mut world, &[], 3 * SECOND);
    let stopped = at(&world, ONE);
    assert!(stopped.0 > 2.0 && stopped.0 < 5.0, "{stopped:?}");
    drive(&mut world, &[], SECOND);
    assert_at(&world, ONE, stopped, 1e-4);
}

#[test]
fn a_differential_robot_reaches_a_goal_at_its_side() {
    let drive_kind = crate::DriveKind::Differential;
    let mut world = world(WorldOptions {
        drive: drive_kind,
        ..WorldOptions::default()
    });
    drive(&mut world, &[(ONE, pose(0.0, 2.0, 0.0))], 12 * SECOND);
    assert_at(&world, ONE, (0.0, 2.0, 0.0), 0.02);
}

#[test]
fn a_robot_that_is_pushed_moves_and_is_not_penetrated() {
    let mut world = world(WorldOptions::default());
    drive(&mut world, &[(ONE, pose(6.0, 0.0, 0.0))], 6 * SECOND);
    let (pusher, pushed) = (at(&world, ONE), at(&world, TWO));
    assert!(pushed.0 > 3.2, "{pushed:?} was not pushed");
    assert!(
        pushed.0 - pusher.0 > 0.9 - 0.01,
        "{pusher:?} is in {pushed:?}"
    );
    let report = world.report();
    assert_eq!(report.contacts, 1, "{report:?}");
    assert_eq!(report.contacts_above_touch, 1, "{report:?}");
    assert!(report.fastest_contact > 0.8, "{report:?}");
    assert!(report.deepest_overlap < 0.02, "{report:?}");
}

#[test]
fn obstacles_hold() {
    let mut world = world(WorldOptions::default());
    drive(&mut world, &[(ONE, pose(-6.0, 0.0, 0.0))], 6 * SECOND);
    assert_at(&world, ONE, (-2.05, 0.0, 0.0), 0.02);
    assert_eq!(world.report().wall_contacts, 1);
}

#[test]
fn slip_slows_down() {
    let reached = |slip| {
        let mut world = world(WorldOptions {
            slip,
            ..WorldOptions::default()
        });
        drive(&mut world, &[(ONE, pose(0.0, 20.0, 0.0))], 4 * SECOND);
        at(&world, ONE).1
    };
    let [none, half] = [0.0, 0.5].map(reached);
    assert!(none > 3.5, "{none}");
    assert!(half < 0.85 * none && half > 0.6 * none, "{half} of {none}");
}

#[test]
fn a_docked_pair_moves_as_one_body_and_folds() {
    let mut world = world(WorldOptions::default());
    let there = [(THREE, pose(0.0, 8.0, 0.0)), (FOURTH, pose(1.0, 8.0, 0.0))];
    // The goal of one comes a little later.
    drive(&mut world, &there[..1], Duration::from_millis(400));
    let (one, other) = (at(&world, THREE), at(&world, FOURTH));
    assert!(
        (one.1 - other.1).abs() < 0.2,
        "{one:?} {other:?} are torn apart"
    );
    drive(&mut world, &there, 5 * SECOND);
    assert_at(&world, THREE, (0.0, 8.0, 0.0), 0.01);
    assert_at(&world, FOURTH, (1.0, 8.0, 0.0), 0.01);
    assert_eq!(world.report().folds, 0);
    let folded = [(THREE, pose(0.0, 8.0, 0.0)), (FOURTH, pose(0.0, 9.0, 0.0))];
    drive(&mut world, &folded, 4 * SECOND);
    assert_at(&world, FOURTH, (0.0, 9.0, 0.0), 0.02);
    let report = world.report();
    assert_eq!((report.folds, report.contacts), (1, 0), "{report:?}");
}

#[test]
fn modules_dock_within_the_tolerance_only_and_undock() {
    let mut world = world(WorldOptions::default());
    let request = dock(TWO, DockingAction::Dock, 7);
    assert_eq!(
        ask(&mut world, ONE, request, 4 * SECOND),
        None,
        "they are 3 units apart"
    );
    drive(&mut world, &[(ONE, pose(2.05, 0.05, 0.05))], 4 * SECOND);
    let request = dock(TWO, DockingAction::Dock, 8);
    assert_eq!(ask(&mut world, ONE, request, 4 * SECOND), Some(Ok(())));
    // Its port has led it to its place.
    assert_at(&world, ONE, (2.0, 0.0, 0.0), 0.02);
    let away = [(ONE, pose(2.0, 4.0, 0.0)), (TWO, pose(3.0, 4.0, 0.0))];
    drive(&mut world, &away, 6 * SECOND);
    assert_at(&world, TWO, (3.0, 4.0, 0.0), 0.01);
    let request = dock(TWO, DockingAction::Undock, 9);
    assert_eq!(ask(&mut world, ONE, request, SECOND), Some(Ok(())));
    drive(&mut world, &[(ONE, pose(0.0, 4.0, 0.0))], 4 * SECOND);
    assert_at(&world, ONE, (0.0, 4.0, 0.0), 0.01);
    assert_at(&world, TWO, (3.0, 4.0, 0.0), 0.01);
}

#[test]
fn an_attempt_that_fails_is_not_answered_and_repeats() {
    let mut world = world(WorldOptions {
        docking_failure: 0.8,
        ..WorldOptions::default()
    });
    drive(&mut world, &[(ONE, pose(2.0, 0.0, 0.0))], 4 * SECOND);
    let request = dock(TWO, DockingAction::Dock, 7);
    assert_eq!(ask(&mut world, ONE, request, 60 * SECOND), Some(Ok(())));
    let report = world.report();
    assert!(report.docking_failures > 0, "{report:?}");
    assert_eq!(report.docking_attempts, report.docking_failures + 1);
    // An answer that was lost comes again.
    assert_eq!(ask(&mut world, ONE, request, SECOND), Some(Ok(())));
    let unknown = dock(ModuleId(99), DockingAction::Dock, 8);
    let answer = ask(&mut world, ONE, unknown, SECOND).unwrap();
    assert_eq!(answer, Err("the world has no other module 99".to_owned()));
}

#[test]
fn poses_are_noisy_late_and_lost_by_the_seed() {
    let poses = |options: WorldOptions| {
        let mut world = world(options);
        let mut poses = Vec::new();
        for _ in 0..100 {
            world.advance(Duration::from_millis(20));
            poses.extend(std::iter::from_fn(|| world.poll_pose()));
        }
        let lost = world.report().lost_poses;
        (poses, lost)
    };
    let disturbed = WorldOptions {
        noise: 0.01,
        heading_noise: 0.02,
        delay: Duration::from_millis(500),
        loss: 0.25,
        ..WorldOptions::default()
    };
    let (exact, none) = poses(WorldOptions::default());
    assert!(
        exact
            .iter()
            .all(|(module, at)| *module != ONE || *at == pose(0.0, 0.0, 0.0))
    );
    let (noisy, lost) = poses(disturbed.clone());
    let share = f64::from(u32::try_from(noisy.len()).unwrap())
        / f64::from(u32::try_from(exact.len()).unwrap());
    assert!(
        (0.45..0.65).contains(&share),
        "three quarters of three quarters, and not {share}"
    );
    assert!(none == 0 && lost > 20, "{lost} were lost");
    assert_eq!(poses(disturbed.clone()).0, noisy);
    let other = WorldOptions {
        seed: 2,
        ..disturbed
    };
    assert_ne!(poses(other).0, noisy);
}

#[test]
fn the_same_seed_gives_the_same_motion() {
    let run = || {
        let mut world = world(WorldOptions {
            slip: 0.3,
            noise: 0.01,
            ..WorldOptions::default()
        });
        let goals = [(ONE, pose(2.5, 0.3, 0.0)), (TWO, pose(1.0, 0.0, 0.4))];
        drive(&mut world, &goals, 5 * SECOND);
        (at(&world, ONE), at(&world, TWO), world.report())
    };
    assert_eq!(run(), run());
}

/// A process that did not run for a while catches up a little only, but goals have lost their force meanwhile.
#[test]
fn goals_age_while_the_world_stands_still() {
    let mut world = world(WorldOptions::default());
    drive(&mut world, &[(ONE, pose(0.0, 20.0, 0.0))], SECOND);
    let before = at(&world, ONE).1;
    world.advance(10 * SECOND);
    drive(&mut world, &[], SECOND);
    let after = at(&world, ONE).1;
    assert!(after - before < 0.3, "from {before} to {after}");
}
