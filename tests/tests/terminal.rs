//! `formation run` on a terminal, as people watch it.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::process::Stdio;

use formation_tests::{Domain, Python, program, scenario_path};

/// Watches a run of the shipped scenario with seven modules on a pseudo-terminal.
fn watch(how: &str) {
    let domain = &*Domain::for_processes(4);
    let Some(python) = Python::find() else {
        return;
    };
    let formation = program("formation");
    let scenario = scenario_path("mcs_detach");
    let arguments = [
        how,
        formation.to_str().unwrap(),
        scenario.to_str().unwrap(),
        domain,
    ];
    let script = "tests/python/terminal_view.py";
    let output = python
        .start(script, &arguments, Stdio::piped())
        .wait_with_output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}\nif a Python package is missing, {}",
        String::from_utf8_lossy(&output.stderr),
        python.advice()
    );
}

#[test]
fn a_run_is_watched_on_a_terminal_that_changes_its_size() {
    watch("watched");
}

#[test]
fn a_run_of_another_terminal_is_watched() {
    watch("from_elsewhere");
}

#[test]
fn a_small_terminal_without_colour_or_unicode_will_do_and_the_result_stays_json() {
    watch("plain");
}
