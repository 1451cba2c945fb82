//! What the process does with arguments that it cannot use, and when its DDS library no longer receives.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::process::{Command, Output};
use std::time::Duration;

use formation_tests::{Domain, Running};

fn visualiser(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_visualiser"))
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn a_rate_that_cannot_be_kept_is_refused_with_the_bounds() {
    let output = visualiser(&["--rate", "0"]);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("--rate"), "{said}");
    assert!(said.contains("must be from 0.1 to 100"), "{said}");
}

#[test]
fn an_unknown_argument_is_refused_with_the_nearest_valid_one() {
    let output = visualiser(&["--no-label"]);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("--no-labels"), "{said}");
}

#[test]
fn a_visualiser_that_no_longer_receives_rejoins_the_graph() {
    let patience = Duration::from_secs(30);
    let domain = Domain::for_processes(4);
    let visualiser = Running::start("visualiser", &domain, &[]);
    let joined = visualiser.wait_for_log(0, "joined the ROS 2 graph", patience);
    assert!(joined.is_some());
    visualiser.rejoin(patience);
    assert_eq!(visualiser.stop().status, 0);
}
