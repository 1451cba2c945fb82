//! What a peer that others wrote does with a formation of six programs over Zenoh: one use of every topic, service and the action.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Child;

use formation_tests::{Domain, scenario_path};
use serde_json::{Value, json};

use crate::zenoh::Router;

/// The topics of a formation with drivers and a visualiser; the requests for docking come from whichever modules dock.
const TOPICS: &[&str] = &[
    "target",
    "module_states",
    "roster",
    "claims",
    "evictions",
    "heartbeats",
    "commands",
    "verdict",
    "markers",
    "/tf",
    "/tf_static",
    "/rosout",
    "/diagnostics",
    "/parameter_events",
    "form_configuration/_action/feedback",
    "form_configuration/_action/status",
    "module_1/goal_pose",
    "module_1/path",
];

/// What a peer did: the fields of each thing by its name, in the order in which it printed them.
pub struct Deeds(Vec<(String, Value)>);

impl Deeds {
    /// A peer uses a formation, to its end. It is started with the port of the router, the domain, the namespace, the scenario and
    /// the node that hosts the last module, and prints a line of JSON for each thing that it did, beginning with `connected`.
    pub fn of_peer(start: impl FnOnce(&[&str]) -> Child) -> Self {
        let domain = &*Domain::for_processes(7);
        let router = Router::start(domain);
        let path = scenario_path("singletons_10");
        let path = path.to_str().unwrap();
        let port = router.port.to_string();
        let mut peer = start(&[&port, domain, "/formation", path, "module_10"]);
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
        let deeds = said.lines().map(|line| {
            let deed: Value = serde_json::from_str(&line.unwrap()).unwrap();
            (deed["did"].as_str().unwrap().to_owned(), deed)
        });
        let deeds: Vec<(String, Value)> = deeds.collect();
        assert!(peer.wait().unwrap().success(), "{deeds:?}");
        Self(deeds)
    }

    /// The fields of what was done under a name.
    pub fn of(&self, name: &str) -> &Value {
        let found = self.0.iter().find(|(did, _)| did == name);
        &found
            .unwrap_or_else(|| panic!("no {name} in {:?}", self.0))
            .1
    }

    /// What was received on each topic, by its name.
    pub fn received(&self) -> &serde_json::Map<String, Value> {
        self.of("received")["topics"].as_object().unwrap()
    }

    /// Every topic was received but those whose samples the peer shows in another way, every service answered, and the action ended
    /// as it should.
    pub fn assert_complete(&self, shown_otherwise: &[&str]) {
        self.assert_action();
        self.assert_services();
        let complete = 1;
        assert_eq!(self.of("verdict")["outcome"], complete, "of its own target");
        self.of("command");
        let received = self.received();
        for topic in TOPICS {
            let is_received = received.contains_key(*topic) || shown_otherwise.contains(topic);
            assert!(is_received, "{topic} in {received:?}");
        }
        assert!(
            received.keys().any(|topic| topic.ends_with("/docking")),
            "{received:?}"
        );
    }

    fn assert_action(&self) {
        let (succeeded, cancelled, complete) = (4, 5, 1);
        assert_eq!(self.of("goal")["accepted"], true);
        let result = self.of("result");
        assert_eq!(result["status"], succeeded, "{result}");
        assert_eq!(result["outcome"], complete, "{result}");
        assert_eq!(self.of("cancel")["goals"], 1);
        assert_eq!(self.of("cancel")["status"], cancelled);
    }

    fn assert_services(&self) {
        assert_eq!(self.of("query_status")["settled"], 10);
        assert_eq!(self.of("get_parameters")["values"], json!([0.5, 10.0]));
        let double = 3;
        assert_eq!(
            self.of("get_parameter_types")["types"],
            json!([double, double])
        );
        let names = ["heartbeat_s", "stuck_s"];
        let described = self.of("describe_parameters");
        assert_eq!(described["names"], json!(names));
        let texts = described["texts"].as_array().unwrap();
        assert!(texts.iter().all(|text| text != ""), "{texts:?}");
        let listed = self.of("list_parameters")["names"].as_array().unwrap();
        for name in names {
            assert!(listed.contains(&json!(name)), "{name} in {listed:?}");
        }
        for name in ["set_parameters", "set_parameters_atomically"] {
            assert_eq!(self.of(name)["successful"], json!([true]), "{name}");
        }
        for name in [
            "stop",
            "resume",
            "add_module",
            "retire_module",
            "remove_module",
            "withdraw_target",
        ] {
            assert_eq!(self.of(name)["success"], true, "{name}");
        }
    }
}
