//! Formations whose modules are moved by drivers outside, which speak through another vendor's DDS.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::io::Write;
use std::process::Stdio;
use std::time::{Duration, Instant};

use formation_tests::{Domain, Finished, Peer, Python, Running, ScenarioFile, scenario_path};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(120);

/// More samples than any test here takes.
const SAMPLES_MAX: usize = 20_000;

/// Runs a shipped scenario, its modules driven by `tests/python/drive_modules.py`.
fn run_driven(scenario: &str, driver: &str, more: &[&str]) -> Option<Finished> {
    run_driven_in(&Domain::for_processes(6), scenario, driver, more)
}

fn run_driven_in(domain: &str, scenario: &str, driver: &str, more: &[&str]) -> Option<Finished> {
    let python = Python::find()?;
    let path = scenario_path(scenario);
    let path = path.to_str().unwrap();
    let driver = format!(
        "{} --scenario '{path}' --speed 20 {driver}",
        python.command("tests/python/drive_modules.py")
    );
    let mut arguments = vec!["run", path, "--json", "--domain", domain];
    arguments.extend(["--modules-per-process", "4", "--driver", &driver]);
    arguments.extend(more);
    let finished = Running::start("formation", domain, &arguments).finish(PATIENCE);
    assert!(
        !finished.stderr.contains("ModuleNotFoundError"),
        "{}\n{}",
        finished.stderr,
        python.advice()
    );
    Some(finished)
}

/// The errors that the launcher logs.
fn errors(run: &Finished) -> Vec<&str> {
    run.stderr
        .lines()
        .filter(|line| line.contains(" ERROR "))
        .collect()
}

/// Shows X2.
#[test]
fn driven_modules_undock_move_dock_and_leave_no_hole() {
    let Some(run) = run_driven("mcs_detach", "", &["--timeout", "60"]) else {
        return;
    };
    assert_eq!(run.status, 0, "{}{}", run.stdout, run.stderr);
    let report = run.json();
    assert_eq!(report["verdict"], "COMPLETE", "{report}");
    assert!(report["broken_links"].as_u64().unwrap() > 0, "{report}");
    assert_eq!(errors(&run), [""; 0]);
}

/// Eight robots that go to a row, and who judges them.
struct Row {
    driver: Driver,
    agent: Running,
    _publisher: Running,
    verifier: Running,
    _file: ScenarioFile,
}

impl Row {
    fn start(python: &Python, domain: &str) -> Self {
        let robots = (0..8).map(|index| {
            let (id, x, y) = (index + 1, 2 * (index % 4), 4 + 2 * (index / 4));
            format!("- {{id: {id}, x: {x}, y: {y}}}\n")
        });
        let row = format!(
            "target: {{map: 'o-o-o-o-o-o-o-o'}}\nsingletons:\n{}",
            robots.collect::<String>()
        );
        let file = ScenarioFile::new("row", &row);
        let announce = ["--scenario", file.path(), "--expected-modules", "8"];
        let agents = ["--modules", "1-8", "--scenario", file.path()];
        let agents = [&agents[..], &["--motion", "external"]].concat();
        let judge = ["--scenario", file.path(), "--json", "--keep-watching"];
        Self {
            driver: start_driver(python, &file, domain, &[]),
            verifier: Running::start("verifier", domain, &judge),
            agent: Running::start("module_agent", domain, &agents),
            _publisher: Running::start("target_publisher", domain, &announce),
            _file: file,
        }
    }

    fn push(&mut self, which: &str, x: f64, y: f64) {
        let hand = self.driver.0.stdin.as_mut().unwrap();
        writeln!(hand, "push {which} {x} {y}").unwrap();
    }

    fn await_log(&self, from: usize, text: &str) {
        let found = self.agent.wait_for_log(from, text, PATIENCE);
        let log = || self.agent.log_since(from);
        assert!(found.is_some(), "`{text}` is not logged: {:#?}", log());
    }

    /// The verdict after so many lines of the verifier, or one after it.
    fn await_complete(&self, from: usize) {
        let is_whole = |text: &str| {
            let line: Value = serde_json::from_str(text).unwrap();
            line["verdict"]["outcome"] == "COMPLETE"
        };
        let mut last = String::new();
        let found = self.verifier.wait_for_line(from, PATIENCE, |line| {
            last.clone_from(&line.text);
            is_whole(&line.text).then_some(())
        });
        let log = || self.agent.log_since(0);
        assert!(found.is_some(), "{last}\n{:#?}", log());
    }
}

/// Shows X14.
#[test]
fn a_robot_that_is_pushed_on_its_way_goes_on_from_where_it_stands() {
    let Some(python) = Python::find() else {
        return;
    };
    let mut row = Row::start(&python, &Domain::alone());
    row.await_log(0, "moving");
    // Farther than it drives to its last goal before it stops.
    row.push("8", 1.5, 8.0);
    row.await_log(0, "the way that its plan lets it take");
    row.await_log(0, "displaced: 8 by");
    row.await_complete(0);
}

/// It goes back as one block: no docks are given up.
/// Shows E3, P1.
#[test]
fn a_finished_structure_of_eight_that_is_shoved_goes_back_as_a_whole() {
    let Some(python) = Python::find() else {
        return;
    };
    let mut row = Row::start(&python, &Domain::alone());
    row.await_complete(0);
    let (logged, judged) = (row.agent.logged(), row.verifier.printed());
    row.push("all", 0.4, -2.3);
    row.await_log(logged, "displaced: ");
    row.await_complete(judged);
    let lines = row.agent.log_since(logged);
    let undocked = lines.iter().filter(|line| line.text.contains("undock"));
    assert_eq!(undocked.count(), 0, "{lines:#?}");
}

/// The first of many samples that a peer takes for which something holds.
fn first(peer: &Peer, holds: impl Fn(&Value) -> bool) -> Value {
    let mut samples = (0..SAMPLES_MAX).map(|_| peer.taken());
    samples.find(|sample| holds(sample)).unwrap()
}

/// Scenarios are in units of 8 cm; goals, states and markers are in metres.
#[test]
fn a_quadruped_of_8_cm_is_formed_by_drivers_without_a_hole() {
    let domain = &*Domain::for_processes(10);
    let arguments = ["--rate", "20", "--ros-args", "-p", "module_size:=0.08"];
    let visualiser = Running::start("visualiser", domain, &arguments);
    let goal_type = "geometry_msgs/msg/PoseStamped";
    let (Some(goals), Some(states), Some(markers)) = (
        Peer::take("module_11/goal_pose", goal_type, false, domain),
        Peer::take(
            "module_states",
            "formation_msgs/msg/ModuleStates",
            true,
            domain,
        ),
        Peer::take(
            "markers",
            "visualization_msgs/msg/MarkerArray",
            true,
            domain,
        ),
    ) else {
        return;
    };
    let limits = ["--timeout", "90", "--session", "0"];
    let run = run_driven_in(domain, "quadruped_8cm", "--speed 0.8", &limits).unwrap();
    assert_eq!(run.status, 0, "{}{}", run.stdout, run.stderr);
    let report = run.json();
    assert_eq!(report["verdict"], "COMPLETE", "{report}");
    assert_eq!(report["open_spots"], json!([]), "{report}");
    assert_eq!(errors(&run), [""; 0]);

    // Module 11 starts at (2, 6) units, and its spot is at most 4 units away from the origin.
    let goal = first(&goals, |_| true);
    for along in ["x", "y"] {
        let metres = goal["pose"]["position"][along].as_f64().unwrap();
        assert!((-0.1..0.6).contains(&metres), "{goal}");
    }
    let settled = first(&states, |sample| {
        let mut modules = sample["modules"].as_array().unwrap().iter();
        modules.any(|state| state["phase"] == 7)
    });
    assert_eq!(settled["module_size"], 0.08);
    for state in settled["modules"].as_array().unwrap() {
        let metres = state["x"].as_f64().unwrap();
        assert!((-0.3..0.7).contains(&metres), "{state}");
    }
    let is_module = |marker: &&Value| marker["ns"] == "modules";
    let picture = first(&markers, |picture| {
        let markers = picture["markers"].as_array().unwrap().iter();
        markers.filter(is_module).count() == 11
    });
    let mut drawn = picture["markers"].as_array().unwrap().iter();
    let module = drawn.find(is_module).unwrap();
    let width = module["scale"]["x"].as_f64().unwrap();
    assert!((width - 0.072).abs() < 1e-9, "{module}");
    assert_eq!(visualiser.stop().status, 0);
}

#[test]
fn a_node_of_another_size_refuses_the_target_by_name() {
    let domain = &*Domain::for_processes(2);
    let path = scenario_path("quadruped_8cm");
    let publisher = Running::start(
        "target_publisher",
        domain,
        &["--scenario", path.to_str().unwrap()],
    );
    let agent = Running::start(
        "module_agent",
        domain,
        &["--module", "1", "--x", "0", "--y", "0"],
    );
    let expected = "target: module_size: is 0.08 m, but the modules of this node measure 1 m";
    assert!(agent.wait_for_log(0, expected, PATIENCE).is_some());
    for process in [agent, publisher] {
        assert_eq!(process.stop().status, 0);
    }
}

/// Shows X4.
#[test]
fn a_driver_that_does_not_follow_a_goal_is_named_with_its_limit_and_harms_nobody() {
    let limits = ["--module-option=--motion-limit-s=4", "--timeout", "60"];
    let Some(run) = run_driven("singletons_10", "--deaf 7", &limits) else {
        return;
    };
    assert_eq!(run.status, 1, "{}{}", run.stdout, run.stderr);
    let errors = errors(&run);
    assert!(
        errors
            .iter()
            .any(|line| line.contains("within motion_limit_s") && line.contains("module=7")),
        "{}",
        run.stderr
    );
    assert!(
        errors.iter().all(|line| line.contains("module=7")),
        "the driver of module 7 harmed others: {}",
        run.stderr
    );
    let end = run.stderr.lines().last().unwrap();
    assert!(end.contains("module 7 left service"), "{end}");
}

#[test]
fn a_driver_that_never_docks_is_named_with_its_limit_and_odometry_will_do() {
    let limits = [
        "--module-option=--pose-source=odom",
        "--module-option=--docking-limit-s=2",
        "--timeout",
        "20",
    ];
    let driver = "--pose-source odom --undockable 7";
    let Some(run) = run_driven("singletons_10", driver, &limits) else {
        return;
    };
    assert_eq!(run.status, 1, "{}{}", run.stdout, run.stderr);
    let errors = errors(&run);
    assert!(
        errors.iter().any(|line| {
            line.contains("its driver did not answer the request to dock to module")
                && line.contains("within docking_limit_s (2 s)")
                && line.contains("module=7")
        }),
        "{}",
        run.stderr
    );
    assert!(
        errors.iter().all(|line| line.contains("module=7")),
        "the driver of module 7 harmed others: {}",
        run.stderr
    );
}

/// Shows B7.
#[test]
fn a_module_without_a_driver_ends_with_the_topic_and_the_limit_named() {
    let arguments = [
        "--module",
        "4",
        "--x",
        "1",
        "--y",
        "2",
        "--motion",
        "external",
        "--first-pose-limit-s",
        "0.5",
    ];
    let agent =
        Running::start("module_agent", &Domain::for_processes(1), &arguments).finish(PATIENCE);
    assert_eq!(agent.status, 1, "{}", agent.stderr);
    assert!(
        agent.stderr.contains(
            "module 4 does not take part: its driver sent no pose on `/formation/module_4/pose` within \
             first_pose_limit_s (0.5 s)"
        ),
        "{}",
        agent.stderr
    );
}

const ONE_FAR_SPOT: &str = "
name: far
target: {spots: [{id: 1, x: 40, y: 0}], edges: []}
singletons: [{id: 1, x: 0, y: 0}]
";

/// A driver that ends when it is dropped.
struct Driver(std::process::Child);

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Goals cease to repeat when the agent ends, and the driver stops. The next run of the agent takes the pose that the driver
/// measures.
/// Shows A4.
#[test]
fn a_module_whose_agent_ends_on_the_way_stops_and_goes_on_from_there() {
    let Some(python) = Python::find() else {
        return;
    };
    let domain = &*Domain::alone();
    let file = ScenarioFile::new("far", ONE_FAR_SPOT);
    let _driver = start_driver(&python, &file, domain, &[]);
    let pose = "geometry_msgs/msg/PoseStamped";
    let Some(poses) = Peer::take("module_1/pose", pose, false, domain) else {
        return;
    };
    let paths = Peer::take("module_1/path", "nav_msgs/msg/Path", true, domain).unwrap();
    let announce = ["--scenario", file.path(), "--expected-modules", "1"];
    let _announcer = Running::start("target_publisher", domain, &announce);
    let arguments = [
        "--module",
        "1",
        "--scenario",
        file.path(),
        "--motion",
        "external",
    ];
    let mut agent = Running::start("module_agent", domain, &arguments);
    let next = || poses.taken()["pose"]["position"]["x"].as_f64().unwrap();
    // One path with each goal of a step: the goal and the poses after it, the spot last.
    let ahead = paths.taken()["poses"].clone();
    let ahead: Vec<f64> = ahead
        .as_array()
        .unwrap()
        .iter()
        .map(|pose| pose["pose"]["position"]["x"].as_f64().unwrap())
        .collect();
    assert!(ahead.len() >= 39 && ahead.is_sorted(), "{ahead:?}");
    assert!((ahead[ahead.len() - 1] - 40.0).abs() < 1e-6, "{ahead:?}");
    while next() < 2.0 {}
    agent.kill();
    // Twenty poses a second: it has stopped when as many are equal.
    let (mut at, mut equal) = (next(), 0);
    while equal < 20 {
        let now = next();
        equal = if (now - at).abs() < 1e-9 {
            equal + 1
        } else {
            0
        };
        at = now;
    }
    assert!(at < 20.0, "it went on to {at}");
    let Some(states) = Peer::start("take", "module_states", domain) else {
        return;
    };
    let restarted = Instant::now();
    let _agent = Running::start("module_agent", domain, &arguments);
    states.await_state_of(1, |at, _| at >= restarted);
    let shown = states
        .poses_of(1)
        .into_iter()
        .find(|&(when, _)| when >= restarted);
    let (_, (x, _)) = shown.unwrap();
    assert!((x - at).abs() < 0.01, "{x} is not {at}");
    while next() < at + 1.0 {}
}

/// More than any test takes, in seconds.
const CLOCK_AHEAD: i64 = 1_000_000;

fn start_driver(python: &Python, file: &ScenarioFile, domain: &str, more: &[&str]) -> Driver {
    let drive = [
        "--scenario",
        file.path(),
        "--domain",
        domain,
        "--speed",
        "3",
    ];
    let drive = [&drive[..], more].concat();
    Driver(python.start("tests/python/drive_modules.py", &drive, Stdio::inherit()))
}

/// The seconds of a stamp.
fn seconds(sample: &Value) -> i64 {
    sample["header"]["stamp"]["sec"].as_i64().unwrap()
}

/// The clocks of a driver and of the modules need not agree.
#[test]
fn goals_echo_the_stamps_of_poses_and_drivers_with_another_clock_follow_them() {
    let Some(python) = Python::find() else {
        return;
    };
    let domain = &*Domain::for_processes(5);
    let file = ScenarioFile::new("far", ONE_FAR_SPOT);
    let ahead = CLOCK_AHEAD.to_string();
    let _driver = start_driver(&python, &file, domain, &["--clock-ahead", &ahead]);
    let pose = "geometry_msgs/msg/PoseStamped";
    let poses = Peer::take("module_1/pose", pose, false, domain).unwrap();
    let goals = Peer::take("module_1/goal_pose", pose, false, domain).unwrap();
    let announce = ["--scenario", file.path(), "--expected-modules", "1"];
    let _announcer = Running::start("target_publisher", domain, &announce);
    let arguments = [
        "--module",
        "1",
        "--scenario",
        file.path(),
        "--motion",
        "external",
    ];
    let _agent = Running::start("module_agent", domain, &arguments);
    let (goal, now) = (goals.taken(), poses.next_taken());
    let behind = seconds(&now) - seconds(&goal);
    assert!((0..CLOCK_AHEAD / 2).contains(&behind), "{goal} {now}");
    while poses.taken()["pose"]["position"]["x"].as_f64().unwrap() < 1.0 {}
}

/// Sends goals to the driver of module 1, which stamps its poses, and observes what it makes of them.
fn check_that_old_goals_are_dropped(domain: &str, is_dropped: impl Fn()) {
    let pose = "geometry_msgs/msg/PoseStamped";
    let poses = Peer::take_best_effort("module_1/pose", pose, domain).unwrap();
    let mut goals = Peer::publish("module_1/goal_pose", pose, domain).unwrap();
    goals.await_ready();
    let x = |pose: &Value| pose["pose"]["position"]["x"].as_f64().unwrap();
    let mut send = |echo: &Value, x: f64| {
        let header = json!({"stamp": echo["header"]["stamp"], "frame_id": "map"});
        let pose = json!({"position": {"x": x}, "orientation": {"w": 1.0}});
        goals.put(&json!({"header": header, "pose": pose}));
    };
    let first = poses.taken();
    // A goal that echoes the last pose sets it off, once the driver is discovered.
    let mut last = first.clone();
    while x(&last) < 0.5 {
        send(&poses.next_taken(), 1.0);
        last = poses.taken();
    }
    // It arrives, and stands.
    let (mut still, mut at) = (0, x(&last));
    while still < 20 {
        let now = x(&poses.taken());
        still = if (now - at).abs() < 1e-3 {
            still + 1
        } else {
            0
        };
        at = now;
    }
    // Ones that waited, and ones that echo a stamp that the driver never gave, are dropped.
    let mut never = first.clone();
    never["header"]["stamp"]["sec"] = json!(seconds(&first) + CLOCK_AHEAD);
    for echo in [
        &first,
        &last,
        &never,
        &json!({"header": {"stamp": {"sec": 0, "nanosec": 0}}}),
    ] {
        send(echo, 5.0);
        for _ in 0..20 {
            let now = x(&poses.next_taken());
            assert!((now - at).abs() < 0.01, "{echo} set it off to {now}");
        }
    }
    is_dropped();
}

const ONE_NEAR_SPOT: &str = "
name: near
target: {spots: [{id: 1, x: 5, y: 0}], edges: []}
singletons: [{id: 1, x: 0, y: 0}]
";

#[test]
fn a_driver_drops_goals_that_were_made_from_old_poses() {
    let Some(python) = Python::find() else {
        return;
    };
    let domain = &*Domain::for_processes(4);
    let file = ScenarioFile::new("near", ONE_NEAR_SPOT);
    let clock = format!("--clock-ahead=-{CLOCK_AHEAD}");
    let _driver = start_driver(&python, &file, domain, &[&clock]);
    check_that_old_goals_are_dropped(domain, || {});
}

#[test]
fn the_physical_world_drops_goals_that_were_made_from_old_poses() {
    if Python::find().is_none() {
        return;
    }
    let domain = &*Domain::for_processes(4);
    let file = ScenarioFile::new("near", ONE_NEAR_SPOT);
    let world = Running::start("world", domain, &["--scenario", file.path()]);
    check_that_old_goals_are_dropped(domain, || {
        let logged = world.wait_for_log(0, "a goal of module 1 echoes a pose of", PATIENCE);
        assert!(logged.is_some(), "{:?}", world.log_since(0));
    });
    assert_eq!(world.stop().status, 0);
}
