//! Scenarios from the standard input, and results for which there is no room.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

fn scenario() -> PathBuf {
    formation_tests::root().join("launch_scripts/scenarios/figure1_ladder17.yaml")
}

fn with_input(arguments: &[&str], text: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    // A program that refuses its arguments reads nothing.
    let _ = input.write_all(text.as_bytes());
    drop(input);
    child.wait_with_output().unwrap()
}

#[test]
fn a_dash_stands_for_the_standard_input() {
    let text = std::fs::read_to_string(scenario()).unwrap();
    for arguments in [
        &["plan", "-"][..],
        &["plan", "-", "--json"],
        &["check", "-"],
        &["explain", "-", "--module", "4"],
        &["show", "-", "--svg"],
        &["simulate", "-", "--seeds", "1", "--faults", "none"],
    ] {
        let output = with_input(arguments, &text);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {errors}");
        assert!(!output.stdout.is_empty(), "{arguments:?}");
    }
    let refused = with_input(&["check", "-"], "target: 3\n");
    assert_eq!(refused.status.code(), Some(2));
    let errors = String::from_utf8(refused.stderr).unwrap();
    assert!(
        errors.starts_with("error: standard input: line 1 column 9: target: "),
        "{errors}"
    );
    // Every process of a run reads the file again.
    let refused = with_input(&["run", "-"], &text);
    assert_eq!(refused.status.code(), Some(2));
    let errors = String::from_utf8(refused.stderr).unwrap();
    assert!(
        errors.contains("standard input: is no regular file"),
        "{errors}"
    );
}

/// The commands that print a result, on a scenario.
fn printing() -> Vec<Vec<String>> {
    let scenario = scenario().to_str().unwrap().to_owned();
    let line = |text: &str| text.replace("SCENARIO", &scenario);
    [
        "plan SCENARIO",
        "plan SCENARIO --json",
        "check SCENARIO",
        "explain SCENARIO --module 4",
        "show SCENARIO --svg",
        "schema",
        "completions bash",
        "generate --modules 4 --spots 4 --seed 1",
        "simulate --seeds 1 --modules 5",
    ]
    .map(|text| line(text).split(' ').map(str::to_owned).collect())
    .to_vec()
}

#[test]
fn a_result_that_cannot_be_written_is_a_failure() {
    for arguments in printing() {
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_formation"))
            .args(&arguments)
            .stdout(full)
            .output()
            .unwrap();
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {errors}");
        assert!(
            errors.contains("cannot write the result"),
            "{arguments:?}: {errors}"
        );
    }
}

#[test]
fn without_a_standard_output_a_result_is_a_failure() {
    for arguments in printing() {
        let run = |redirection: &str| {
            Command::new("sh")
                .arg("-c")
                .arg(format!("exec \"$0\" \"$@\" {redirection}"))
                .arg(env!("CARGO_BIN_EXE_formation"))
                .args(&arguments)
                .output()
                .unwrap()
        };
        let output = run(">&-");
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {errors}");
        assert!(
            errors.contains("the standard output is closed"),
            "{arguments:?}: {errors}"
        );
        // A shell discards output for writing alone, other programs for reading as well.
        for discarded in [">/dev/null", "1<>/dev/null"] {
            assert!(run(discarded).status.success(), "{arguments:?} {discarded}");
        }
    }
}
