//! The launch files as the package installs them: every program is found where it is installed, and Ctrl-C ends all of them
//! cleanly.

use std::time::Duration;

use formation_tests::{Domain, Rclpy, Running, Signal};
use serde_json::Value;

const PATIENCE: Duration = Duration::from_secs(120);

/// Launches until the verifier has judged, and presses Ctrl-C: every process receives SIGINT from the terminal and again from what
/// started it. Returns the programs that were started, each with how it ended.
fn launched(rclpy: &Rclpy, domain: &str, arguments: &[&str]) -> Vec<(String, i64)> {
    let folder = tempfile::tempdir().unwrap();
    let prefix = rclpy.install_launch_package(folder.path());
    let launch = rclpy.launch(&prefix, domain, arguments);
    let is_ended = |launch: &Running| {
        launch
            .wait_for_log(0, "Traceback", Duration::ZERO)
            .is_some()
    };
    let complete = launch.wait_for_log(0, "COMPLETE", PATIENCE);
    let log = || {
        let lines = launch.log_since(0).into_iter();
        lines.map(|line| line.text).collect::<Vec<_>>().join("\n")
    };
    assert!(complete.is_some() && !is_ended(&launch), "{}", log());
    launch.signal_group(Signal::INT);
    let finished = launch.finish(PATIENCE);
    assert_eq!(finished.status, 0, "{}", finished.stderr);
    let lines = finished.stdout.lines();
    let lines: Vec<Value> = lines
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let all =
        |what: &str| -> Vec<&Value> { lines.iter().filter(|line| line["did"] == what).collect() };
    let ended = all("end");
    assert_eq!(all("start").len(), ended.len(), "{}", finished.stdout);
    assert!(all("timeout").is_empty(), "{}", finished.stdout);
    let program = |line: &&Value| line["name"].as_str().unwrap().to_owned();
    let mut ended: Vec<(String, i64)> = ended
        .iter()
        .map(|line| (program(line), line["code"].as_i64().unwrap()))
        .collect();
    ended.sort();
    for (program, code) in &ended {
        assert_eq!(*code, 0, "{program} died: {}", finished.stderr);
    }
    ended
}

#[test]
fn the_installed_launch_file_forms_a_scenario_and_ctrl_c_ends_every_process_cleanly() {
    let Some(rclpy) = Rclpy::find() else {
        return;
    };
    let domain = &*Domain::for_processes(9);
    let arguments = ["formation.launch.py", "scenario:=mcs_detach", "speed:=20"];
    let ended = launched(&rclpy, domain, &arguments);
    let agents = ended
        .iter()
        .filter(|(program, _)| program.ends_with("_agent"));
    assert_eq!((agents.count(), ended.len()), (7, 9), "{ended:?}");
}

/// The driver is the rclpy example, which is installed with the programs.
#[test]
fn the_installed_launch_file_of_driven_modules_finds_their_driver() {
    let Some(rclpy) = Rclpy::find() else {
        return;
    };
    let domain = &*Domain::for_processes(5);
    let arguments = ["driven.launch.py", "modules_per_process:=4"];
    let ended = launched(&rclpy, domain, &arguments);
    let programs: Vec<&str> = ended.iter().map(|(program, _)| program.as_str()).collect();
    assert_eq!(
        programs,
        [
            "drive_modules.py",
            "module_agent",
            "module_agent",
            "target_publisher",
            "verifier"
        ]
    );
}

/// A launch file starts a process for each module that a scenario draws.
#[test]
fn the_installed_launch_file_forms_a_scenario_that_draws_its_modules() {
    let Some(rclpy) = Rclpy::find() else {
        return;
    };
    let domain = &*Domain::for_processes(6);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("drawn.yaml");
    let text = "target: {origin: [0, 6], map: 'o-o-o-o'}\nmodules: {ids: [5, 3, 8, 7], map: 'A-A   B   C'}\n";
    std::fs::write(&file, text).unwrap();
    let scenario = format!("scenario:={}", file.display());
    let ended = launched(
        &rclpy,
        domain,
        &["formation.launch.py", &scenario, "speed:=20"],
    );
    assert_eq!(ended.len(), 6, "{ended:?}");
}
