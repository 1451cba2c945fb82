//! Formations of processes on several machines, each of which is a network namespace here, behind a switch.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_tests::{Domain, Namespace, Network, Running, scenario_path};
use serde_json::Value;

const PATIENCE: Duration = Duration::from_secs(90);
const SCENARIO: &str = "singletons_10";

/// The pairs of modules and spots in a plan or a verdict.
fn assignments(of: &Value) -> BTreeSet<(u64, u64)> {
    let pairs = of["assignments"].as_array().unwrap().iter();
    pairs
        .map(|pair| {
            let number = |key: &str| pair[key].as_u64().unwrap();
            (number("module"), number("spot"))
        })
        .collect()
}

/// Forms the scenario with agents on two machines, the target publisher on a third and the verifier on a fourth, and compares
/// the outcome with the offline plan. `start` starts a program on a machine.
fn forms_as_planned(
    network: &Network,
    domain: &str,
    start: impl Fn(&Namespace, &str, &[&str]) -> Running,
) {
    let scenario = scenario_path(SCENARIO);
    let scenario = scenario.to_str().unwrap();
    let plan = Running::start("formation", domain, &["plan", scenario, "--json"]);
    let plan = plan.finish(PATIENCE).json();
    let of_scenario = ["--scenario", scenario];
    let judged = [&of_scenario[..], &["--json"]].concat();
    let verifier = start(network.side(3), "verifier", &judged);
    let hosted = [("1-3", 0), ("4-5", 0), ("6-8", 1), ("9-10", 1)];
    let _agents = hosted.map(|(modules, side)| {
        let arguments = [&of_scenario[..], &["--modules", modules]].concat();
        start(network.side(side), "module_agent", &arguments)
    });
    let _publisher = start(network.side(2), "target_publisher", &of_scenario);
    let verdict = verifier.finish(PATIENCE).last_json();
    let verdict = &verdict["verdict"];
    assert_eq!(verdict["outcome"], "COMPLETE", "{verdict}");
    assert_eq!(assignments(verdict), assignments(&plan), "{verdict}");
}

#[test]
fn four_machines_form_over_dds_on_one_subnet() {
    let domain = &*Domain::for_processes(7);
    let Some(network) = Network::with_sides(4) else {
        return;
    };
    forms_as_planned(&network, domain, |machine, program, arguments| {
        Running::start_within(machine, program, domain, arguments)
    });
}

#[cfg(feature = "zenoh")]
#[test]
fn four_machines_form_over_zenoh_with_two_routers() {
    let domain = &*Domain::for_processes(9);
    let Some(network) = Network::with_sides(4) else {
        return;
    };
    let [first, second] = [2, 3].map(|side| format!("tcp/{}:7447", Network::address(side)));
    let router = |side, others: &[&str]| {
        Running::start_router(Some(network.side(side)), domain, "tcp/0.0.0.0:7447", others)
    };
    let _first = router(2, &[]);
    let _second = router(3, &[&first]);
    // The agents of the two machines prefer different routers, so that messages pass both.
    let orders = [[&*first, &*second], [&*second, &*first]];
    forms_as_planned(&network, domain, |machine, program, arguments| {
        let is_first = std::ptr::eq(machine, network.side(0));
        let routers = orders[usize::from(!is_first)];
        Running::start_over_zenoh_within(machine, &routers, program, domain, arguments)
    });
}
