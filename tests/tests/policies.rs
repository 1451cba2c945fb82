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

/// The planner section and the allocation of a target that gives the rotated order of modules to the spots, all of them detached.
fn with_rotated_allocation(scenario: &str, shift: usize) -> String {
    let parsed = Scenario::from_yaml(scenario).unwrap();
    let problem = parsed.problem();
    let spots: Vec<u32> = problem
        .target()
        .spots()
        .iter()
        .map(|spot| spot.id.0)
        .collect();
    let modules: Vec<u32> = problem.modules().iter().map(|module| module.id.0).collect();
    let entries = modules.iter().enumerate().map(|(index, module)| {
        let spot = spots[(index + shift) % spots.len()];
        format!("    - {{module: {module}, spot: {spot}}}\n")
    });
    let entries: String = entries.collect();
    let docked = problem.configurations();
    let docked = docked
        .iter()
        .flat_map(|one| one.modules.iter().map(|module| module.0));
    let detached: Vec<u32> = docked.collect();
    let section = format!("target:\n  detached: {detached:?}\n  allocation:\n{entries}");
    scenario.replacen("target:\n", &section, 1) + "planner: {policy: given}\n"
}

#[test]
fn an_allocation_that_is_given_is_formed_by_processes() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("given.yaml");
    let options = "generate --modules 6 --spots 6 --configurations 1x3 --seed 3";
    let scenario = with_rotated_allocation(&generated(options), 3);
    fs::write(&path, &scenario).unwrap();
    let Some(run) = forms_as_planned(&path) else {
        return;
    };
    let parsed = Scenario::from_yaml(&scenario).unwrap();
    let given = parsed.problem().target().given().unwrap();
    let expected = serde_json::to_value(given.assignments().collect::<Vec<_>>()).unwrap();
    assert_eq!(run["assignments"], expected);
}

#[test]
fn a_policy_of_one_file_is_formed_by_processes() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("nearest.yaml");
    let scenario = generated("generate --modules 8 --spots 8 --configuration-size 4 --seed 6");
    fs::write(&path, scenario + "planner: {policy: nearest}\n").unwrap();
    forms_as_planned(&path);
}
