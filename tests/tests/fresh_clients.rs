//! Service calls of fresh processes: whether each is answered, and how soon. `tests/soak_services.sh` runs this.

use std::time::Duration;

use formation_tests::{Domain, Rclpy, RosTool, Running, report, scenario_path};
use serde_json::json;

const PATIENCE: Duration = Duration::from_secs(60);

/// How many processes of each kind call.
fn calls() -> usize {
    let given = std::env::var("FORMATION_CALLS").ok();
    given.map_or(100, |count| count.parse().unwrap())
}

/// A publisher that serves clients with this mapping of services.
fn server(domain: &str, mapping: &str) -> Running {
    let scenario = scenario_path("singletons_10");
    let arguments = ["--scenario", scenario.to_str().unwrap()];
    let mapping = ["--service-mapping", mapping];
    let server = Running::start("target_publisher", domain, &[arguments, mapping].concat());
    let joined = server.wait_for_log(0, "joined the ROS 2 graph", PATIENCE);
    assert!(joined.is_some(), "{:?}", server.log_since(0));
    server
}

/// Reports how long the answers took, and requires that all came.
fn judge(kind: &str, mut seconds: Vec<Option<f64>>) {
    let asked = seconds.len();
    seconds.retain(Option::is_some);
    let mut answered: Vec<f64> = seconds.into_iter().flatten().collect();
    answered.sort_by(f64::total_cmp);
    let at = |share: usize| answered.get((answered.len() * share / 100).min(answered.len() - 1));
    let late = answered.iter().filter(|&&seconds| seconds > 1.0).count();
    report(&format!(
        "{kind}: {} of {asked} calls answered; median {:.3} s, 90 of 100 within {:.3} s, worst {:.3} s; {late} after more than \
         1 s",
        answered.len(),
        at(50).unwrap(),
        at(90).unwrap(),
        answered.last().unwrap(),
    ));
    assert_eq!(answered.len(), asked, "{kind}");
}

#[test]
#[ignore = "takes ten minutes; tests/soak_services.sh runs it"]
fn calls_of_fresh_processes_over_fast_dds_are_answered() {
    let Some(rclpy) = Rclpy::find() else {
        return;
    };
    let domain = &*Domain::alone();
    let _server = server(domain, "enhanced");
    for wait in ["0.2", "0"] {
        let call = |_| {
            let arguments = ["/formation", wait];
            let mut client = rclpy.start("tests/python/one_call.py", domain, &arguments);
            client.next_line()["seconds"].as_f64()
        };
        let seconds = (0..calls()).map(call).collect();
        judge(
            &format!("rclpy over Fast DDS, {wait} s after the service was found"),
            seconds,
        );
    }
}

#[test]
#[ignore = "takes five minutes; tests/soak_services.sh runs it"]
fn calls_of_fresh_processes_over_cyclonedds_are_answered() {
    let domain = &*Domain::alone();
    let _server = server(domain, "cyclone");
    let mut seconds = Vec::new();
    for _ in 0..calls() {
        let node = "/formation/target_publisher";
        let Some(mut client) = RosTool::start(&["call", node, "--domain", domain, "--timed"])
        else {
            return;
        };
        let request = json!({"include_waiting": true});
        let type_name = "formation_msgs/srv/QueryStatus";
        let answer = client.call("/formation/query_status", type_name, &request);
        seconds.push(answer["seconds"].as_f64());
    }
    judge("CycloneDDS, as soon as the service was found", seconds);
}
