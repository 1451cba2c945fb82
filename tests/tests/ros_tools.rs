//! What users of ROS 2 do by habit, done to our processes by CycloneDDS, another vendor's DDS.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use formation_tests::{Domain, RosTool, Running, Signal, scenario_path};
use serde_json::{Value, json};

fn module(domain: &str, ros: &[&str]) -> Running {
    let own = [
        "--module",
        "4",
        "--x",
        "1",
        "--y",
        "2",
        "--service-mapping",
        "cyclone",
    ];
    let arguments = [&own, ["--ros-args"].as_slice(), ros].concat();
    let module = Running::start("module_agent", domain, &arguments);
    let joined = module.wait_for_log(0, "joined the ROS 2 graph", Duration::from_secs(20));
    assert!(joined.is_some(), "it logged: {:?}", module.log_since(0));
    module
}

#[test]
fn tools_see_the_names_types_and_owners_of_all_endpoints() {
    let domain = &*Domain::for_processes(4);
    let remaps = [
        "-r",
        "__ns:=/fleet",
        "-r",
        "__node:=scout",
        "-r",
        "claims:=/decisions",
        "-r",
        "rostopic://heartbeats:=beats",
        "-r",
        "rosservice://~/get_parameters:=~/parameters",
    ];
    let module = module(domain, &remaps);
    let Some(mut tool) = RosTool::start(&["graph", "/fleet/scout", "--domain", domain]) else {
        return;
    };
    let graph = tool.next_line();
    assert_eq!(
        graph["ownerless"],
        json!([]),
        "every endpoint belongs to the node"
    );
    let endpoints = graph["endpoints"].as_array().unwrap();
    let found: BTreeMap<(&str, &str), &Value> = endpoints
        .iter()
        .map(|endpoint| {
            let text = |key: &str| endpoint[key].as_str().unwrap();
            ((text("kind"), text("topic")), endpoint)
        })
        .collect();
    let quality = |endpoint: &Value| {
        (
            endpoint["reliable"].as_bool().unwrap(),
            endpoint["transient_local"].as_bool().unwrap(),
        )
    };
    let latched = (true, true);
    for (topic, kinds, base, expected) in [
        (
            "target",
            "s",
            "formation_msgs::msg::dds_::TargetConfiguration_",
            latched,
        ),
        (
            "module_states",
            "sp",
            "formation_msgs::msg::dds_::ModuleStates_",
            latched,
        ),
        ("roster", "s", "formation_msgs::msg::dds_::Roster_", latched),
        (
            "/decisions",
            "sp",
            "formation_msgs::msg::dds_::SpotClaim_",
            latched,
        ),
        (
            "beats",
            "sp",
            "formation_msgs::msg::dds_::Heartbeat_",
            (false, false),
        ),
        ("/rosout", "p", "rcl_interfaces::msg::dds_::Log_", latched),
        (
            "/diagnostics",
            "p",
            "diagnostic_msgs::msg::dds_::DiagnosticArray_",
            (true, false),
        ),
        (
            "/parameter_events",
            "p",
            "rcl_interfaces::msg::dds_::ParameterEvent_",
            latched,
        ),
    ] {
        let name = match topic.strip_prefix('/') {
            Some(absolute) => format!("rt/{absolute}"),
            None => format!("rt/fleet/{topic}"),
        };
        for (letter, kind) in [('s', "subscription"), ('p', "publisher")] {
            let endpoint = found.get(&(kind, name.as_str()));
            assert_eq!(
                endpoint.is_some(),
                kinds.contains(letter),
                "{kind} of {name} in {found:#?}"
            );
            if let Some(endpoint) = endpoint {
                assert_eq!(endpoint["type"], base, "{name}");
                assert_eq!(quality(endpoint), expected, "{name}");
            }
        }
    }
    let services: BTreeSet<&str> = found
        .keys()
        .filter_map(|(_, topic)| {
            topic
                .strip_prefix("rq/fleet/scout/")?
                .strip_suffix("Request")
        })
        .collect();
    let expected = [
        "add_module",
        "describe_parameters",
        "get_parameter_types",
        "list_parameters",
        "parameters",
        "remove_module",
        "retire_module",
        "set_parameters",
        "set_parameters_atomically",
    ];
    assert_eq!(services, expected.into());
    for service in services {
        let reply = format!("rr/fleet/scout/{service}Reply");
        let endpoint = found[&("publisher", reply.as_str())];
        assert_eq!(quality(endpoint), (true, false), "{reply}");
        let name = endpoint["type"].as_str().unwrap();
        let package = if service.ends_with("_module") {
            "formation_msgs"
        } else {
            "rcl_interfaces"
        };
        assert!(
            name.starts_with(&format!("{package}::srv::dds_::")) && name.ends_with("_Response_"),
            "{name}"
        );
    }
    assert_eq!(module.stop().status, 0);
}

#[test]
fn parameters_are_listed_described_read_and_changed() {
    let domain = &*Domain::for_processes(4);
    let node = "/formation/module_4";
    let module = module(domain, &["-p", "speed:=2", "-p", "module_4:gather_s:=1.5"]);
    let Some(mut events) = RosTool::start(&[
        "echo",
        "/parameter_events",
        "rcl_interfaces/msg/ParameterEvent",
        "--domain",
        domain,
        "--count",
        "1000",
        "--latched",
    ]) else {
        return;
    };
    let mut tool = RosTool::start(&["call", node, "--domain", domain]).unwrap();
    let listed = tool.call(
        "list_parameters",
        "rcl_interfaces/srv/ListParameters",
        &json!({}),
    );
    let names: BTreeSet<&str> = listed["result"]["names"]
        .as_array()
        .unwrap()
        .iter()
        .map(|name| name.as_str().unwrap())
        .collect();
    for name in [
        "speed",
        "lease_s",
        "plan_only",
        "session",
        "start_parameter_services",
        "use_sim_time",
    ] {
        assert!(names.contains(name), "{name} in {names:?}");
    }
    let asked = json!({"names": ["speed", "gather_s", "nothing"]});
    let read = tool.call("get_parameters", "rcl_interfaces/srv/GetParameters", &asked);
    assert_eq!(read["values"][0]["double_value"], 2.0);
    assert_eq!(read["values"][1]["double_value"], 1.5);
    let types = tool.call(
        "get_parameter_types",
        "rcl_interfaces/srv/GetParameterTypes",
        &asked,
    );
    assert_eq!(types, json!({"types": [3, 3, 0]}));
    let described = tool.call(
        "describe_parameters",
        "rcl_interfaces/srv/DescribeParameters",
        &json!({"names": ["lease_s", "speed"]}),
    );
    let (lease, speed) = (&described["descriptors"][0], &described["descriptors"][1]);
    assert_eq!(
        (&lease["read_only"], &speed["read_only"]),
        (&json!(true), &json!(false))
    );
    assert_eq!(speed["floating_point_range"][0]["from_value"], 0.001);
    assert!(
        speed["description"]
            .as_str()
            .unwrap()
            .contains("units per second")
    );

    let double =
        |name: &str, value: f64| json!({"name": name, "value": {"type": 3, "double_value": value}});
    let request = json!({"parameters": [double("speed", 3.5), double("lease_s", 3.0), double("speed", -1.0)]});
    let set = tool.call(
        "set_parameters",
        "rcl_interfaces/srv/SetParameters",
        &request,
    );
    let results = set["results"].as_array().unwrap();
    let outcomes: Vec<bool> = results
        .iter()
        .map(|result| result["successful"].as_bool().unwrap())
        .collect();
    assert_eq!(outcomes, [true, false, false]);
    assert!(
        results[1]["reason"]
            .as_str()
            .unwrap()
            .contains("restart all processes"),
        "{set}"
    );
    assert!(
        results[2]["reason"]
            .as_str()
            .unwrap()
            .contains("must be from 0.001"),
        "{set}"
    );
    // Each is fine by itself, but together they are not, so neither holds.
    let request = json!({"parameters": [double("gather_s", 20.0), double("gather_limit_s", 10.0)]});
    let set = tool.call(
        "set_parameters_atomically",
        "rcl_interfaces/srv/SetParametersAtomically",
        &request,
    );
    assert_eq!(set["result"]["successful"], false, "{set}");
    let request = json!({"parameters": [double("gather_limit_s", 40.0)]});
    let set = tool.call(
        "set_parameters_atomically",
        "rcl_interfaces/srv/SetParametersAtomically",
        &request,
    );
    assert_eq!(set["result"], json!({"successful": true, "reason": ""}));
    let asked = json!({"names": ["speed", "gather_s", "gather_limit_s"]});
    let read = tool.call("get_parameters", "rcl_interfaces/srv/GetParameters", &asked);
    let values: Vec<f64> = read["values"]
        .as_array()
        .unwrap()
        .iter()
        .map(|value| value["double_value"].as_f64().unwrap())
        .collect();
    assert_eq!(values, [3.5, 1.5, 40.0]);
    tool.finish();

    // Changes are published, refused changes are not.
    let mut next_change = || {
        loop {
            let event = events.next_line();
            if event["changed_parameters"] != json!([]) {
                return event;
            }
        }
    };
    for (name, value) in [("speed", 3.5), ("gather_limit_s", 40.0)] {
        let event = next_change();
        assert_eq!(event["node"], node);
        assert_eq!(event["changed_parameters"][0]["name"], name);
        assert_eq!(
            event["changed_parameters"][0]["value"]["double_value"],
            value
        );
    }
    let finished = module.stop();
    assert!(
        finished.stderr.contains("parameter speed is now 3.5"),
        "{}",
        finished.stderr
    );
}

#[test]
fn the_description_of_every_number_has_its_unit() {
    const DOUBLE: u64 = 3;
    let domain = &*Domain::for_processes(4);
    let Some(mut tool) = RosTool::start(&["call", "/formation", "--domain", domain]) else {
        return;
    };
    let _module = module(domain, &[]);
    let cyclone = ["--service-mapping", "cyclone"];
    let _others = ["target_publisher", "verifier", "visualiser"]
        .map(|program| Running::start(program, domain, &cyclone));
    for node in ["module_4", "target_publisher", "verifier", "visualiser"] {
        let mut ask = |service: &str, type_name: &str, request: &Value| {
            let type_name = format!("rcl_interfaces/srv/{type_name}");
            tool.call(&format!("{node}/{service}"), &type_name, request)
        };
        let listed = ask("list_parameters", "ListParameters", &json!({}));
        let names = json!({"names": listed["result"]["names"]});
        let described = ask("describe_parameters", "DescribeParameters", &names);
        let descriptors = described["descriptors"].as_array().unwrap().iter();
        let numbers: Vec<&Value> = descriptors
            .filter(|descriptor| descriptor["type"] == DOUBLE)
            .collect();
        assert!(!numbers.is_empty(), "{described}");
        for number in numbers {
            let description = number["description"].as_str().unwrap();
            let units = [
                "in seconds",
                "in milliseconds",
                "in metres",
                "in units",
                "in radians",
                "per second",
            ];
            let has_unit = units.iter().any(|unit| description.contains(unit));
            assert!(has_unit, "{node}: {number}");
        }
    }
    tool.finish();
}

#[test]
fn a_node_without_parameter_services_has_none_of_them() {
    let domain = &*Domain::for_processes(4);
    let quiet = [
        "-p",
        "start_parameter_services:=false",
        "-p",
        "diagnostics_period_s:=0.0",
        "--disable-rosout-logs",
    ];
    let module = module(domain, &quiet);
    let Some(mut tool) = RosTool::start(&["graph", "/formation/module_4", "--domain", domain])
    else {
        return;
    };
    let graph = tool.next_line();
    let topics: BTreeSet<&str> = graph["endpoints"]
        .as_array()
        .unwrap()
        .iter()
        .map(|endpoint| endpoint["topic"].as_str().unwrap())
        .collect();
    assert!(
        topics
            .iter()
            .all(|topic| !topic.starts_with("rq/") && !topic.starts_with("rr/")),
        "{topics:?}"
    );
    assert!(
        !topics.contains("rt/rosout") && !topics.contains("rt/diagnostics"),
        "{topics:?}"
    );
    assert_eq!(module.stop().status, 0);
}

#[test]
fn a_formation_reports_its_state_on_rosout_and_diagnostics() {
    let domain = &*Domain::for_processes(4);
    let scenario = scenario_path("singletons_10");
    let scenario = scenario.to_str().unwrap();
    let Some(mut diagnostics) = RosTool::start(&[
        "echo",
        "/diagnostics",
        "diagnostic_msgs/msg/DiagnosticArray",
        "--domain",
        domain,
        "--count",
        "1000",
    ]) else {
        return;
    };
    let mut log = RosTool::start(&[
        "echo",
        "/rosout",
        "rcl_interfaces/msg/Log",
        "--domain",
        domain,
        "--count",
        "1000",
        "--latched",
    ])
    .unwrap();
    let all = ["--modules", "1-10", "--speed", "20", "--scenario", scenario];
    let ros = [
        "--ros-args",
        "-p",
        "diagnostics_period_s:=0.2",
        "--log-level",
        "rustdds:=error",
    ];
    let modules = Running::start("module_agent", domain, &[all.as_slice(), &ros].concat());
    let verifier = Running::start("verifier", domain, &["--scenario", scenario]);
    let publisher = Running::start(
        "target_publisher",
        domain,
        &["--expected-modules", "10", "--scenario", scenario],
    );
    assert_eq!(verifier.finish(Duration::from_secs(60)).status, 0);

    let node = "/formation/modules_1_to_10";
    // Every part of the node, once all modules have settled.
    let statuses = loop {
        let sample = diagnostics.next_line();
        let statuses: BTreeMap<String, Value> = sample["status"]
            .as_array()
            .unwrap()
            .iter()
            .map(|status| (status["name"].as_str().unwrap().to_owned(), status.clone()))
            .collect();
        let settled = statuses
            .values()
            .filter(|status| status["message"] == "SETTLED");
        if settled.count() == 10 {
            break statuses;
        }
    };
    let values = |part: &str| -> BTreeMap<String, String> {
        let status = &statuses[&format!("{node}: {part}")];
        let pair = |pair: &Value| {
            let text = |key: &str| pair[key].as_str().unwrap().to_owned();
            (text("key"), text("value"))
        };
        status["values"]
            .as_array()
            .unwrap()
            .iter()
            .map(pair)
            .collect()
    };
    let module = values("module 3");
    assert_eq!(module["phase"], "SETTLED");
    assert_eq!(module["turn"], "10");
    assert!(module["epoch"].starts_with("epoch "), "{module:?}");
    for key in ["messages_sent", "messages_received"] {
        assert!(
            module[key].parse::<u64>().unwrap() > 10,
            "{key}: {module:?}"
        );
    }
    for key in ["evictions", "evicted", "time_in_phase_s", "spot"] {
        assert!(module.contains_key(key), "{key}: {module:?}");
    }
    let statistics = values("topic statistics");
    assert!(
        statistics["claims.sent"].parse::<u64>().unwrap() >= 10,
        "{statistics:?}"
    );

    let line = std::iter::from_fn(|| Some(log.next_line()))
        .find(|line| line["msg"].as_str().unwrap().starts_with("settled on"))
        .unwrap();
    assert_eq!(
        (&line["level"], &line["name"]),
        (&json!(20), &json!("formation.modules_1_to_10"))
    );
    let publisher = publisher.stop();
    assert_eq!(publisher.status, 0);
    // RustDDS delivers each sample of a writer once, so the module counts one announcement of each writer: one, unless the
    // publisher had to rejoin the graph with a new writer.
    let announced = publisher.stderr.matches("announced the target").count();
    let received: usize = statistics["target.received"].parse().unwrap();
    assert!((1..=announced).contains(&received), "{statistics:?}");
    assert_eq!(modules.stop().status, 0);
}

#[test]
fn a_node_leaves_the_graph_at_once_on_a_signal_to_end() {
    for signal in [Signal::INT, Signal::TERM] {
        let domain = &*Domain::for_processes(4);
        let module = module(domain, &[]);
        // A node that just stops is listed for about 47 s.
        let Some(mut tool) = RosTool::start(&[
            "gone",
            "/formation/module_4",
            "--domain",
            domain,
            "--timeout",
            "15",
        ]) else {
            return;
        };
        assert!(tool.next_line()["seen"].as_u64().unwrap() > 20);
        module.signal(signal);
        tool.next_line();
        assert_eq!(
            module.finish(Duration::from_secs(20)).status,
            0,
            "{signal:?}"
        );
        tool.finish();
    }
}

#[test]
fn unknown_arguments_are_refused_with_what_may_have_been_meant() {
    let domain = &*Domain::for_processes(4);
    for (arguments, error) in [
        (
            ["--ros-args", "--remp", "a:=b"].as_slice(),
            "did you mean `--remap`?",
        ),
        (&["--ros-args", "-p", "sped:=2"], "did you mean `speed`?"),
        (
            &["--ros-args", "-p", "speed:=0"],
            "must be from 0.001 to 1000000",
        ),
        (
            &["--ros-args", "-p", "lease_s:=6.0"],
            "`suspicion_s`: must be greater than lease_s",
        ),
        (
            &["--ros-args", "-r", "claims:=two words"],
            "must consist of letters",
        ),
        (&["claims:=decisions"], "must stand behind `--ros-args -r`"),
        (&["--sped", "2"], "'--speed'"),
    ] {
        let own = ["--module", "4", "--x", "1", "--y", "2"];
        let module = Running::start("module_agent", domain, &[&own, arguments].concat());
        let finished = module.finish(Duration::from_secs(20));
        assert_eq!(finished.status, 2, "{arguments:?}: {}", finished.stderr);
        assert!(
            finished.stderr.contains(error),
            "{arguments:?}: {}",
            finished.stderr
        );
    }
}
