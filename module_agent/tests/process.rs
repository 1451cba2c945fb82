//! How the process reports bad input, and how it ends.

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Output, Stdio};

use formation_tests::Domain;
use rustix::process::{Pid, Signal, kill_process};

fn agent(domain: &str, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_module_agent"));
    command
        .args(arguments.split_whitespace())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .env("ROS_DOMAIN_ID", domain)
        .env_remove("ROS_LOCALHOST_ONLY")
        .env_remove("RUST_LOG");
    command
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Two modules that cannot turn without touching each other.
const CLOSE: &str = "
target: {spots: [{id: 1, x: 0, y: 0}, {id: 2, x: 1, y: 0}], edges: [[1, 2]]}
singletons: [{id: 7, x: 0.2, y: 3, theta: 0.5}, {id: 8, x: 1, y: 3, theta: 1}]
";

#[test]
fn bad_input_is_reported_in_one_line_before_anything_starts() {
    let scenario = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../launch_scripts/scenarios/figure1_ladder17.yaml"
    );
    let stores = tempfile::tempdir().unwrap();
    let torn = stores.path().join("module_1.session_0.json");
    fs::write(&torn, "{\"format\": 1, \"sess").unwrap();
    let torn = format!("{}: is damaged (EOF while parsing", torn.display());
    let close = stores.path().join("close.yaml");
    fs::write(&close, CLOSE).unwrap();
    let close = close.display();
    for (arguments, expected) in [
        (
            format!("--module 99 --scenario {scenario}"),
            "there is no module 99 in this scenario",
        ),
        (
            "--module 1 --scenario /nowhere.yaml".to_owned(),
            "/nowhere.yaml: there is no such file",
        ),
        (
            "--module 1 --x inf --y 0".to_owned(),
            "--x: must be a finite number, got inf",
        ),
        (
            "--module 1 --x 0 --y 0 --lease-s 9".to_owned(),
            "parameter `suspicion_s`: must be greater than lease_s (9s), got 5s",
        ),
        (
            format!(
                "--module 1 --x 0 --y 0 --state-dir {}",
                stores.path().display()
            ),
            &torn,
        ),
        (
            format!("--module 7 --scenario {close} --motion external"),
            "starts: module 7 and module 8 are too close: place these modules further apart",
        ),
    ] {
        let output = agent("1", &arguments).output().unwrap();
        let stderr = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {stderr}");
        assert!(stderr.starts_with("error: "), "{stderr}");
        assert!(stderr.contains(expected), "{stderr}");
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
    }
}

#[test]
fn a_broken_environment_is_reported_unless_an_argument_overrides_it() {
    let broken = |arguments: &str| agent("many", arguments).output().unwrap();
    let output = broken("--module 1 --x 0 --y 0");
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("environment variable ROS_DOMAIN_ID"));
    let output = broken("--module 1 --x nowhere --y 0 --domain 1");
    assert!(
        stderr(&output).contains("'--x <UNITS>'"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn the_process_leaves_on_a_signal_to_end() {
    let domain = Domain::for_processes(4);
    for signal in [Signal::TERM, Signal::INT] {
        let mut child = agent(&domain, "--module 4 --x 0 --y 0")
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut log = BufReader::new(child.stderr.take().unwrap()).lines();
        let joined = log.find(|line| {
            line.as_ref()
                .is_ok_and(|line| line.contains("joined the ROS 2 graph"))
        });
        assert!(joined.is_some(), "it never joined the graph");
        kill_process(Pid::from_child(&child), signal).unwrap();
        // The process itself limits how long this takes.
        assert_eq!(child.wait().unwrap().code(), Some(0), "{signal:?}");
    }
}
