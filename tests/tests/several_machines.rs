//! Formations of processes on several machines, each of which is a network namespace here, behind a switch.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_tests::{Domain, Namespace, Network, Running, scenario_path};
use serde_json::Value;

const PATIENCE: Duration = Duration::from_secs(120);
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

/// The log line of a process that joins the graph again, and at which address.
const REJOINS: &str = "this machine is now reached at ";

/// Two machines with five modules each, the target publisher and the verifier on the second one; what happens to the network of
/// the first is up to the test.
struct TwoMachines {
    network: Network,
    domain: Domain,
    /// A process of modules on the first machine, and one on the second.
    agents: [Running; 2],
    _publisher: Running,
    verifier: Running,
    /// Over Zenoh, on the second machine.
    _router: Option<Running>,
}

impl TwoMachines {
    /// Starts all of it over DDS, after `before` has set the network up; `None` where no namespaces can be made.
    fn start(before: impl FnOnce(&Network)) -> Option<Self> {
        let network = Network::with_sides(2)?;
        before(&network);
        Some(Self::started(network, None))
    }

    /// The same over Zenoh.
    #[cfg(feature = "zenoh")]
    fn start_over_zenoh(before: impl FnOnce(&Network)) -> Option<Self> {
        let network = Network::with_sides(2)?;
        before(&network);
        Some(Self::started(network, Some("tcp/10.77.0.2:7447")))
    }

    /// Starts the processes; over Zenoh if there is to be a router at an endpoint.
    fn started(network: Network, endpoint: Option<&str>) -> Self {
        let domain = Domain::for_processes(6);
        let scenario = scenario_path(SCENARIO);
        let of_scenario = ["--scenario", scenario.to_str().unwrap()];
        let second = network.side(1);
        let _router = endpoint.map(|it| Running::start_router(Some(second), &domain, it, &[]));
        let start = |side, program: &str, more: &[&str]| {
            let machine = network.side(side);
            let arguments = [&of_scenario[..], more].concat();
            match endpoint {
                None => Running::start_within(machine, program, &domain, &arguments),
                Some(it) => {
                    Running::start_over_zenoh_within(machine, &[it], program, &domain, &arguments)
                }
            }
        };
        let verifier = start(1, "verifier", &["--json", "--time-limit-s", "110"]);
        let agents = [(0, "1-5"), (1, "6-10")]
            .map(|(side, modules)| start(side, "module_agent", &["--modules", modules]));
        let _publisher = start(1, "target_publisher", &["--voters", "1-10"]);
        Self {
            agents,
            _publisher,
            verifier,
            _router,
            network,
            domain,
        }
    }

    /// Waits until a process of modules, the first or the second, logs this.
    fn await_log(&self, agent: usize, text: &str) {
        let logged = self.agents[agent].wait_for_log(0, text, PATIENCE);
        assert!(logged.is_some(), "no `{text}` in domain {}", &*self.domain);
    }

    fn assert_complete(self) {
        let verdict = self.verifier.finish(PATIENCE).last_json();
        assert_eq!(verdict["verdict"]["outcome"], "COMPLETE", "{verdict}");
    }
}

#[test]
fn a_machine_whose_network_comes_up_late_takes_part() {
    let Some(machines) = TwoMachines::start(|network| network.take_address(0)) else {
        return;
    };
    machines.await_log(0, "joined the ROS 2 graph");
    machines.await_log(1, "joined the ROS 2 graph");
    machines.network.give_address(0, 1);
    machines.await_log(0, &format!("{REJOINS}10.77.0.1 on eth0"));
    machines.assert_complete();
}

#[test]
fn a_machine_whose_address_changes_on_the_way_takes_part_again_with_what_it_knows() {
    let Some(machines) = TwoMachines::start(|_| ()) else {
        return;
    };
    machines.await_log(0, "moving to");
    machines.network.take_address(0);
    machines.network.give_address(0, 7);
    machines.await_log(0, "the address 10.77.0.1 on eth0 of this machine is gone");
    machines.await_log(0, &format!("{REJOINS}10.77.0.7 on eth0"));
    machines.assert_complete();
}

#[test]
#[ignore = "takes half a minute; tests/soak_networks.sh runs it"]
fn a_second_interface_that_appears_on_the_way_is_used_as_well() {
    let Some(machines) = TwoMachines::start(|_| ()) else {
        return;
    };
    machines.await_log(0, "moving to");
    machines.network.give_interface(0, 1);
    machines.await_log(0, &format!("{REJOINS}10.78.0.1 on eth1"));
    machines.assert_complete();
}

#[test]
#[ignore = "takes half a minute; tests/soak_networks.sh runs it"]
fn all_halt_while_a_link_is_down_and_go_on_when_it_is_back() {
    let Some(machines) = TwoMachines::start(|_| ()) else {
        return;
    };
    machines.await_log(0, "moving to");
    machines.network.set_link(0, false);
    for agent in [0, 1] {
        machines.await_log(agent, "halted: agreement of modules");
    }
    machines.await_log(1, "waiting for a quorum");
    machines.network.set_link(0, true);
    machines.assert_complete();
}

/// Longer than the DDS participants remember each other.
#[test]
#[ignore = "takes two minutes; tests/soak_networks.sh runs it"]
fn a_link_may_be_down_for_longer_than_dds_remembers_participants() {
    let Some(machines) = TwoMachines::start(|_| ()) else {
        return;
    };
    machines.await_log(0, "moving to");
    machines.network.set_link(0, false);
    std::thread::sleep(Duration::from_secs(60));
    machines.network.set_link(0, true);
    // Those who see it first join again, and the others see new participants.
    let is_logged = |agent: &Running, limit| {
        agent
            .wait_for_log(0, "is back that was lost", limit)
            .is_some()
    };
    let [first, second] = &machines.agents;
    assert!(is_logged(first, Duration::from_secs(30)) || is_logged(second, Duration::ZERO));
    machines.assert_complete();
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

/// The log line of a process over Zenoh whose connection is gone.
#[cfg(feature = "zenoh")]
const LOSES_ROUTER: &str = "lost the connection to the router";
/// The log line of a process over Zenoh that has a connection again.
#[cfg(feature = "zenoh")]
const FINDS_ROUTER: &str = "connected to a router again";

#[cfg(feature = "zenoh")]
#[test]
fn a_machine_whose_network_comes_up_late_takes_part_over_zenoh() {
    let Some(machines) = TwoMachines::start_over_zenoh(|network| network.take_address(0)) else {
        return;
    };
    machines.await_log(0, "waiting for a Zenoh router");
    machines.await_log(1, "joined the ROS 2 graph");
    machines.network.give_address(0, 1);
    machines.await_log(0, "joined the ROS 2 graph");
    machines.assert_complete();
}

#[cfg(feature = "zenoh")]
#[test]
fn a_machine_whose_address_changes_on_the_way_takes_part_again_over_zenoh() {
    let Some(machines) = TwoMachines::start_over_zenoh(|_| ()) else {
        return;
    };
    machines.await_log(0, "moving to");
    machines.network.take_address(0);
    machines.network.give_address(0, 7);
    machines.await_log(0, LOSES_ROUTER);
    machines.await_log(0, FINDS_ROUTER);
    machines.assert_complete();
}

#[cfg(feature = "zenoh")]
#[test]
fn a_second_interface_that_appears_on_the_way_changes_nothing_over_zenoh() {
    let Some(machines) = TwoMachines::start_over_zenoh(|_| ()) else {
        return;
    };
    machines.await_log(0, "moving to");
    machines.network.give_interface(0, 1);
    machines.assert_complete();
}

/// A minute is longer than the lease of a Zenoh session.
#[cfg(feature = "zenoh")]
#[test]
fn all_halt_while_a_link_is_down_for_a_minute_and_go_on_over_zenoh() {
    let Some(machines) = TwoMachines::start_over_zenoh(|_| ()) else {
        return;
    };
    machines.await_log(0, "moving to");
    machines.network.set_link(0, false);
    for agent in [0, 1] {
        machines.await_log(agent, "halted: agreement of modules");
    }
    machines.await_log(0, LOSES_ROUTER);
    std::thread::sleep(Duration::from_secs(50));
    machines.network.set_link(0, true);
    machines.await_log(0, FINDS_ROUTER);
    machines.assert_complete();
}
