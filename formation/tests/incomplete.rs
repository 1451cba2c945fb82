//! A plan with a hole, as the policy `paper` can leave one, is a result with status 1.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// Five modules, three of them docked, and five spots; the policy `paper` evicts a module that then takes no spot.
fn scenario() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/paper_hole.yaml")
}

fn formation(command: &str, options: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_formation"))
        .arg(command)
        .arg(scenario())
        .args(options)
        .output()
        .unwrap()
}

/// What a command prints as JSON. It ends with status 1 and one line that names the open spot.
fn incomplete(command: &str, options: &[&str]) -> Value {
    let output = formation(command, &[options, &["--json"]].concat());
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{command}: {errors}");
    let report: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{command}: {error}: {errors}"));
    assert_eq!(report["complete"], false, "{command}");
    assert_eq!(
        report["open_spots"].as_array().unwrap().len(),
        1,
        "{command}"
    );
    assert!(!report["turns"].as_array().unwrap().is_empty(), "{command}");
    report
}

#[test]
fn each_command_prints_its_result_and_names_the_hole() {
    let plan = incomplete("plan", &[]);
    let open = &plan["open_spots"][0];
    assert_eq!(plan["assignments"].as_array().unwrap().len(), 4);
    assert_eq!(plan["unassigned"].as_array().unwrap().len(), 1);
    let without = plan["unassigned"][0].to_string();
    for report in [
        incomplete("check", &[]),
        incomplete("explain", &["--module", &without]),
    ] {
        assert_eq!(&report["open_spots"][0], open);
    }
    for command in ["plan", "check"] {
        let output = formation(command, &[]);
        assert_eq!(output.status.code(), Some(1));
        assert!(!output.stdout.is_empty());
        let errors = String::from_utf8(output.stderr).unwrap();
        let expected = format!(
            "error: {}: the plan has a hole, as the policy `paper` may leave one: 4 spots are filled, not 5; left open: spot {open}",
            scenario().display()
        );
        assert!(errors.contains(&expected), "{errors}");
    }
}

#[test]
fn it_can_be_simulated_and_drawn() {
    let figures = incomplete(
        "simulate",
        &["--seeds", "1", "--first-seed", "1", "--faults", "none"],
    );
    assert_eq!(figures["violations"]["hole"], 1);
    let directory = tempfile::tempdir().unwrap();
    let report = directory.path().join("report");
    let output = formation("plan", &["--report", report.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    for picture in ["before.svg", "after.svg", "report.html"] {
        assert!(is_written(&report.join(picture)), "{picture}");
    }
}

fn is_written(path: &Path) -> bool {
    path.metadata().is_ok_and(|file| file.len() > 0)
}
