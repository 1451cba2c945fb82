//! Policies that decide at once, carried out by real processes on real DDS, over loopback.

use std::fs;
use std::path::Path;
use std::time::Duration;

use formation_model::Scenario;
use formation_tests::{Domain, Finished, Running, room_for_many_processes};
use serde_json::Value;

const PATIENCE: Duration = Duration::from_secs(120);

/// Runs the launcher, apart from any formation.
fn launch(arguments: &[&str]) -> Finished {
    Running::start("formation", "0", arguments).finish(PATIENCE)
}

/// A generated scenario, without a planner section.
fn generated(options: &str) -> String {
    let options: Vec<&str> = options.split(' ').collect();
    let scenario = launch(&options);
    assert_eq!(scenario.status, 0, "{}", scenario.stderr);
    scenario.stdout
}

/// Forms a scenario with a process a module; the result is complete, and equals the offline plan.
fn forms_as_planned(path: &Path) -> Option<Value> {
    room_for_many_processes()?;
    let scenario = Scenario::from_yaml(&fs::read_to_string(path).unwrap()).unwrap();
    let modules = u32::try_from(scenario.problem().modules().len()).unwrap();
    let path = path.to_str().unwrap();
    let planned = launch(&["plan", path, "--json"]);
    assert_eq!(planned.status, 0, "{}", planned.stderr);
    let domain = &*Domain::for_processes(modules + 2);
    let arguments = ["run", path, "--json", "--domain", domain, "--timeout", "90"];
    let run = Running::start("formation", domain, &arguments).finish(PATIENCE);
    assert_eq!(run.status, 0, "{}\n{}", run.stdout, run.stderr);
    let (planned, run) = (planned.json(), run.json());
    for key in ["assignments", "kept_links", "detached_modules"] {
        assert!(!planned[key].is_null(), "{key}");
        assert_eq!(run[key], planned[key], "{key}");
    }
    assert_eq!(
        run["verdict"]["outcome"]
            .as_str()
            .or(run["verdict"].as_str()),
        Some("COMPLETE")
    );
    Some(run)
}

#[test]
fn a_policy_of_one_file_is_formed_by_processes() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("nearest.yaml");
    let scenario = generated("generate --modules 8 --spots 8 --configuration-size 4 --seed 6");
    fs::write(&path, scenario + "planner: {policy: nearest}\n").unwrap();
    forms_as_planned(&path);
}
