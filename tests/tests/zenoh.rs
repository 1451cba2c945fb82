//! Formations over Zenoh, and a peer on it that we did not write.

use std::fs;
use std::net::TcpListener;
use std::process::Stdio;
use std::time::Duration;

use formation_tests::{Domain, Python, Running, scenario_path};

use crate::formations::runs_as_planned;
use crate::zenoh_deeds::Deeds;

const PATIENCE: Duration = Duration::from_secs(60);

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

#[test]
fn a_client_that_others_wrote_uses_every_topic_service_and_the_action() {
    let Some(python) = Python::with_zenoh() else {
        return;
    };
    let deeds = Deeds::of_peer(|arguments| {
        python.start("tests/python/zenoh_lab.py", arguments, Stdio::inherit())
    });
    deeds.assert_complete(&[]);
    assert!(deeds.of("late")["message"].is_string());
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
        assert_eq!(deeds.of("topics")["types"][topic][0], kind);
    }
    let service = "/formation/modules_1_to_5/set_parameters";
    let kind = "rcl_interfaces/srv/SetParameters";
    assert_eq!(deeds.of("services")["types"][service][0], kind);
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
