//! `formation explain` as a user meets it.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::collections::BTreeMap;
use std::process::{Command, Output};

use serde_json::Value;

/// Runs a command on the shipped scenario with more modules than spots.
fn formation(command: &str, options: &[&str]) -> Output {
    let folder = formation_tests::root().join("launch_scripts/scenarios");
    Command::new(env!("CARGO_BIN_EXE_formation"))
        .arg(command)
        .arg(folder.join("oversupply.yaml"))
        .args(options)
        .output()
        .unwrap()
}

fn json(command: &str, options: &[&str]) -> Value {
    let output = formation(command, &[options, &["--json"]].concat());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_last_turn_of_each_module_leads_to_its_spot_in_the_plan() {
    let plan = json("plan", &[]);
    let pairs = plan["assignments"].as_array().unwrap().iter();
    let spots: BTreeMap<u64, Value> = pairs
        .map(|pair| (pair["module"].as_u64().unwrap(), pair["spot"].clone()))
        .collect();
    let without = plan["unassigned"].as_array().unwrap().iter();
    let without: Vec<u64> = without.map(|module| module.as_u64().unwrap()).collect();
    assert!(!without.is_empty());
    for module in spots.keys().chain(&without) {
        let explained = json("explain", &["--module", &module.to_string()]);
        let spot = spots.get(module).cloned().unwrap_or(Value::Null);
        assert_eq!(explained["spot"], spot, "{explained}");
        let last = explained["turns"].as_array().unwrap().last().unwrap();
        let reached = match last["outcome"].as_str().unwrap() {
            "takes" => &last["spot"],
            "loses" => &last["instead"],
            "finds_none" => &Value::Null,
            other => panic!("{other}: {explained}"),
        };
        assert_eq!(*reached, spot, "{explained}");
        let alternatives = explained["alternatives"].as_array().unwrap();
        assert_eq!(
            alternatives.len(),
            spots.len() - usize::from(!spot.is_null())
        );
        assert!(
            alternatives.iter().all(|one| one["loss"].is_number()),
            "{explained}"
        );
    }
    let module = without[0].to_string();
    let text = String::from_utf8(formation("explain", &["--module", &module]).stdout).unwrap();
    assert!(
        text.starts_with(&format!("module {module} gets no spot.")),
        "{text}"
    );
}

#[test]
fn a_module_that_does_not_exist_is_refused_with_those_that_do() {
    let output = formation("explain", &["--module", "999"]);
    assert_eq!(output.status.code(), Some(2));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(
        error.contains("there is no module 999; the modules are 1, 2"),
        "{error}"
    );
}

/// The numbers in a text.
fn numbers(text: &str) -> Vec<u64> {
    let words = text.split(|symbol: char| !symbol.is_ascii_digit());
    words.filter_map(|word| word.parse().ok()).collect()
}

#[test]
fn no_module_both_takes_a_spot_and_is_left_over() {
    let folder = formation_tests::root().join("launch_scripts/scenarios");
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("scenario.yaml");
    let mut leaving = 0;
    for name in ["mcs_detach", "figure1_ladder17", "oversupply"] {
        let text = std::fs::read_to_string(folder.join(name).with_extension("yaml")).unwrap();
        let text = text.split("planner:").next().unwrap();
        for policy in ["exact", "paper", "auction"] {
            std::fs::write(&path, format!("{text}\nplanner: {{policy: {policy}}}\n")).unwrap();
            for module in 1..=6 {
                let output = Command::new(env!("CARGO_BIN_EXE_formation"))
                    .arg("explain")
                    .arg(&path)
                    .args(["--json", "--module", &module.to_string()])
                    .output()
                    .unwrap();
                let explained: Value = serde_json::from_slice(&output.stdout).unwrap();
                for turn in explained["turns"].as_array().unwrap() {
                    let text = turn["text"].as_str().unwrap();
                    let (_, text) = text.split_once(": ").unwrap();
                    let parts: Vec<&str> = text.split("; ").collect();
                    let takers = parts.iter().filter_map(|part| part.split_once(" take"));
                    let takers: Vec<u64> = takers.flat_map(|(who, _)| numbers(who)).collect();
                    let left = parts.iter().filter(|part| part.ends_with(" left over"));
                    let left: Vec<u64> = left.flat_map(|part| numbers(part)).collect();
                    assert!(left.iter().all(|module| !takers.contains(module)), "{text}");
                    leaving += usize::from(text.contains("configuration and take"));
                }
            }
        }
    }
    assert!(leaving > 0);
}

/// Two rooms without a door, the target in the left one; module 2 stands right behind the wall.
const ROOMS: &str = "
target: {spots: [{id: 1, x: 3, y: 0}, {id: 2, x: 3, y: 1}], edges: [[1, 2]]}
singletons: [{id: 1, x: 2, y: 0}, {id: 2, x: 5, y: 1}, {id: 3, x: -4, y: 1}]
obstacles: [{x: 4, y: 0, width: 1, height: 9}]
arena: {x: 1.5, y: 0, width: 14, height: 9}
";

#[test]
fn the_wall_is_named_that_cuts_a_module_off() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rooms.yaml");
    std::fs::write(&path, ROOMS).unwrap();
    let run = |arguments: &[&str]| {
        let program = env!("CARGO_BIN_EXE_formation");
        let mut command = Command::new(program);
        command.arg(arguments[0]).arg(&path).args(&arguments[1..]);
        let output = command.output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{errors}");
        String::from_utf8(output.stdout).unwrap()
    };
    let text = run(&["explain", "--module", "2"]);
    let expected = "module 2 gets no spot: no way leads from it to the target: the obstacle around x 4, y 0 is in between.";
    assert!(text.starts_with(expected), "{text}");
    let explained: Value =
        serde_json::from_str(&run(&["explain", "--module", "2", "--json"])).unwrap();
    assert_eq!(explained["cut_off"], true);
    assert_eq!(explained["barrier"], "the obstacle around x 4, y 0");
    let planned: Value = serde_json::from_str(&run(&["plan", "--json"])).unwrap();
    assert_eq!(planned["cut_off"], serde_json::json!([2]));
    assert_eq!(planned["complete"], true);
    let text = run(&["plan"]);
    assert!(
        text.contains("no way leads to the target from module 2"),
        "{text}"
    );
    assert!(
        text.contains("spread 0.001: the longest distance is"),
        "{text}"
    );
}
