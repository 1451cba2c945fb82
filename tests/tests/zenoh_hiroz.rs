//! Every topic, service and the action over Zenoh, with a peer on hiroz, an implementation of rmw_zenoh's wire format in Rust that
//! others wrote.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use formation_tests::{HirozPeer, root};
use serde_json::{Value, json};

use crate::zenoh_deeds::Deeds;

/// The types whose hash hiroz 0.2.1 computes other than the generator of ROS 2 does, so that the peer corrects it: it has no
/// sequences of bounded strings, which the verdict has; no bounded strings in actions; no list of goals in the response to a
/// cancellation; and for an action the hash of its goal.
const CORRECTED: &[&str] = &[
    "action_msgs/srv/CancelGoal",
    "formation_msgs/action/FormConfiguration",
    "formation_msgs/action/FormConfiguration_GetResult",
    "formation_msgs/action/FormConfiguration_SendGoal",
    "formation_msgs/msg/Verdict",
];

/// Endpoints as `node_support/src/topics.rs` and ROS 2 have them: the kind as rmw_zenoh has it, name, type, and quality of service.
const ENDPOINTS: &[&str] = &[
    "MP /formation/target formation_msgs/msg/TargetConfiguration Reliable TransientLocal 1",
    "MS /formation/target formation_msgs/msg/TargetConfiguration Reliable TransientLocal 1",
    "MP /formation/claims formation_msgs/msg/SpotClaim Reliable TransientLocal 64",
    "MP /formation/evictions formation_msgs/msg/Eviction Reliable TransientLocal 100",
    "MP /formation/heartbeats formation_msgs/msg/Heartbeat BestEffort Volatile 1",
    "MP /formation/module_1/goal_pose geometry_msgs/msg/PoseStamped Reliable Volatile 1",
    "MS /formation/module_6/odom nav_msgs/msg/Odometry BestEffort Volatile 1",
    "MP /rosout rcl_interfaces/msg/Log Reliable TransientLocal 100",
    "MP /formation/form_configuration/_action/status action_msgs/msg/GoalStatusArray Reliable TransientLocal 1",
    "SS /formation/form_configuration/_action/cancel_goal action_msgs/srv/CancelGoal Reliable Volatile 10",
    "SS /formation/modules_1_to_5/set_parameters rcl_interfaces/srv/SetParameters Reliable Volatile 10",
];

#[test]
fn a_peer_on_hiroz_uses_every_topic_service_and_the_action() {
    let Some(peer) = HirozPeer::find() else {
        return;
    };
    let deeds = Deeds::of_peer(|arguments| peer.start(arguments));
    // Its client of the action receives the feedback.
    deeds.assert_complete(&["form_configuration/_action/feedback"]);
    assert_stages(&deeds);
    assert_topics(&deeds);
    let hashes = assert_types(&deeds);
    assert_graph(deeds.of("graph"), &hashes);
}

/// What its client of the action received as feedback.
fn assert_stages(deeds: &Deeds) {
    let (gathering, acting) = (json!(2), json!(5));
    let result = deeds.of("result");
    let stages = result["stages"].as_array().unwrap();
    assert!(
        stages.contains(&gathering) && stages.contains(&acting),
        "{result}"
    );
    let cancel = deeds.of("cancel");
    assert!(cancel["stage"].is_u64(), "{cancel}");
}

fn assert_topics(deeds: &Deeds) {
    let complete = 1;
    assert_eq!(deeds.of("target")["name"], "moved");
    assert_eq!(deeds.of("late")["outcome"], complete);
    let received = deeds.received();
    for (topic, seen) in received {
        assert_eq!(seen["refused"], json!([]), "{topic}");
        assert_eq!(seen["out_of_order"], 0, "{topic}");
    }
    for (topic, publishers) in [("heartbeats", 3), ("target", 2), ("/rosout", 6)] {
        assert_eq!(received[topic]["publishers"], publishers, "{topic}");
    }
}

/// The hashes of the generator of ROS 2, which are those that the peer uses.
fn assert_types(deeds: &Deeds) -> BTreeMap<String, String> {
    let hashes = fs::read_to_string(root().join("msgs/type_hashes.txt")).unwrap();
    let hashes = hashes.lines().filter(|line| !line.starts_with('#'));
    let hashes: BTreeMap<String, String> = hashes
        .filter_map(|line| line.split_once(' '))
        .map(|(name, hash)| (name.to_owned(), hash.to_owned()))
        .collect();
    let types = deeds.of("types");
    let used = types["hashes"].as_object().unwrap();
    assert!(used.len() > 25, "{used:?}");
    for (name, hash) in used {
        assert_eq!(
            Some(hash.as_str().unwrap()),
            hashes.get(name).map(String::as_str),
            "{name}"
        );
    }
    let corrected = types["corrected"].as_array().unwrap().iter();
    let corrected: BTreeSet<&str> = corrected.map(|one| one[0].as_str().unwrap()).collect();
    assert_eq!(corrected, CORRECTED.iter().copied().collect());
    hashes
}

/// The graph of hiroz shows every node of ours, with its endpoints.
fn assert_graph(graph: &Value, hashes: &BTreeMap<String, String>) {
    let nodes = graph["nodes"].as_array().unwrap().iter();
    let nodes: BTreeSet<(&str, &str)> = nodes
        .map(|node| {
            (
                node["namespace"].as_str().unwrap(),
                node["name"].as_str().unwrap(),
            )
        })
        .collect();
    let expected = [
        "module_10",
        "modules_1_to_5",
        "modules_6_to_9",
        "target_publisher",
        "verifier",
        "visualiser",
    ];
    assert_eq!(nodes, expected.map(|name| ("/formation", name)).into());
    assert_eq!(graph["actions"][0][0], "/formation/form_configuration");
    let endpoints = graph["endpoints"].as_array().unwrap();
    for endpoint in endpoints {
        let name = endpoint["type"].as_str().unwrap();
        let hash = hashes.get(name).map(String::as_str);
        assert_eq!(endpoint["hash"].as_str(), hash, "{endpoint}");
    }
    let shown: BTreeSet<String> = endpoints.iter().map(described).collect();
    for endpoint in ENDPOINTS {
        assert!(shown.contains(*endpoint), "{endpoint} in {shown:?}");
    }
}

fn described(endpoint: &Value) -> String {
    let fields = ["kind", "name", "type", "reliability", "durability"];
    let fields = fields.map(|field| endpoint[field].as_str().unwrap());
    format!("{} {}", fields.join(" "), endpoint["depth"])
}
