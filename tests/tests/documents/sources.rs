//! Rules of layout that no lint of the compiler holds.

use super::files;

/// The most lines of a file of Rust.
const LINES_MAX: usize = 600;

/// Paths that exist on one machine only.
const OF_ONE_MACHINE: [&str; 4] = ["/work/", "/home/", "/root/", "/Users/"];

/// What gives the core a clock, input or output, or an order that differs between processes. `core/clippy.toml`
/// disallows the most common of these by type; this covers whole modules of the standard library.
const IMPURE: [&str; 14] = [
    "std::env",
    "std::fs",
    "std::io",
    "std::net",
    "std::os",
    "std::process",
    "std::thread",
    "Instant",
    "SystemTime",
    "HashMap",
    "HashSet",
    "RandomState",
    "println!",
    "eprintln!",
];

/// This folder lists what must not be.
const SELF: &str = "tests/tests/documents";

#[test]
fn no_path_of_one_machine_is_named() {
    let mut found = Vec::new();
    for file in files::all().iter().filter(|file| !file.is_in(SELF)) {
        let is_test = file.path.split('/').any(|part| part == "tests");
        for (index, line) in file.text.lines().enumerate() {
            let is_of_one = OF_ONE_MACHINE.iter().any(|path| line.contains(path));
            if is_of_one || (!is_test && line.contains("/tmp/")) {
                found.push(format!("{}:{}: {}", file.path, index + 1, line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn the_core_has_no_clock_no_input_or_output_and_no_hash_order() {
    let mut found = Vec::new();
    for file in files::all() {
        if !file.is_in("core") || !file.path.contains("/src/") || !file.ends_with(".rs") {
            continue;
        }
        for (index, line) in file.text.lines().enumerate() {
            let is_comment = line.trim_start().starts_with("//");
            let impure = IMPURE.iter().find(|name| line.contains(**name));
            if let Some(name) = impure.filter(|_| !is_comment) {
                found.push(format!("{}:{}: {name}", file.path, index + 1));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn no_file_of_rust_is_too_long_to_survey() {
    let long: Vec<String> = files::all()
        .iter()
        .filter(|file| file.ends_with(".rs"))
        .map(|file| (file.text.lines().count(), &file.path))
        .filter(|(lines, _)| *lines > LINES_MAX)
        .map(|(lines, path)| format!("{path}: {lines} lines, at most {LINES_MAX}"))
        .collect();
    assert!(long.is_empty(), "{}", long.join("\n"));
}

/// Libraries have `doctest = false`, as each would be read once more for tests that it does not have.
#[test]
fn documentation_has_no_tests_that_nothing_runs() {
    let mut found = Vec::new();
    for file in files::all() {
        let is_library = file.path.contains("/src/") && file.ends_with(".rs");
        for (index, line) in file.text.lines().enumerate().filter(|_| is_library) {
            let line = line.trim_start();
            let is_documentation = line.starts_with("///") || line.starts_with("//!");
            if is_documentation && line.contains("```") {
                found.push(format!("{}:{}", file.path, index + 1));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// The gate `.ci/run_zenoh` runs the tests whose path names the feature, so each test that the feature adds has to.
#[test]
fn every_test_that_zenoh_adds_is_run_by_its_gate() {
    let mut added = Vec::new();
    for file in files::all() {
        if !file.is_in("tests/tests") || !file.ends_with(".rs") || file.is_in(SELF) {
            continue;
        }
        let mut is_gated = false;
        for line in file.text.lines().map(str::trim) {
            let named = ["fn ", "mod "]
                .iter()
                .find_map(|kind| line.strip_prefix(kind));
            if line == "#[cfg(feature = \"zenoh\")]" {
                is_gated = true;
            } else if let Some(name) = named {
                if std::mem::take(&mut is_gated) {
                    added.push(format!("{}::{name}", file.path));
                }
            } else if !line.starts_with("#[") {
                is_gated = false;
            }
        }
    }
    assert!(added.len() >= 2, "only {added:?} depend on the feature");
    let missed = added.iter().filter(|path| !path.contains("zenoh"));
    let missed: Vec<&String> = missed.collect();
    assert!(missed.is_empty(), "{missed:?}");
}
