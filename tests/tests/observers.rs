//! Participants of other vendors that are there before several agents start at once, and must discover all of them.

use formation_tests::{Domain, Rclpy, RosTool, Running};
use serde_json::json;

const AGENTS: u32 = 8;
/// How long a discovery may take, in seconds.
const LIMIT_S: &str = "5";

/// Starts eight agents at once, which the observer must discover as a whole, and as often as that again.
fn discovers_all(mut observer: RosTool, domain: &str, rounds: u32) {
    assert_eq!(observer.next_line(), json!({"ready": true}));
    for round in 0..rounds {
        let modules: Vec<u32> = (1..=AGENTS).map(|agent| round * AGENTS + agent).collect();
        let agents: Vec<Running> = modules
            .iter()
            .map(|module| {
                let (module, x) = (module.to_string(), (2 * module).to_string());
                let arguments = ["--module", &module, "--x", &x, "--y", "0"];
                Running::start("module_agent", domain, &arguments)
            })
            .collect();
        observer.write_line(&json!(modules));
        let found = observer.next_line();
        assert_eq!(found["missing"], json!([]), "round {round}: {found}");
        for agent in agents {
            assert_eq!(agent.stop().status, 0);
        }
    }
}

fn rclpy_discovers_all(rounds: u32) {
    let Some(rclpy) = Rclpy::find() else {
        return;
    };
    let domain = &*Domain::for_processes(9);
    let observer = rclpy.start(
        "tests/python/observer.py",
        domain,
        &["fast", domain, LIMIT_S],
    );
    discovers_all(observer, domain, rounds);
}

#[test]
fn rclpy_that_is_up_first_discovers_eight_agents_that_start_at_once() {
    rclpy_discovers_all(3);
}

#[test]
#[ignore = "takes a minute; tests/soak_networks.sh runs it"]
fn rclpy_that_is_up_first_discovers_twenty_times_eight_agents() {
    rclpy_discovers_all(20);
}

#[test]
#[ignore = "takes a minute; tests/soak_networks.sh runs it"]
fn cyclonedds_that_is_up_first_discovers_twenty_times_eight_agents() {
    let domain = &*Domain::for_processes(9);
    let Some(observer) = RosTool::start_observer(domain, LIMIT_S) else {
        return;
    };
    discovers_all(observer, domain, 20);
}
