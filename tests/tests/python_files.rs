//! The Python of the repository: it compiles, passes a linter, and uses only interfaces that exist; and what the packages
//! install is there.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::BTreeSet;
use std::fs;
use std::process::Stdio;

use formation_tests::{Python, root};

/// Runs `check_python.py`; returns what it printed.
fn checked(arguments: &[&str]) -> Option<String> {
    let python = Python::find()?;
    let child = python.start("tests/python/check_python.py", arguments, Stdio::piped());
    let output = child.wait_with_output().unwrap();
    assert!(
        output.status.success(),
        "{}\nif a Python package is missing, {}",
        String::from_utf8_lossy(&output.stderr),
        python.advice()
    );
    Some(String::from_utf8(output.stdout).unwrap())
}

#[test]
fn all_python_compiles_passes_the_linter_and_uses_interfaces_that_exist() {
    let Some(output) = checked(&[]) else {
        return;
    };
    let numbers: Vec<usize> = output
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .collect();
    assert!(numbers[0] >= 13 && numbers[1] >= 8, "{output}");
}

#[test]
fn the_check_finds_fields_constants_messages_and_topics_that_do_not_exist() {
    checked(&["--self-test"]);
}

fn entries(folder: &str) -> BTreeSet<String> {
    fs::read_dir(root().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn the_launch_package_installs_programs_and_folders_that_exist() {
    let build = fs::read_to_string(root().join("launch_scripts/CMakeLists.txt")).unwrap();
    let listed = |start: &str, end: &str| -> BTreeSet<String> {
        let (_, rest) = build.split_once(start).unwrap();
        let (words, _) = rest.split_once(end).unwrap();
        words.split_whitespace().map(str::to_owned).collect()
    };
    assert!(build.contains("-p formation --features programs\n"));
    let package = fs::read_to_string(root().join("formation/Cargo.toml")).unwrap();
    for program in listed("set(PROGRAMS ", ")") {
        assert!(
            package.contains(&format!("[[bin]]\nname = \"{program}\"\n")),
            "{program} is not built"
        );
    }
    let there = entries("launch_scripts");
    let folders = listed("install(DIRECTORY ", "DESTINATION");
    assert!(
        folders.is_subset(&there),
        "{folders:?} are installed, {there:?} are there"
    );
}

#[test]
fn the_launch_file_starts_programs_that_are_installed_with_options_that_they_have() {
    let launch =
        fs::read_to_string(root().join("launch_scripts/launch/formation.launch.py")).unwrap();
    for (program, options) in [
        (
            "module_agent",
            [
                "--module",
                "--modules",
                "--motion",
                "--speed",
                "--scenario",
                "--state-dir",
            ]
            .as_slice(),
        ),
        (
            "leader_agent",
            [
                "--module",
                "--motion",
                "--speed",
                "--scenario",
                "--state-dir",
            ]
            .as_slice(),
        ),
        (
            "target_publisher",
            ["--expected-modules", "--voters", "--scenario"].as_slice(),
        ),
        ("verifier", ["--time-limit-s", "--keep-watching"].as_slice()),
    ] {
        assert!(launch.contains(&format!("\"{program}\"")), "{program}");
        let help = formation_tests::Running::start(
            program,
            &formation_tests::Domain::for_processes(4),
            &["--help"],
        )
        .finish(std::time::Duration::from_secs(20))
        .stdout;
        for option in options.iter().chain(&["--log-level"]) {
            assert!(launch.contains(&format!("\"{option}\"")), "{option}");
            assert!(
                help.split_whitespace().any(|word| word == *option),
                "{program} {option}: {help}"
            );
        }
    }
}
