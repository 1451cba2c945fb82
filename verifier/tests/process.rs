//! What the process prints when nothing happens.

use std::process::{Command, Output};

use formation_tests::Domain;
use serde_json::{Value, json};

fn verifier(arguments: &[&str]) -> Output {
    let domain = Domain::for_processes(4);
    Command::new(env!("CARGO_BIN_EXE_verifier"))
        .args(["--discovery-range", "LOCALHOST", "--domain", &domain])
        .args(["--time-limit-s", "0.5"])
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn running_out_of_time_names_what_was_missing() {
    let output = verifier(&[]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(
        String::from_utf8(output.stdout).unwrap(),
        "FAILED\nmissing: no target was announced\n"
    );
}

#[test]
fn programs_read_progress_and_verdict_in_lines_of_json() {
    let output = verifier(&["--progress"]);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines[0]["progress"]["phase"], "waiting for a target");
    let last = &lines[lines.len() - 1]["verdict"];
    assert_eq!(last["outcome"], "FAILED");
    assert_eq!(last["missing"], json!(["no target was announced"]));
}

#[test]
fn absent_modules_are_named_where_a_scenario_lists_them() {
    let scenario = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../launch_scripts/scenarios/undersupply.yaml"
    );
    let output = verifier(&["--json", "--scenario", scenario]);
    let verdict: Value = serde_json::from_slice(&output.stdout).unwrap();
    let missing = verdict["verdict"]["missing"].to_string();
    assert!(missing.contains("module 1 has not joined"), "{missing}");
}
