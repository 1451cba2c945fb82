//! Formations over Zenoh, and a peer on it that we did not write.

use std::io::Read;
use std::net::TcpListener;
use std::process::Stdio;
use std::time::Duration;

use formation_tests::{Domain, Python, Running, scenario_path};
use serde_json::Value;

use crate::formations::runs_as_planned;

const PATIENCE: Duration = Duration::from_secs(60);

/// A port of loopback that no program uses.
pub fn free_port() -> u16 {
    let socket = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    socket.local_addr().unwrap().port()
}

/// A router on a free port of loopback.
pub struct Router {
    process: Running,
    port: u16,
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

    fn run(&self, name: &str, domain: &str, arguments: &[&str]) -> Running {
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

#[test]
fn a_peer_that_others_wrote_receives_calls_and_lists() {
    let Some(python) = Python::with_zenoh() else {
        return;
    };
    let domain = &*Domain::for_processes(4);
    let router = Router::start(domain);
    let scenario = scenario_path("singletons_10");
    let scenario = ["--scenario", scenario.to_str().unwrap()];
    let slow = ["--modules", "1-10", "--speed", "0.01"];
    let _programs = [
        router.run("target_publisher", domain, &scenario),
        router.run("module_agent", domain, &[&scenario[..], &slow].concat()),
    ];
    let port = router.port.to_string();
    let arguments = [port.as_str(), domain, "/formation"];
    let mut peer = python.start("tests/python/zenoh_peer.py", &arguments, Stdio::inherit());
    let mut said = String::new();
    peer.stdout
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    assert!(peer.wait().unwrap().success(), "{said}");
    let said: Value = serde_json::from_str(&said).unwrap();
    assert_ne!(said["heartbeat"], false, "{said}");
    assert!(said["log"].is_string(), "{said}");
    assert_eq!(said["answer"][0], true, "{said}");
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
        assert_eq!(said["topics"][topic][0], kind, "{said}");
    }
    let service = "/formation/modules_1_to_10/set_parameters";
    assert_eq!(
        said["services"][service][0],
        "rcl_interfaces/srv/SetParameters"
    );
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
