//! Formations whose modules are moved by drivers outside, which speak through another vendor's DDS.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::time::Duration;

use formation_tests::{Domain, Finished, Python, Running, scenario_path};

const PATIENCE: Duration = Duration::from_secs(120);

/// Runs a shipped scenario, its modules driven by `tests/python/drive_modules.py`.
fn run_driven(scenario: &str, driver: &str, more: &[&str]) -> Option<Finished> {
    let python = Python::find()?;
    let domain = &*Domain::shared();
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
    let agent = Running::start("module_agent", &Domain::shared(), &arguments).finish(PATIENCE);
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
