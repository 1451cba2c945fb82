//! What the process does with bad input.

use std::process::{Command, Output};

use formation_tests::Domain;

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

/// The number of a domain is read as ROS 2 reads it.
#[test]
fn a_command_to_an_empty_domain_is_answered_soon_with_where_no_formation_is() {
    let domain = Domain::for_processes(1);
    let hexadecimal = format!("{:#x}", domain.parse::<u16>().unwrap());
    for order in ["--stop", "--resume"] {
        let output = Command::new(env!("CARGO_BIN_EXE_target_publisher"))
            .args(["--discovery-range", "LOCALHOST", order])
            .env("ROS_DOMAIN_ID", &hexadecimal)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1));
        let stderr = String::from_utf8(output.stderr).unwrap();
        let place = format!("in domain {}, namespace /formation, any session", &*domain);
        assert!(
            stderr.contains(&format!(
                "error: no formation was found {place}: no heartbeat"
            )),
            "{stderr}"
        );
        // The limit where no other process is found.
        assert!(stderr.contains("came within 3 s"), "{stderr}");
    }
}
