//! The action `FormConfiguration`, driven by CycloneDDS, another vendor's DDS, as the clients of ROS 2 drive it.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::BTreeSet;
use std::time::Duration;

use formation_tests::{Domain, Peer, RosTool, Running, scenario_path};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(20);
const ACTION: &str = "/formation/form_configuration";
/// The values of `action_msgs/msg/GoalStatus`.
const SUCCEEDED: i64 = 4;
const CANCELED: i64 = 5;
const ABORTED: i64 = 6;

/// A publisher that has nothing to announce, a verifier, and the ten modules of a scenario in one process.
fn start(domain: &str, speed: &str) -> [Running; 3] {
    let scenario = scenario_path("singletons_10");
    let folder = scenario.parent().unwrap().to_str().unwrap();
    let scenario = scenario.to_str().unwrap();
    let own = ["--scenario-folder", folder, "--service-mapping", "cyclone"];
    let hosted = ["--modules", "1-10", "--scenario", scenario];
    [
        Running::start("target_publisher", domain, &own),
        Running::start("verifier", domain, &["--keep-watching"]),
        Running::start(
            "module_agent",
            domain,
            &[&hosted[..], &["--speed", speed]].concat(),
        ),
    ]
}

/// Sends a goal; returns its identifier.
fn send(client: &mut RosTool, goal: &Value) -> String {
    client.write_line(&json!({"goal": goal}));
    let answer = client.next_with("accepted");
    assert_eq!(answer["accepted"], true);
    answer["goal"].as_str().unwrap().to_owned()
}

/// Waits for the result of a goal; returns its status, and what it says.
fn result(client: &mut RosTool, goal: &str) -> (i64, Value) {
    let answer = client.next_with("result");
    assert_eq!(answer["goal"], goal);
    (answer["status"].as_i64().unwrap(), answer["result"].clone())
}

fn text(result: &Value) -> &str {
    result["message"].as_str().unwrap()
}

#[test]
fn a_goal_names_a_scenario_is_followed_and_ends_with_the_verdict() {
    let domain = &*Domain::for_processes(4);
    let Some(mut client) = RosTool::start_action_client(&[ACTION, "--domain", domain]) else {
        return;
    };
    let [publisher, verifier, agents] = start(domain, "50");
    client.write_line(&json!({"goal": {"scenario": "singletons"}}));
    assert_eq!(client.next_with("accepted")["accepted"], false);
    let rejected = publisher
        .wait_for_log(0, "rejected a goal", PATIENCE)
        .is_some();
    let names_others = publisher
        .wait_for_log(0, "singletons_10", PATIENCE)
        .is_some();
    assert!(rejected && names_others, "{:?}", publisher.log_since(0));

    let wanted = json!({"scenario": "singletons_10", "expected_modules": 10});
    let goal = send(&mut client, &wanted);
    let mut stages = BTreeSet::new();
    let mut last = Value::Null;
    let ended = loop {
        let line = client.next_line();
        if line["feedback"].is_object() {
            assert_eq!(line["goal"], goal.as_str());
            last = line["feedback"]["progress"].clone();
            stages.insert(last["stage"].as_u64().unwrap());
        } else if line["result"].is_object() {
            break line;
        }
    };
    assert_eq!(
        (&ended["status"], &ended["goal"]),
        (&json!(SUCCEEDED), &json!(goal))
    );
    let verdict = &ended["result"]["verdict"];
    assert_eq!(
        (&verdict["outcome"], &verdict["filled_spots"]),
        (&json!(1), &json!(10))
    );
    assert_eq!(verdict["assignments"].as_array().unwrap().len(), 10);
    assert_eq!(
        text(&ended["result"]),
        "COMPLETE: 10 of 10 spots are filled"
    );
    assert!(
        stages.contains(&2),
        "feedback came while they gathered: {stages:?}"
    );
    assert_eq!(
        (&last["joined"], &last["planned"]),
        (&json!(10), &json!(10))
    );

    // Its endpoints are those that tools look for.
    let node = "/formation/target_publisher";
    let graph = RosTool::start(&["graph", node, "--domain", domain])
        .unwrap()
        .next_line();
    let endpoints = graph["endpoints"].as_array().unwrap();
    for (topic, kind, base, latched) in [
        (
            "rq{}send_goalRequest",
            "subscription",
            "FormConfiguration_SendGoal_Request_",
            false,
        ),
        (
            "rr{}send_goalReply",
            "publisher",
            "FormConfiguration_SendGoal_Response_",
            false,
        ),
        (
            "rq{}get_resultRequest",
            "subscription",
            "FormConfiguration_GetResult_Request_",
            false,
        ),
        (
            "rr{}get_resultReply",
            "publisher",
            "FormConfiguration_GetResult_Response_",
            false,
        ),
        (
            "rt{}feedback",
            "publisher",
            "FormConfiguration_FeedbackMessage_",
            false,
        ),
        (
            "rq{}cancel_goalRequest",
            "subscription",
            "action_msgs::srv::dds_::CancelGoal_Request_",
            false,
        ),
        (
            "rr{}cancel_goalReply",
            "publisher",
            "action_msgs::srv::dds_::CancelGoal_Response_",
            false,
        ),
        (
            "rt{}status",
            "publisher",
            "action_msgs::msg::dds_::GoalStatusArray_",
            true,
        ),
    ] {
        let topic = topic.replace("{}", &format!("{ACTION}/_action/"));
        let endpoint = endpoints
            .iter()
            .find(|endpoint| endpoint["topic"] == topic.as_str() && endpoint["kind"] == kind);
        let endpoint = endpoint.unwrap_or_else(|| panic!("no {kind} of {topic} in {endpoints:#?}"));
        let expected = if base.contains("::") {
            base.to_owned()
        } else {
            format!("formation_msgs::action::dds_::{base}")
        };
        assert_eq!(endpoint["type"], expected.as_str(), "{topic}");
        assert_eq!(
            (&endpoint["reliable"], &endpoint["transient_local"]),
            (&json!(true), &json!(latched)),
            "{topic}"
        );
    }
    assert_eq!(graph["ownerless"], json!([]), "all belong to the node");

    // A late request returns the same result; other goals are unknown.
    client.write_line(&json!({"result": goal}));
    assert_eq!(
        result(&mut client, &goal),
        (SUCCEEDED, ended["result"].clone())
    );
    let unknown = "00112233445566778899aabbccddeeff";
    client.write_line(&json!({"result": unknown}));
    assert_eq!(result(&mut client, unknown).0, 0);
    client.write_line(&json!({"cancel": goal}));
    let terminated = json!({"cancelled": [], "return_code": 3});
    assert_eq!(client.next_with("cancelled"), terminated);

    // The same goal once more is done already, because no module needs to move.
    let again = send(&mut client, &wanted);
    assert_eq!(result(&mut client, &again).0, SUCCEEDED);
    for process in [publisher, agents] {
        assert_eq!(process.stop().status, 0);
    }
    assert_eq!(verifier.stop().status, 0, "its last verdict was COMPLETE");
}

/// A row of spots, far from all modules.
fn row(name: &str, spots: u32) -> Value {
    let places = (1..=spots).map(|id| json!({"id": id, "x": 60 + id, "y": 60}));
    let edges = (1..spots).map(|id| json!({"first": id, "second": id + 1}));
    json!({
        "target": {
            "header": {"frame_id": "map"},
            "name": name,
            "expected_modules": 10,
            "module_size": 1.0,
            "spots": places.collect::<Vec<_>>(),
            "edges": edges.collect::<Vec<_>>(),
            "planner": {"d_max": -1, "weight_loc": 1.0, "weight_dock": 0.25, "weight_undock": 0.15},
        }
    })
}

#[test]
fn a_newer_goal_takes_the_place_of_one_and_a_cancelled_one_leaves_the_modules_standing() {
    let domain = &*Domain::for_processes(4);
    let Some(mut client) = RosTool::start_action_client(&[ACTION, "--domain", domain]) else {
        return;
    };
    let [publisher, _verifier, agents] = start(domain, "0.5");
    let first = send(&mut client, &row("first", 10));
    let second = send(&mut client, &row("second", 9));
    let (status, answer) = result(&mut client, &first);
    assert_eq!(
        (status, text(&answer)),
        (ABORTED, "a newer goal took its place")
    );
    assert_eq!(answer["verdict"]["outcome"], 0);

    let states = Peer::start("take", "module_states", domain).unwrap();
    let heartbeats = Peer::start("take", "heartbeats", domain).unwrap();
    let moving = agents.wait_for_log(0, "moving to", Duration::from_secs(60));
    assert!(moving.is_some(), "no module moved");
    client.write_line(&json!({"cancel": ""}));
    let answer = client.next_with("cancelled");
    assert_eq!(answer, json!({"cancelled": [second], "return_code": 0}));
    let (status, answer) = result(&mut client, &second);
    assert_eq!(status, CANCELED);
    let stand = "the target is withdrawn, and the 10 live modules stand still";
    assert_eq!(text(&answer), stand);
    (1..=10).for_each(|id| states.await_state_of(id, |_, _| true));
    let places = || -> Vec<_> {
        (1..=10)
            .map(|id| states.poses_of(id).last().map(|last| last.1))
            .collect()
    };
    let stands_still = || {
        let before = places();
        heartbeats.await_more(4);
        places() == before
    };
    // The state with the pose of the halt may arrive after the answer; after that one, no module moves.
    assert!(stands_still() || stands_still(), "{:?}", places());

    let expected = json!({"statuses": {first.as_str(): ABORTED, second.as_str(): CANCELED}});
    while client.next_with("statuses") != expected {}
    client.finish();
    assert_eq!(publisher.stop().status, 0);
}
