//! Real processes take spots off the lattice: round modules a hexagon, squares parts with a gap and turned against each other.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::time::Duration;

use formation_tests::{Domain, Running, ScenarioFile, overlaps};

const PATIENCE: Duration = Duration::from_secs(120);

/// Six round modules around one.
const HEXAGON: &str = include_str!("../scenarios/hexagon.yaml");

/// A row of three; 1.5 units beside it one that is turned by 20 degrees, and a spot 1.7 units off.
const PARTS: &str = "
target:
  spots:
    - {id: 1, x: 0, y: 0}
    - {id: 2, x: 1, y: 0}
    - {id: 3, x: 2, y: 0}
    - {id: 4, x: 0.5, y: 1.5, theta: 0.349066}
    - {id: 5, x: 1.4396926, y: 1.8420201, theta: 0.349066}
    - {id: 6, x: 3.7, y: 0.2}
  edges: [[1, 2], [2, 3], [4, 5], [1, 4], [3, 6]]
configurations:
  - id: 1
    modules: [{id: 1, x: 7, y: 0}, {id: 2, x: 8, y: 0}, {id: 3, x: 9, y: 0}]
    edges: [[1, 2], [2, 3]]
singletons:
  - {id: 4, x: 7, y: 3, theta: 0.4}
  - {id: 5, x: 9, y: 3}
  - {id: 6, x: 11, y: 3}
";

/// Forms a scenario; what the processes published of their motion.
fn trace_of(name: &str, text: &str, more: &[&str]) -> String {
    let scenario = ScenarioFile::new(name, text);
    let folder = tempfile::tempdir().unwrap();
    let trace = folder.path().join("trace.jsonl");
    let domain = &*Domain::for_processes(6);
    let mut arguments = vec!["run", scenario.path(), "--json", "--domain", domain];
    arguments.extend(["--modules-per-process", "3", "--timeout", "90", "--trace"]);
    arguments.push(trace.to_str().unwrap());
    arguments.extend(more);
    let run = Running::start("formation", domain, &arguments).finish(PATIENCE);
    assert_eq!(run.status, 0, "{}{}", run.stdout, run.stderr);
    let report = run.json();
    assert_eq!(report["verdict"], "COMPLETE", "{report}");
    assert_eq!(report["collision_free"], true, "{report}");
    std::fs::read_to_string(&trace).unwrap()
}

#[test]
fn round_modules_form_a_hexagon() {
    trace_of("hexagon", HEXAGON, &[]);
}

#[test]
fn round_robots_form_a_hexagon_in_the_physical_world() {
    trace_of("hexagon_world", HEXAGON, &["--world"]);
}

#[test]
fn parts_are_formed_apart_and_turned() {
    let trace = trace_of("parts", PARTS, &[]);
    let mut overlaps = overlaps(&trace);
    overlaps.retain(|overlap| overlap.depth > 0.01);
    assert_eq!(overlaps, []);
}
