//! What a laboratory does with rclpy over Fast DDS, the default middleware of ROS 2.

use formation_tests::{Domain, Rclpy, Running, scenario_path};
use serde_json::{Value, json};

const SUCCEEDED: i64 = 4;
const CANCELED: i64 = 5;

#[test]
fn a_lab_forms_observes_and_commands_with_rclpy() {
    let Some(rclpy) = Rclpy::find() else {
        return;
    };
    let domain = &*Domain::for_processes(4);
    let scenario = scenario_path("singletons_10");
    let folder = scenario.parent().unwrap().to_str().unwrap();
    let hosted = [
        "--modules",
        "1-10",
        "--scenario",
        scenario.to_str().unwrap(),
    ];
    let programs = [
        Running::start("target_publisher", domain, &["--scenario-folder", folder]),
        Running::start("verifier", domain, &["--keep-watching"]),
        Running::start(
            "module_agent",
            domain,
            &[&hosted[..], &["--speed", "50"]].concat(),
        ),
    ];
    let arguments = ["/formation", "modules_1_to_10", "10"];
    let lab = rclpy.start("tests/python/lab.py", domain, &arguments);
    let said = lab.finish();
    let lines: Vec<Value> = said
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let find = |what: &str| {
        let found = lines.iter().find(|line| line["did"] == what);
        found.unwrap_or_else(|| panic!("{what} is missing in {said}"))
    };
    for topic in [
        "module_states",
        "heartbeats",
        "target",
        "roster",
        "claims",
        "verdict",
    ] {
        find(&format!("first sample of {topic}"));
    }
    let results: Vec<&Value> = lines
        .iter()
        .filter(|line| line["did"] == "result")
        .collect();
    assert_eq!(results.len(), 2, "{said}");
    assert_eq!(results[0]["status"], SUCCEEDED);
    assert_ne!(results[0]["feedback"], 0);
    assert_eq!(results[1]["status"], CANCELED);
    assert_eq!(find("cancelled")["goals"], 1);
    let status = find("status");
    assert_eq!(
        (&status["target"], &status["settled"]),
        (&json!("singletons-10"), &json!(10))
    );
    assert_eq!(find("retire")["success"], true);
    assert_eq!(find("rejoin")["success"], true);
    assert_eq!(find("refused")["scenario"], "no_such_scenario");
    for program in programs {
        assert_eq!(program.stop().status, 0);
    }
    println!("{said}");
}
