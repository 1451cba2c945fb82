//! What the process does with bad input.

use std::process::{Command, Output};

fn publisher(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_target_publisher"))
        .args(["--discovery-range", "LOCALHOST", "--domain", "76"])
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn a_missing_scenario_is_one_line_and_status_2() {
    let output = publisher(&["--scenario", "no/such/file.yaml"]);
    assert_eq!(output.status.code(), Some(2));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    assert!(stderr.contains("no/such/file.yaml"), "{stderr}");
}

#[test]
fn a_number_of_modules_that_cannot_be_is_bad_usage() {
    let output = publisher(&["--scenario", "x.yaml", "--expected-modules", "0"]);
    assert_eq!(output.status.code(), Some(2));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.contains("--expected-modules"), "{stderr}");
}

#[test]
fn what_belongs_to_a_scenario_needs_one() {
    for argument in [["--revision", "3"].as_slice(), &["--withdraw"]] {
        let output = publisher(argument);
        assert_eq!(output.status.code(), Some(2));
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(stderr.contains("--scenario"), "{stderr}");
    }
}

/// No other target could follow it.
#[test]
fn a_revision_that_is_too_far_ahead_of_the_clock_is_bad_usage() {
    let highest = u64::MAX.to_string();
    let output = publisher(&["--scenario", "x.yaml", "--revision", &highest]);
    assert_eq!(output.status.code(), Some(2));
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.contains("too far ahead of the clock"), "{stderr}");
}
