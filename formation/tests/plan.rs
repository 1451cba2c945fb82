//! `formation plan` as a user meets it.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use serde_json::{Value, json};

fn scenario(name: &str) -> PathBuf {
    formation_tests::scenario_path(name)
}

fn plan(name: &str, options: &[&str]) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_formation"))
        .arg("plan")
        .arg(scenario(name))
        .args(options)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    output
}

fn json(name: &str) -> Value {
    let stdout = String::from_utf8(plan(name, &["--json"]).stdout).unwrap();
    assert_eq!(
        stdout.matches('\n').count(),
        1,
        "one line, and nothing else"
    );
    serde_json::from_str(&stdout).unwrap()
}

fn ids(list: &Value) -> Vec<u64> {
    list.as_array()
        .unwrap()
        .iter()
        .map(|id| id.as_u64().unwrap())
        .collect()
}

/// The members named `key` of a list of objects, which must be distinct.
fn distinct(list: &Value, key: &str) -> BTreeSet<u64> {
    let list = list.as_array().unwrap();
    let members: BTreeSet<u64> = list
        .iter()
        .map(|entry| entry[key].as_u64().unwrap())
        .collect();
    assert_eq!(members.len(), list.len());
    members
}

#[test]
fn the_json_has_every_promised_key() {
    let report = json("figure1_ladder17");
    for list in ["assignments", "unassigned", "open_spots", "assembly_order"] {
        assert!(report[list].is_array(), "{list}");
    }
    for count in [
        "kept_links",
        "broken_links",
        "detached_modules",
        "port_changes",
        "evictions",
        "planning_us",
    ] {
        assert!(report[count].is_u64(), "{count}");
    }
    for sum in ["total_utility", "total_distance", "longest_distance"] {
        assert!(report[sum].is_f64(), "{sum}");
    }
    for sum in ["utility", "distance", "longest"] {
        assert!(report["without_spread"][sum].is_f64(), "{sum}");
    }
    for count in ["samples", "deliveries", "pairs"] {
        assert!(report["messages"][count].is_u64(), "messages.{count}");
    }
}

/// Shows X7.
#[test]
fn the_motion_ends_on_the_spots_or_says_why_there_is_none() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("apart.yaml");
    let text = "target:\n  spots: [{id: 1, x: 0, y: 0}, {id: 2, x: 1, y: 0}]\n  edges: [[1, 2]]\n\
                singletons: [{id: 7, x: 0.2, y: 3, theta: 0.5}, {id: 8, x: 4, y: 3, theta: 1}]\n";
    fs::write(&path, text).unwrap();
    let motion = &json(path.to_str().unwrap())["motion"];
    assert_eq!(motion["collision_free"], true);
    assert!(motion["makespan"].as_u64() >= motion["bound"].as_u64());
    let modules = motion["modules"].as_array().unwrap();
    assert_eq!(
        distinct(&motion["modules"], "module"),
        BTreeSet::from([7, 8])
    );
    for module in modules {
        let last = module["waypoints"].as_array().unwrap().last().unwrap();
        assert_eq!(last[1], 0.0);
        assert!(module["waits"].is_array());
    }
    fs::write(&path, text.replace("x: 4", "x: 1")).unwrap();
    let motion = json(path.to_str().unwrap())["motion"].clone();
    assert_eq!(motion["mode"], "none");
    assert_eq!(motion["collision_free"], false);
    assert_eq!(
        motion["error"],
        "starts: module 7 and module 8 are too close"
    );
}

#[test]
fn figure_1_fills_the_ladder_and_breaks_only_the_block_that_cannot_fit() {
    let report = json("figure1_ladder17");
    let all_ids: BTreeSet<u64> = (1..=17).collect();
    assert_eq!(distinct(&report["assignments"], "module"), all_ids);
    assert_eq!(distinct(&report["assignments"], "spot"), all_ids);
    let order = ids(&report["assembly_order"]);
    assert_eq!(order.into_iter().collect::<BTreeSet<_>>(), all_ids);
    // Thirteen links at the start; the hub with four neighbours must lose one, and only one.
    assert_eq!(report["kept_links"], 12);
    assert_eq!(report["broken_links"], 1);
    assert_eq!(report["warnings"], Value::Array(Vec::new()));
}

#[test]
fn a_block_that_cannot_fit_loses_one_module() {
    let report = json("mcs_detach");
    assert_eq!(report["kept_links"], 5);
    assert_eq!(report["broken_links"], 1);
    assert_eq!(report["detached_modules"], 1);
    assert_eq!(ids(&report["open_spots"]), Vec::<u64>::new());
}

#[test]
fn what_is_left_over_is_named() {
    let over = json("oversupply");
    assert_eq!(ids(&over["unassigned"]).len(), 4);
    assert_eq!(distinct(&over["assignments"], "spot").len(), 8);
    let under = json("undersupply");
    assert_eq!(ids(&under["open_spots"]).len(), 4);
    assert_eq!(distinct(&under["assignments"], "module").len(), 8);
}

#[test]
fn the_plan_is_the_same_each_time() {
    for name in ["figure1_ladder17", "singletons_10", "oversupply"] {
        let (mut one, mut other) = (json(name), json(name));
        for report in [&mut one, &mut other] {
            report.as_object_mut().unwrap().remove("planning_us");
        }
        assert_eq!(one, other);
    }
}

#[test]
fn generated_scenarios_pass_the_independent_check() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("generated.yaml");
    // Seed 2 with 60 mixed modules has a turn whose chains send a module away and back.
    for (modules, grouping) in [
        ("60", "--mixed"),
        ("100", "--mixed"),
        ("100", "--configuration-size=10"),
        ("120", "--configuration-size=50"),
    ] {
        for seed in ["1", "2", "3"] {
            let generated = Command::new(env!("CARGO_BIN_EXE_formation"))
                .args(["generate", "--spots", "100", "--modules", modules, grouping])
                .args(["--touching", "--seed", seed])
                .output()
                .unwrap();
            fs::write(&path, generated.stdout).unwrap();
            let planned = Command::new(env!("CARGO_BIN_EXE_formation"))
                .args(["plan", "--json"])
                .arg(&path)
                .output()
                .unwrap();
            assert!(
                planned.status.success(),
                "{modules} {grouping} {seed}: {}",
                String::from_utf8_lossy(&planned.stderr)
            );
        }
    }
}

#[test]
fn every_policy_plans() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("figure1.yaml");
    let figure1 = fs::read_to_string(scenario("figure1_ladder17")).unwrap();
    for policy in ["exact", "paper", "auction", "hungarian"] {
        fs::write(&path, format!("{figure1}planner: {{policy: {policy}}}\n")).unwrap();
        let planned = Command::new(env!("CARGO_BIN_EXE_formation"))
            .args(["plan", "--json"])
            .arg(&path)
            .output()
            .unwrap();
        let stderr = String::from_utf8_lossy(&planned.stderr);
        assert!(planned.status.success(), "{policy}: {stderr}");
        let report: Value = serde_json::from_slice(&planned.stdout).unwrap();
        assert_eq!(
            distinct(&report["assignments"], "spot").len(),
            17,
            "{policy}"
        );
    }
}

#[test]
fn people_get_a_table() {
    let stdout = String::from_utf8(plan("undersupply", &[]).stdout).unwrap();
    let lines: Vec<&str> = stdout.lines().collect();
    assert_eq!(lines[0], "undersupply");
    assert_eq!(
        lines[1].split_whitespace().collect::<Vec<_>>(),
        ["module", "spot", "filled", "distance", "moves", "with"]
    );
    // Eight rows, one a module, and then who and what is left over.
    assert!(lines[9].trim_start().starts_with("8 "), "{}", lines[9]);
    assert!(lines[10].starts_with("left open: spots "), "{}", lines[10]);
}

#[test]
fn a_bad_scenario_is_refused_before_planning() {
    let output = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(["plan", "--json", "no/such/file.yaml"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty());
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(stderr, "error: no/such/file.yaml: there is no such file\n");
}

#[test]
fn a_report_is_the_same_each_time_and_made_of_four_files() {
    let directory = tempfile::tempdir().unwrap();
    let written = |name: &str| {
        let report = directory.path().join(name).join("deeper");
        plan("figure1_ladder17", &["--report", report.to_str().unwrap()]);
        let read = |file: &str| fs::read_to_string(report.join(file)).unwrap();
        let json: Value = serde_json::from_str(&read("report.json")).unwrap();
        assert_eq!(json["kept_links"], 12);
        (read("before.svg"), read("after.svg"), read("report.html"))
    };
    let (one, other) = (written("one"), written("other"));
    assert_eq!((&one.0, &one.1), (&other.0, &other.1));
    // How long the planning took is a number of its own each time.
    let without_time = |page: &str| -> Vec<String> {
        let parts = page.split("planned offline in");
        parts
            .map(|part| {
                part.split_once("</td>")
                    .map_or(part, |(_, rest)| rest)
                    .to_owned()
            })
            .collect()
    };
    assert_eq!(without_time(&one.2), without_time(&other.2));
    assert_eq!(
        fs::read_dir(directory.path().join("one/deeper"))
            .unwrap()
            .count(),
        4
    );
}

#[test]
fn a_report_that_cannot_be_written_is_bad_input() {
    let output = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(["plan", "--report", "/dev/null/report"])
        .arg(scenario("undersupply"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty());
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(
        stderr.contains("/dev/null/report: cannot be created"),
        "{stderr}"
    );
}

#[test]
fn the_papers_counterexamples_are_planned_and_shown() {
    let hole = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(["plan", "--json"])
        .arg(scenario("paper/theorem_1_hole"))
        .output()
        .unwrap();
    let stderr = String::from_utf8(hole.stderr).unwrap();
    assert_eq!(hole.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("left open: spot 3"), "{stderr}");
    let hole: Value = serde_json::from_slice(&hole.stdout).unwrap();
    assert_eq!(
        (&hole["open_spots"], &hole["unassigned"], &hole["complete"]),
        (&json!([3]), &json!([3]), &json!(false))
    );

    let walled_in = json("paper/theorem_1_walled_in");
    assert_eq!(walled_in["motion"]["mode"], "paths", "in another order");

    let stuck = json("paper/theorem_3_stuck");
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("optimal.yaml");
    let text = fs::read_to_string(scenario("paper/theorem_3_stuck")).unwrap();
    let (before, _) = text.split_once("planner:").unwrap();
    fs::write(&path, format!("{before}planner: {{policy: hungarian}}\n")).unwrap();
    let optimal = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(["plan", "--json"])
        .arg(&path)
        .output()
        .unwrap();
    let optimal: Value = serde_json::from_slice(&optimal.stdout).unwrap();
    let total = |report: &Value| report["total_utility"].as_f64().unwrap();
    assert!(total(&stuck) + 0.5 < total(&optimal), "{stuck} {optimal}");

    let chain = json("paper/eviction_chain");
    assert_eq!(chain["evictions"], 2);
    let missing = json("paper/missing_candidate");
    assert_eq!(missing["broken_links"], 0);
    let assignments = missing["assignments"].as_array().unwrap().iter().take(3);
    let spots: BTreeSet<u64> = assignments
        .map(|pair| pair["spot"].as_u64().unwrap())
        .collect();
    assert_eq!(spots, BTreeSet::from([1, 3, 5]));
}

#[test]
fn the_page_of_a_plan_that_no_module_can_carry_out_says_so() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("walled.yaml");
    // The wall reaches under the module.
    let wall = "obstacles: [{x: 0.8, y: 0, width: 1, height: 1}]\narena: {x: 2, y: 0, width: 9, height: 9}\n";
    let modules =
        "target: {spots: [{id: 1, x: 5, y: 0}], edges: []}\nsingletons: [{id: 1, x: 0, y: 0}]\n";
    fs::write(&file, format!("{modules}{wall}")).unwrap();
    let report = directory.path().join("report");
    let output = Command::new(env!("CARGO_BIN_EXE_formation"))
        .args(["plan", "--report"])
        .args([&report, &file])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0));
    let page = fs::read_to_string(report.join("report.html")).unwrap();
    assert!(page.contains("Planned: 1 of 1 spots get a module, and none can move"));
}
