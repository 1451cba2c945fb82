//! What the process does with options and scenarios that it cannot use.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::process::Command;

use formation_tests::{EIGHT, ScenarioFile};

/// What the program says when it refuses its arguments.
fn refusal(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_world"))
        .args(arguments)
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    said
}

#[test]
fn an_option_beyond_its_bounds_is_refused() {
    let said = refusal(&["--slip", "1.5"]);
    assert!(said.contains("must be from 0 to 0.95"), "{said}");
}

#[test]
fn starts_without_paths_and_blocks_without_a_drive_for_them_are_refused() {
    let near = "
target: {spots: [{id: 1, x: 5, y: 5}], edges: []}
singletons: [{id: 1, x: 0, y: 0}, {id: 2, x: 0.5, y: 0}]
";
    let file = ScenarioFile::new("near", near);
    let said = refusal(&["--scenario", file.path()]);
    assert!(
        said.contains("starts: module 1 and module 2 are too close"),
        "{said}"
    );
    let file = ScenarioFile::new("block", EIGHT);
    let said = refusal(&["--scenario", file.path(), "--drive", "differential"]);
    assert!(said.contains("modules 1-3 are docked"), "{said}");
}

#[test]
fn a_differential_drive_whose_corners_leave_its_cell_is_refused() {
    let wide = "
body_width: 0.71
target: {spots: [{id: 1, x: 5, y: 5}], edges: []}
singletons: [{id: 1, x: 0, y: 0}]
";
    let file = ScenarioFile::new("wide", wide);
    let said = refusal(&["--scenario", file.path(), "--drive", "differential"]);
    assert!(said.contains("body_width: is 0.71 units"), "{said}");
    assert!(said.contains("only up to 0.7 units"), "{said}");
}

#[test]
fn poses_so_late_that_no_goal_could_follow_from_them_are_refused() {
    let one = "
target: {spots: [{id: 1, x: 5, y: 5}], edges: []}
singletons: [{id: 1, x: 0, y: 0}]
";
    let file = ScenarioFile::new("late", one);
    let said = refusal(&["--scenario", file.path(), "--delay-ms", "400"]);
    assert!(said.contains("delay_ms: no robot would move"), "{said}");
}
