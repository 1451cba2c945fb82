//! Every topic, service and the action over Zenoh, with a peer on hiroz, an implementation of rmw_zenoh's wire format in Rust that
//! others wrote.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;

use formation_tests::{Domain, HirozPeer, root, scenario_path};
use serde_json::{Value, json};

use crate::zenoh::{Router, TOPICS, deeds_of};

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

/// Endpoints as `node/src/topics.rs` and ROS 2 have them: the kind as rmw_zenoh has it, name, type, and quality of service.
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

/// What the peer did, by name.
struct Deeds(Vec<(String, Value)>);

impl Deeds {
    fn of(&self, name: &str) -> &Value {
        let found = self.0.iter().find(|(did, _)| did == name);
        &found
            .unwrap_or_else(|| panic!("no {name} in {:?}", self.0))
            .1
    }
}

/// The peer uses a formation of six programs, to its end.
fn deeds(peer: &HirozPeer) -> Deeds {
    let domain = &*Domain::for_processes(7);
    let router = Router::start(domain);
    let path = scenario_path("singletons_10");
    let path = path.to_str().unwrap();
    let port = router.port.to_string();
    let mut peer = peer.start(&[&port, domain, "/formation", path, "module_10"]);
    let mut said = BufReader::new(peer.stdout.take().unwrap());
    let mut first = String::new();
    said.read_line(&mut first).unwrap();
    assert!(first.contains("connected"), "{first}");
    let agent = |more: &[&str]| {
        let arguments = [&["--scenario", path], more].concat();
        router.run("module_agent", domain, &arguments)
    };
    let folder = Path::new(path).parent().unwrap().to_str().unwrap();
    let external = ["--motion", "external"];
    let odometry = ["--pose-source", "odom"];
    let _programs = [
        router.run("verifier", domain, &["--scenario", path, "--keep-watching"]),
        router.run("target_publisher", domain, &["--scenario-folder", folder]),
        router.run("visualiser", domain, &[]),
        agent(&[&["--modules", "1-5"], &external[..]].concat()),
        agent(&[&["--modules", "6-9"], &external[..], &odometry].concat()),
        agent(&["--modules", "10", "--speed", "4"]),
    ];
    let deeds = deeds_of(said);
    assert!(peer.wait().unwrap().success(), "{deeds:?}");
    Deeds(deeds)
}

#[test]
fn a_peer_on_hiroz_uses_every_topic_service_and_the_action() {
    let Some(peer) = HirozPeer::find() else {
        return;
    };
    let deeds = deeds(&peer);
    assert_action(&deeds);
    assert_services(&deeds);
    assert_topics(&deeds);
    let hashes = assert_types(&deeds);
    assert_graph(deeds.of("graph"), &hashes);
}

fn assert_action(deeds: &Deeds) {
    let (succeeded, cancelled, complete) = (4, 5, 1);
    assert_eq!(deeds.of("goal")["accepted"], true);
    let result = deeds.of("result");
    assert_eq!(result["status"], succeeded, "{result}");
    assert_eq!(result["outcome"], complete, "{result}");
    let (gathering, acting) = (json!(2), json!(5));
    let stages = result["stages"].as_array().unwrap();
    assert!(
        stages.contains(&gathering) && stages.contains(&acting),
        "{result}"
    );
    let cancel = deeds.of("cancel");
    assert_eq!(cancel["goals"], 1);
    assert_eq!(cancel["status"], cancelled);
    assert!(cancel["stage"].is_u64(), "{cancel}");
}

fn assert_services(deeds: &Deeds) {
    assert_eq!(deeds.of("query_status")["settled"], 10);
    assert_eq!(deeds.of("get_parameters")["values"], json!([0.5, 10.0]));
    let double = 3;
    assert_eq!(
        deeds.of("get_parameter_types")["types"],
        json!([double, double])
    );
    let described = &deeds.of("describe_parameters")["names_and_texts"];
    assert_eq!(described[0][0], "heartbeat_s");
    assert!(!described[1][1].as_str().unwrap().is_empty());
    let listed = deeds.of("list_parameters")["names"].as_array().unwrap();
    assert!(listed.contains(&json!("stuck_s")), "{listed:?}");
    for name in ["set_parameters", "set_parameters_atomically"] {
        assert_eq!(deeds.of(name)["successful"], json!([true]), "{name}");
    }
    for name in [
        "stop",
        "resume",
        "add_module",
        "retire_module",
        "remove_module",
        "withdraw_target",
    ] {
        assert_eq!(deeds.of(name)["success"], true, "{name}");
    }
}

fn assert_topics(deeds: &Deeds) {
    let complete = 1;
    assert_eq!(deeds.of("target")["name"], "moved");
    assert_eq!(
        deeds.of("verdict")["outcome"],
        complete,
        "of its own target"
    );
    assert_eq!(deeds.of("late")["outcome"], complete);
    deeds.of("command");
    let received = deeds.of("received")["topics"].as_object().unwrap();
    // The client of the action receives the feedback.
    let topics = TOPICS.iter().filter(|topic| !topic.ends_with("/feedback"));
    for topic in topics {
        assert!(received.contains_key(*topic), "{topic} in {received:?}");
    }
    assert!(
        received.keys().any(|topic| topic.ends_with("/docking")),
        "{received:?}"
    );
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
