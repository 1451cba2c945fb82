//! The command `formation experiments`, and the scenarios of its case studies.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
#[cfg(feature = "experiments")]
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
#[cfg(feature = "experiments")]
use std::process::Stdio;
use std::process::{Command, Output};

#[cfg(feature = "experiments")]
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

fn formation(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(arguments)
        .output()
        .unwrap()
}

fn case_studies() -> Vec<PathBuf> {
    let directory = formation_tests::root().join("launch_scripts/scenarios/case_studies");
    let mut paths: Vec<PathBuf> = fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    paths
}

#[test]
fn each_case_study_is_planned_without_a_hole() {
    let paths = case_studies();
    assert_eq!(paths.len(), 8);
    for path in paths {
        let path = path.to_str().unwrap();
        assert!(formation(&["check", path]).status.success(), "{path}");
        let output = formation(&["plan", path, "--json"]);
        assert!(output.status.success(), "{path}");
        // No warning: the plan has an acting order with a corridor for every spot.
        assert_eq!(String::from_utf8_lossy(&output.stderr), "", "{path}");
        let plan: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(plan["open_spots"], Value::Array(Vec::new()), "{path}");
        assert_eq!(plan["unassigned"], Value::Array(Vec::new()), "{path}");
        let kept = plan["kept_links"].as_u64().unwrap();
        let broken = plan["broken_links"].as_u64().unwrap();
        assert!(kept > 2 * broken, "{path}: {kept} kept, {broken} broken");
    }
}

#[cfg(feature = "experiments")]
#[test]
fn one_experiment_is_run_and_its_summary_named() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let out = out.to_str().unwrap();
    let output = formation(&["experiments", out, "--quick", "--only", "case_studies"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    assert!(errors.contains("0 of 24 cells"), "{errors}");
    let summary = String::from_utf8(output.stdout).unwrap();
    assert_eq!(summary.trim_end(), format!("{out}/summary.md"));
    let text = fs::read_to_string(summary.trim_end()).unwrap();
    assert!(text.contains("## Eight case studies"));
    assert!(text.contains("hexapod"));

    let other = formation(&["experiments", out, "--quick", "--runs", "7"]);
    assert_eq!(other.status.code(), Some(2));
    let errors = String::from_utf8_lossy(&other.stderr);
    assert!(errors.contains("runs was 5, now 7"), "{errors}");
}

#[cfg(feature = "experiments")]
#[test]
fn an_interruption_keeps_what_was_measured_and_has_the_status_of_its_signal() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let mut experiments = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(["experiments", out.to_str().unwrap(), "--quick"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut errors = BufReader::new(experiments.stderr.take().unwrap());
    // The signals are handled once the first line is written.
    let mut said = String::new();
    errors.read_line(&mut said).unwrap();
    assert!(said.starts_with("0 of "), "{said}");
    kill_process(Pid::from_child(&experiments), Signal::INT).unwrap();
    errors.read_to_string(&mut said).unwrap();
    let status = experiments.wait().unwrap();
    assert_eq!(status.code(), Some(130), "{said}");
    assert!(said.contains("error: interrupted"), "{said}");
}

#[cfg(feature = "experiments")]
#[test]
fn an_unknown_name_is_a_usage_error_that_lists_the_names() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().to_str().unwrap();
    let output = formation(&["experiments", out, "--only", "nonsense"]);
    assert_eq!(output.status.code(), Some(2));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("nonsense"), "{errors}");
    assert!(errors.contains("matching_time, planning_time"), "{errors}");
    assert_eq!(errors.trim_end().lines().count(), 1, "{errors}");
}

#[cfg(not(feature = "experiments"))]
#[test]
fn a_program_without_experiments_names_the_build_command() {
    let output = formation(&["experiments", "out", "--quick"]);
    assert_eq!(output.status.code(), Some(2));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(
        errors.contains("cargo build --release -p formation"),
        "{errors}"
    );
    assert_eq!(errors.trim_end().lines().count(), 1, "{errors}");
    assert!(!Path::new("out").exists());
}
