//! Participants of other vendors that join right after the target and the verdict changed, and must get the present ones only, and
//! volatile subscribers, which must get each change.

use formation_tests::{Domain, Rclpy, RosTool, Running};
use serde_json::{Value, json};

const ACTION: &str = "/formation/form_configuration";
const SUCCEEDED: i64 = 4;

/// A target of one spot, to and fro.
fn goal(round: u32) -> Value {
    json!({"target": {
        "header": {"frame_id": "map"},
        "name": format!("round {round}"),
        "expected_modules": 1,
        "spots": [{"id": 1, "x": f64::from(round % 2), "y": 0.0, "theta": 0.0}],
        "planner": {"d_max": -1, "weight_loc": 1.0, "weight_dock": 0.25, "weight_undock": 0.15},
    }})
}

/// Forms a target after the other; the joiner joins as soon as each is formed.
fn gets_the_present_only(mut joiner: RosTool, domain: &str, rounds: u32) {
    let client = RosTool::start_action_client(&[ACTION, "--domain", domain]);
    let Some(mut client) = client else {
        return;
    };
    assert_eq!(joiner.next_line(), json!({"ready": true}));
    let module = ["--module", "1", "--x", "0", "--y", "0", "--speed", "50"];
    let _programs = [
        Running::start(
            "target_publisher",
            domain,
            &["--service-mapping", "cyclone"],
        ),
        Running::start("verifier", domain, &["--keep-watching"]),
        Running::start("module_agent", domain, &module),
    ];
    for round in 1..=rounds {
        let goal = goal(round);
        client.write_line(&json!({"goal": goal}));
        assert_eq!(client.next_with("accepted")["accepted"], true);
        let formed = client.next_with("result");
        assert_eq!(formed["status"], SUCCEEDED, "{formed}");
        joiner.write_line(&json!(round));
        let got = joiner.next_line();
        let present = json!({
            "target": [goal["target"]["name"]],
            "verdict": [formed["result"]["verdict"]["header"]["stamp"]],
            "volatile": [goal["target"]["name"]],
        });
        assert_eq!(got, present, "round {round}");
    }
}

fn cyclonedds_gets_the_present_only(rounds: u32) {
    let domain = &*Domain::for_processes(6);
    if let Some(joiner) = RosTool::start_late_joiner(domain) {
        gets_the_present_only(joiner, domain, rounds);
    }
}

fn rclpy_gets_the_present_only(rounds: u32) {
    let Some(rclpy) = Rclpy::find() else {
        return;
    };
    let domain = &*Domain::for_processes(6);
    let joiner = rclpy.start("tests/python/late_joiner.py", domain, &["fast", domain]);
    gets_the_present_only(joiner, domain, rounds);
}

#[test]
fn cyclonedds_that_joins_after_a_change_gets_the_present_only() {
    cyclonedds_gets_the_present_only(3);
}

#[test]
fn rclpy_that_joins_after_a_change_gets_the_present_only() {
    rclpy_gets_the_present_only(3);
}

#[test]
#[ignore = "takes minutes; tests/soak_networks.sh runs it"]
fn cyclonedds_that_joins_after_fifty_changes_gets_the_present_only() {
    cyclonedds_gets_the_present_only(50);
}

#[test]
#[ignore = "takes minutes; tests/soak_networks.sh runs it"]
fn rclpy_that_joins_after_fifty_changes_gets_the_present_only() {
    rclpy_gets_the_present_only(50);
}
