//! Formations whose robots a physical world plays, with slip, noise and docking that fails.

use std::time::Duration;

use formation_tests::{Domain, EIGHT, Finished, Running, ScenarioFile};

const PATIENCE: Duration = Duration::from_secs(120);

fn run_in_world(scenario: &ScenarioFile, more: &[&str]) -> Finished {
    let domain = &*Domain::for_processes(6);
    let mut arguments = vec!["run", scenario.path(), "--json", "--domain", domain];
    arguments.extend(["--modules-per-process", "4", "--timeout", "90", "--world"]);
    arguments.extend(more);
    Running::start("formation", domain, &arguments).finish(PATIENCE)
}

#[test]
fn eight_robots_that_slip_and_measure_with_noise_form_without_a_hole_or_a_blow() {
    let disturbances = [
        "--slip",
        "0.2",
        "--noise",
        "0.01",
        "--world-option=--loss=0.1",
        "--world-option=--delay-ms=50",
        "--world-option=--docking-failure=0.3",
    ];
    let run = run_in_world(&ScenarioFile::new("eight_robots", EIGHT), &disturbances);
    assert_eq!(run.status, 0, "{}{}", run.stdout, run.stderr);
    let report = run.json();
    assert_eq!(report["verdict"], "COMPLETE", "{report}");
    assert_eq!(report["collision_free"], true, "{report}");
    let world = &report["world"];
    assert_eq!(world["contacts_above_touch"], 0, "{world}");
    assert_eq!(world["wall_contacts"], 0, "{world}");
    assert!(world["lost_poses"].as_u64() > Some(0), "{world}");
    // Each of the five robots that start alone docks, and no attempt is lost without being counted.
    let count = |key: &str| world[key].as_u64().unwrap_or_default();
    let docked = count("docking_attempts") - count("docking_failures");
    assert!(docked >= 5, "{world}");
}

#[test]
fn a_world_does_not_start_where_modules_have_no_paths() {
    let near = "
target: {spots: [{id: 1, x: 5, y: 5}], edges: []}
singletons: [{id: 1, x: 0, y: 0}, {id: 2, x: 0.5, y: 0}]
";
    let run = run_in_world(&ScenarioFile::new("near_robots", near), &[]);
    assert_eq!(run.status, 2, "{}", run.stderr);
    assert!(
        run.stderr
            .contains("starts: module 1 and module 2 are too close"),
        "{}",
        run.stderr
    );
}
