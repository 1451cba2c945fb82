//! What a laboratory does with rclpy over Fast DDS, the default middleware of ROS 2.

use std::fs;

use formation_tests::{Domain, Rclpy, Running, root, scenario_path};
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
    assert_eq!(results.len(), 3, "{said}");
    for formed in &results[..2] {
        assert_eq!(formed["status"], SUCCEEDED);
        assert_ne!(formed["feedback"], 0);
    }
    assert_eq!(results[2]["status"], CANCELED);
    assert_eq!(find("cancelled")["goals"], 1);
    let status = find("status");
    assert_eq!(
        (&status["target"], &status["settled"]),
        (&json!("singletons-10"), &json!(10))
    );
    // One of the ten modules stands by.
    let own = find("own status");
    assert_eq!(
        (&own["target"], &own["settled"]),
        (&json!("square"), &json!(9))
    );
    // RustDDS writes no user data of endpoints, in which ROS 2 carries them; docs/ros2.md says so.
    assert_eq!(find("type hashes")["found"], json!(["INVALID"]));
    assert_eq!(find("retire")["success"], true);
    assert_eq!(find("rejoin")["success"], true);
    assert_eq!(find("refused")["scenario"], "no_such_scenario");
    for program in programs {
        assert_eq!(program.stop().status, 0);
    }
    println!("{said}");
}

/// Packages whose wheels are not among the requirements; their hashes in the file are those that their wheels publish
/// (`ros-sensor-msgs` and its like, 5.3.6), and that of `tf2_msgs` is the generator's for its definition.
const NOT_INSTALLED: [&str; 4] = [
    "diagnostic_msgs",
    "sensor_msgs",
    "tf2_msgs",
    "visualization_msgs",
];

#[test]
fn type_hashes_are_those_of_the_generator() {
    let Some(rclpy) = Rclpy::find() else {
        return;
    };
    let generated = rclpy.type_hashes();
    let kept = fs::read_to_string(root().join("msgs/type_hashes.txt")).unwrap();
    let kept = kept.lines().filter(|line| !line.starts_with('#'));
    let mut compared = 0;
    for line in kept {
        let (name, hash) = line.split_once(' ').unwrap();
        let package = name.split('/').next().unwrap();
        if !NOT_INSTALLED.contains(&package) {
            assert_eq!(
                generated.get(name).map(String::as_str),
                Some(hash),
                "{name}"
            );
            compared += usize::from(package == "formation_msgs");
        }
    }
    let ours = generated
        .keys()
        .filter(|name| name.starts_with("formation_msgs/"));
    assert_eq!(compared, ours.count(), "msgs/type_hashes.txt lacks types");
}
