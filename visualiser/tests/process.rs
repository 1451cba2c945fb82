//! What the process does with arguments that it cannot use.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::process::{Command, Output};

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
    assert!(said.contains("must be a number from"), "{said}");
}

#[test]
fn an_unknown_argument_is_refused_with_the_nearest_valid_one() {
    let output = visualiser(&["--no-label"]);
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("--no-labels"), "{said}");
}
