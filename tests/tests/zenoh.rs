//! Formations over Zenoh, and a peer on it that we did not write.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use formation_tests::{Domain, Python, Running, scenario_path};
use serde_json::{Value, json};

use crate::formations::runs_as_planned;

const PATIENCE: Duration = Duration::from_secs(60);

/// What a formation with drivers and a visualiser publishes; the requests for docking come from whichever modules dock.
pub const TOPICS: &[&str] = &[
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

/// A port of loopback that no program uses.
pub fn free_port() -> u16 {
    let socket = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    socket.local_addr().unwrap().port()
}

/// A router on a free port of loopback.
pub struct Router {
    process: Running,
    pub port: u16,
}

impl Router {
    pub fn start(domain: &str) -> Self {
        Self::on(free_port(), domain, &[])
    }

    /// A router on this port that connects to others.
    fn on(port: u16, domain: &str, others: &[&Self]) -> Self {
        let endpoint = format!("tcp/127.0.0.1:{port}");
        let others: Vec<String> = others.iter().map(|other| other.endpoint()).collect();
        let others: Vec<&str> = others.iter().map(String::as_str).collect();
        let process = Running::start_router(None, domain, &endpoint, &others);
        Self { process, port }
    }

    /// Where it listens.
    pub fn endpoint(&self) -> String {
        format!("tcp/127.0.0.1:{}", self.port)
    }

    pub fn run(&self, name: &str, domain: &str, arguments: &[&str]) -> Running {
        Running::start_over_zenoh(&[&self.endpoint()], name, domain, arguments)
    }
}

fn assert_complete(verifier: Running) {
    let finished = verifier.finish(PATIENCE);
    let verdict = finished.last_json();
    assert_eq!(
        verdict["verdict"]["outcome"], "COMPLETE",
        "{}",
        finished.stdout
    );
}

#[test]
fn formations_are_as_planned() {
    for (scenario, outcome) in [
        ("figure1_ladder17", "COMPLETE"),
        ("undersupply", "PARTIAL"),
        ("oversupply", "COMPLETE"),
    ] {
        runs_as_planned(scenario, outcome, &["--middleware", "zenoh"]);
    }
}

/// What DDS gives is compared with the same plans, by `tests/tests/formations.rs`.
#[test]
fn every_shipped_scenario_is_allocated_as_planned() {
    let mut scenarios = 0;
    for folder in ["", "case_studies/"] {
        let entries = scenario_path(&format!("{folder}x"));
        for entry in fs::read_dir(entries.parent().unwrap()).unwrap() {
            let path = entry.unwrap().path();
            if path
                .extension()
                .is_some_and(|extension| extension == "yaml")
            {
                let name = path.file_stem().unwrap().to_str().unwrap();
                let more = ["--middleware", "zenoh", "--plan-only"];
                runs_as_planned(&format!("{folder}{name}"), "AGREED", &more);
                scenarios += 1;
            }
        }
    }
    assert!(scenarios >= 15, "{scenarios}");
}

/// What `tests/python/zenoh_lab.py`, or the peer on hiroz, did: the fields of each thing by its name, in the order in which it printed them.
pub fn deeds_of(said: impl BufRead) -> Vec<(String, Value)> {
    let lines = said.lines().map(|line| {
        let deed: Value = serde_json::from_str(&line.unwrap()).unwrap();
        (deed["did"].as_str().unwrap().to_owned(), deed)
    });
    lines.collect()
}

#[test]
fn a_client_that_others_wrote_uses_every_topic_service_and_the_action() {
    let Some(python) = Python::with_zenoh() else {
        return;
    };
    let domain = &*Domain::for_processes(7);
    let router = Router::start(domain);
    let path = scenario_path("singletons_10");
    let path = path.to_str().unwrap();
    let port = router.port.to_string();
    let arguments = [port.as_str(), domain, "/formation", path, "module_10"];
    let mut lab = python.start("tests/python/zenoh_lab.py", &arguments, Stdio::inherit());
    let mut said = BufReader::new(lab.stdout.take().unwrap());
    let mut first = String::new();
    said.read_line(&mut first).unwrap();
    assert!(first.contains("connected"), "{first}");
    let agent = |more: &[&str]| {
        let arguments = [&["--scenario", path], more].concat();
        router.run("module_agent", domain, &arguments)
    };
    let folder = Path::new(path).parent().unwrap().to_str().unwrap();
    let _programs = [
        router.run("verifier", domain, &["--scenario", path, "--keep-watching"]),
        router.run("target_publisher", domain, &["--scenario-folder", folder]),
        router.run("visualiser", domain, &[]),
        agent(&["--modules", "1-5", "--motion", "external"]),
        agent(&[
            "--modules",
            "6-9",
            "--motion",
            "external",
            "--pose-source",
            "odom",
        ]),
        agent(&["--modules", "10", "--speed", "4"]),
    ];
    let deeds = deeds_of(said);
    assert!(lab.wait().unwrap().success(), "{deeds:?}");
    let deed = |name: &str| {
        let found = deeds.iter().find(|(did, _)| did == name);
        &found.unwrap_or_else(|| panic!("no {name} in {deeds:?}")).1
    };
    let (succeeded, complete) = (4, 1);
    assert_eq!(deed("goal")["accepted"], true);
    assert_eq!(deed("result")["status"], succeeded, "{deeds:?}");
    assert_eq!(deed("result")["outcome"], complete, "{deeds:?}");
    assert_eq!(deed("query_status")["settled"], 10);
    assert_eq!(deed("get_parameters")["values"], json!([0.5, 10.0]));
    let double = 3;
    assert_eq!(
        deed("get_parameter_types")["types"],
        json!([double, double])
    );
    let names = json!(["heartbeat_s", "stuck_s"]);
    assert_eq!(deed("describe_parameters")["names"], names);
    let listed = deed("list_parameters")["names"].as_array().unwrap();
    assert!(
        names
            .as_array()
            .unwrap()
            .iter()
            .all(|name| listed.contains(name))
    );
    for name in ["set_parameters", "set_parameters_atomically"] {
        assert_eq!(deed(name)["successful"], json!([true]), "{name}");
    }
    for name in [
        "stop",
        "resume",
        "add_module",
        "retire_module",
        "remove_module",
        "withdraw_target",
    ] {
        assert_eq!(deed(name)["success"], true, "{name} in {deeds:?}");
    }
    assert_eq!(deed("verdict")["outcome"], complete, "of its own target");
    let cancelled = 5;
    assert_eq!(deed("cancel")["goals"], 1);
    assert_eq!(deed("cancel")["status"], cancelled);
    deed("command");
    assert!(deed("late")["message"].is_string());
    let received = deed("received")["topics"].as_object().unwrap();
    for topic in TOPICS {
        assert!(received.contains_key(*topic), "{topic} in {received:?}");
    }
    assert!(
        received.keys().any(|topic| topic.ends_with("/docking")),
        "{received:?}"
    );
    for (topic, kind) in [
        (
            "/formation/module_states",
            "formation_msgs/msg/ModuleStates",
        ),
        ("/rosout", "rcl_interfaces/msg/Log"),
        (
            "/formation/form_configuration/_action/feedback",
            "formation_msgs/action/FormConfiguration_FeedbackMessage",
        ),
    ] {
        assert_eq!(deed("topics")["types"][topic][0], kind);
    }
    let service = "/formation/modules_1_to_5/set_parameters";
    let kind = "rcl_interfaces/srv/SetParameters";
    assert_eq!(deed("services")["types"][service][0], kind);
}

#[test]
fn a_formation_goes_on_when_its_router_is_killed_and_restarted() {
    let domain = &*Domain::for_processes(5);
    let mut router = Router::start(domain);
    let scenario = scenario_path("singletons_10");
    let scenario = ["--scenario", scenario.to_str().unwrap()];
    let verifier = router.run("verifier", domain, &[&scenario[..], &["--json"]].concat());
    let halves = ["1-5", "6-10"].map(|modules| {
        let hosted = ["--modules", modules, "--speed", "0.5"];
        router.run("module_agent", domain, &[&scenario[..], &hosted].concat())
    });
    let _publisher = router.run("target_publisher", domain, &scenario);
    for half in &halves {
        let moving = half.wait_for_log(0, "moving to spot", PATIENCE);
        assert!(moving.is_some(), "{:?}", half.log_since(0));
    }
    let port = router.port;
    router.process.kill();
    // Nothing moves without the others for longer than the lease.
    for half in &halves {
        let halted = half.wait_for_log(0, "halted: agreement of modules", PATIENCE);
        assert!(halted.is_some(), "{:?}", half.log_since(0));
    }
    let _router = Router::on(port, domain, &[]);
    assert_complete(verifier);
}

#[test]
fn a_formation_goes_on_over_another_router_when_one_is_killed() {
    let domain = &*Domain::for_processes(6);
    let mut first = Router::start(domain);
    let second = Router::on(free_port(), domain, &[&first]);
    let [both, reversed] =
        [[&first, &second], [&second, &first]].map(|routers| routers.map(Router::endpoint));
    let run = |routers: &[String; 2], name: &str, arguments: &[&str]| {
        let routers: [&str; 2] = [&routers[0], &routers[1]];
        Running::start_over_zenoh(&routers, name, domain, arguments)
    };
    let scenario = scenario_path("singletons_10");
    let scenario = ["--scenario", scenario.to_str().unwrap()];
    let verifier = run(
        &reversed,
        "verifier",
        &[&scenario[..], &["--json"]].concat(),
    );
    let halves = [("1-5", &both), ("6-10", &reversed)].map(|(modules, routers)| {
        let hosted = ["--modules", modules, "--speed", "0.5"];
        run(routers, "module_agent", &[&scenario[..], &hosted].concat())
    });
    let _publisher = run(&reversed, "target_publisher", &scenario);
    for half in &halves {
        let moving = half.wait_for_log(0, "moving to spot", PATIENCE);
        assert!(moving.is_some(), "{:?}", half.log_since(0));
    }
    first.process.kill();
    let changed = halves[0].wait_for_log(0, "connected to a router again", PATIENCE);
    assert!(changed.is_some(), "{:?}", halves[0].log_since(0));
    assert_complete(verifier);
    // The half with the other router never lost it.
    let log = halves[1].log_since(0);
    let has_changed = log.iter().any(|line| line.text.contains("router again"));
    assert!(!has_changed, "{log:?}");
}
