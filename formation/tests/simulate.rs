//! `formation simulate` as a user meets it.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::process::{Command, Output};

use formation_sim::FaultKind;
use serde_json::Value;

fn simulate(options: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_formation"))
        .arg("simulate")
        .args(options)
        .output()
        .unwrap()
}

fn stdout(output: &Output) -> String {
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn json(options: &[&str]) -> Value {
    let output = simulate(&[options, &["--json"]].concat());
    let text = stdout(&output);
    assert_eq!(text.matches('\n').count(), 1, "one line, and nothing else");
    serde_json::from_str(&text).unwrap()
}

#[test]
fn the_figures_of_many_seeds() {
    let options = ["--seeds", "6", "--first-seed", "10", "--modules", "5-8"];
    let mut report = json(&options);
    assert_eq!(report["runs"], 6);
    assert_eq!(report["first_seed"], 10);
    assert_eq!(report["faults"], "mixed");
    assert_eq!(report["violations"], serde_json::json!({}));
    assert_eq!(report["failing_seeds"], serde_json::json!([]));
    let ended = report["formed"].as_u64().unwrap() + report["waiting_for_quorum"].as_u64().unwrap();
    assert_eq!(ended, 6);
    let modules = report["modules"].as_array().unwrap();
    assert!(
        modules
            .iter()
            .all(|count| (5..=8).contains(&count.as_u64().unwrap()))
    );
    let recovery = &report["recovery_ms"];
    assert!(recovery["median"].as_u64() <= recovery["worst"].as_u64());
    // Every module sends at least one message, in at least one epoch.
    assert!(report["messages"].as_u64().unwrap() > 30);
    assert!(report["epochs"].as_u64().unwrap() >= 6);
    assert!(report.get("transcript").is_none());
    // The same seeds give the same runs, on however many processors.
    let mut again = json(&options);
    for report in [&mut report, &mut again] {
        report.as_object_mut().unwrap().remove("elapsed_ms");
    }
    assert_eq!(report, again);
}

#[test]
fn one_seed_is_printed_in_full() {
    let options = [
        "--seeds",
        "1",
        "--first-seed",
        "4",
        "--modules",
        "6",
        "--faults",
        "crash",
    ];
    let text = stdout(&simulate(&options));
    for part in [
        " convened epoch=1.",
        " gather epoch=",
        " roster epoch=",
        " claim epoch=",
        " crash module=",
        " settled spot=",
    ] {
        assert!(text.contains(part), "{part} in\n{text}");
    }
    assert!(
        text.contains("1 run of 6 modules with faults: crash; 1 formed"),
        "{text}"
    );
    assert!(text.contains("violations: none"), "{text}");
    let report = json(&options);
    let lines = report["transcript"].as_array().unwrap();
    assert!(text.starts_with(&format!("{}\n", lines[0].as_str().unwrap())));
}

#[test]
fn a_scenario_gives_its_modules_and_its_target() {
    let scenario = formation_tests::root().join("launch_scripts/scenarios/oversupply.yaml");
    let scenario = scenario.to_str().unwrap();
    let report = json(&[scenario, "--seeds", "2", "--faults", "none"]);
    assert_eq!(report["modules"], serde_json::json!([12, 12]));
    assert_eq!(report["formed"], 2);
    assert_eq!(report["epochs"], 2, "one epoch a run when nothing fails");
}

#[test]
fn bad_input_is_named_and_starts_nothing() {
    for (options, named) in [
        (
            &["no/such/file.yaml"][..],
            "no/such/file.yaml: there is no such file",
        ),
        (
            &["--modules", "9-5"],
            "must be a number or a range such as 5-40",
        ),
        (
            &["--modules", "0"],
            "must be a number or a range such as 5-40",
        ),
        (
            &["--faults", "gremlins"],
            "none, crash, partition, mixed, hostile, storm, stops",
        ),
        (&["--seeds", "0"], "--seeds"),
        (
            &["--first-seed", "18446744073709551614", "--seeds", "2"],
            "--first-seed",
        ),
    ] {
        let output = simulate(options);
        assert_eq!(output.status.code(), Some(2), "{options:?}");
        assert!(output.stdout.is_empty());
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(stderr.contains(named), "{options:?}: {stderr}");
    }
}

#[test]
fn the_help_names_every_kind_of_fault() {
    let output = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(["simulate", "--help"])
        .output()
        .unwrap();
    let help = String::from_utf8(output.stdout).unwrap();
    let names = FaultKind::NAMED.map(|(name, _)| name).join(", ");
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        help.contains(&format!("[possible values: {names}]")),
        "{help}"
    );
}

#[test]
fn the_highest_seeds_are_run_once() {
    let report = json(&[
        "--first-seed",
        "18446744073709551613",
        "--seeds",
        "2",
        "--modules",
        "2",
    ]);
    assert_eq!(report["runs"], 2);
}

/// As `formation check` and `formation run` do.
#[test]
fn a_scenario_in_which_no_module_would_move_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("walled.yaml");
    let walled = "obstacles: [{x: 3.5, y: 0, width: 1, height: 6}]\narena: {x: 3.5, y: 0, width: 9, height: 6}\n\
                  target: {map: 'o-o', origin: [6, 0]}\nsingletons: [{id: 1, x: 0, y: 0}, {id: 2, x: 1, y: 0}]";
    std::fs::write(&path, walled).unwrap();
    let output = simulate(&[path.to_str().unwrap(), "--seeds", "1", "--faults", "none"]);
    assert_eq!(output.status.code(), Some(2));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.contains("no module would move"), "{stderr}");
}
