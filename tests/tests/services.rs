//! The services of the suite, called by CycloneDDS, another vendor's DDS.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::time::{Duration, Instant};

use formation_tests::{Domain, Peer, RosTool, Running, scenario_path};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(60);

/// A program that speaks to nodes on CycloneDDS, with a scenario.
fn start(program: &str, domain: &str, scenario: &str, arguments: &[&str]) -> Running {
    let scenario = scenario_path(scenario);
    let common = [
        "--scenario",
        scenario.to_str().unwrap(),
        "--service-mapping",
        "cyclone",
    ];
    Running::start(program, domain, &[&common, arguments].concat())
}

fn query_status(tool: &mut RosTool) -> Value {
    tool.call(
        "/formation/query_status",
        "formation_msgs/srv/QueryStatus",
        &json!({"include_waiting": true}),
    )
}

/// Queries the status until the formation is done with `settled` modules on their spots.
fn wait_until_done(tool: &mut RosTool, settled: u32) -> Value {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let status = query_status(tool);
        let progress = &status["progress"];
        if progress["stage"] == 6 && progress["settled"] == settled {
            return status;
        }
        assert!(Instant::now() < deadline, "still at {status}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Shows E8.
#[test]
fn status_is_reported_and_a_withdrawn_target_stays_withdrawn() {
    let domain = &*Domain::for_processes(4);
    let node = "/formation/target_publisher";
    let Some(mut tool) = RosTool::start(&["call", node, "--domain", domain]) else {
        return;
    };
    let named = ["--expected-modules", "10", "--revision", "7"];
    let publisher = start("target_publisher", domain, "singletons_10", &named);
    let hosted = ["--modules", "1-10", "--speed", "50"];
    let agents = start("module_agent", domain, "singletons_10", &hosted);
    let done = wait_until_done(&mut tool, 10);
    assert_eq!(done["target"], "singletons-10");
    assert_eq!(done["revision"], 7);
    let progress = &done["progress"];
    for count in [
        "expected", "joined", "planned", "agreed", "settled", "to_fill",
    ] {
        assert_eq!(progress[count], 10, "{count}: {done}");
    }
    assert_eq!(progress["waiting_for"], json!([]));
    assert_eq!(progress["epoch"]["number"], 1);

    let mut withdraw = |revision: u64| {
        tool.call(
            "/formation/withdraw_target",
            "formation_msgs/srv/WithdrawTarget",
            &json!({"revision": revision}),
        )
    };
    let other = json!({"success": false, "message": "revision 7 holds, not 8"});
    assert_eq!(withdraw(8), other);
    let done = json!({"success": true, "message": "withdrew `singletons-10`"});
    assert_eq!(withdraw(7), done);
    assert_eq!(withdraw(0)["success"], false, "there is none any more");
    assert_eq!(query_status(&mut tool)["progress"]["stage"], 1);
    tool.finish();

    // A process that was stopped rejoins the graph, and must not announce the withdrawn target again.
    publisher
        .wait_for_log(0, "withdrew the target", PATIENCE)
        .unwrap();
    let mark = publisher.logged();
    publisher.rejoin(PATIENCE);
    let again = publisher.wait_for_log(mark, "withdrew the target", PATIENCE);
    assert!(again.is_some(), "it announces what it announced last");
    let peer = Peer::start("take", "target", domain).unwrap();
    assert_eq!(peer.taken()["withdrawn"], true);
    let stderr = agents.stop().stderr;
    let stood = stderr.matches("the target was withdrawn").count();
    assert_eq!(stood, 10, "{stderr}");
    let publisher = publisher.stop();
    assert_eq!(publisher.status, 0);
    let announced = publisher.stderr.matches("announced the target").count();
    assert_eq!(announced, 1, "{}", publisher.stderr);
}

/// Shows C5.
#[test]
fn retired_and_added_modules_stay_so_when_their_process_rejoins() {
    let domain = &*Domain::for_processes(4);
    let node = "/formation/modules_1_to_10";
    let Some(mut tool) = RosTool::start(&["call", node, "--domain", domain]) else {
        return;
    };
    let _publisher = start("target_publisher", domain, "singletons_10", &[]);
    let quick =
        "--suspicion-s 2.5 --lease-s 1.25 --heartbeat-s 0.25 --gather-s 1 --epoch-interval-s 0.5";
    let hosted = ["--modules", "1-10", "--speed", "50"];
    let quick: Vec<&str> = hosted.into_iter().chain(quick.split(' ')).collect();
    let agents = start("module_agent", domain, "singletons_10", &quick);
    wait_until_done(&mut tool, 10);

    let retire = |tool: &mut RosTool, module: u32, rejoin: bool| {
        let request = json!({"module_id": module, "rejoin": rejoin});
        tool.call("retire_module", "formation_msgs/srv/RetireModule", &request)
    };
    let elsewhere = retire(&mut tool, 77, false);
    let reason =
        "module 77 is not hosted by this process, which hosts 1, 2, 3, 4, 5, 6, 7, 8, 9, 10";
    assert_eq!(elsewhere, json!({"success": false, "message": reason}));
    let leaving = retire(&mut tool, 3, false);
    assert_eq!(leaving["success"], true);
    let message = leaving["message"].as_str().unwrap();
    assert!(message.contains("a spare takes its spot"), "{message}");
    wait_until_done(&mut tool, 9);

    let add = |tool: &mut RosTool, module: u32, x: f64| {
        let request = json!({"module_id": module, "x": x, "y": -5.0});
        tool.call("add_module", "formation_msgs/srv/AddModule", &request)
    };
    let known = add(&mut tool, 3, 0.0);
    assert_eq!(known["success"], false);
    assert_eq!(add(&mut tool, 11, 0.0)["success"], true);
    let full = wait_until_done(&mut tool, 10);
    assert_eq!(full["progress"]["joined"], 11);

    // When the DDS library has lost its threads, the process rejoins with the modules as they are.
    let states = Peer::start("take", "module_states", domain).unwrap();
    let before = state_of(&states.taken(), 3).unwrap()["incarnation"].as_u64();
    agents.rejoin(PATIENCE);
    let settled = 7;
    loop {
        let sample = states.taken();
        // A process that begins has not every module's state at once.
        let (Some(retired), Some(added)) = (state_of(&sample, 3), state_of(&sample, 11)) else {
            continue;
        };
        assert_eq!(retired["service"], 2, "{retired}");
        assert_eq!(added["service"], 1, "{added}");
        if retired["incarnation"].as_u64() > before && added["phase"] == settled {
            assert_ne!(retired["phase"], settled);
            break;
        }
    }
    assert_eq!(retire(&mut tool, 3, true)["success"], true);
    tool.finish();
    assert_eq!(agents.stop().status, 0);
}

/// One module's state in a sample of `module_states`.
fn state_of(sample: &Value, module: u32) -> Option<Value> {
    let mut states = sample["modules"].as_array()?.iter();
    states.find(|state| state["module_id"] == module).cloned()
}

/// The node of a process is named after one of its modules.
#[test]
fn retire_asks_the_processes_until_one_hosts_the_module() {
    let domain = &*Domain::for_processes(4);
    let scenario = scenario_path("singletons_10");
    let scenario = scenario.to_str().unwrap();
    let agents: Vec<Running> = ["1-2", "3-4"]
        .iter()
        .map(|hosted| {
            let arguments = ["--scenario", scenario, "--modules", hosted];
            Running::start("module_agent", domain, &arguments)
        })
        .collect();
    let ask = |arguments: &[&str]| {
        let command = [&["retire"], arguments].concat();
        Running::start("formation", domain, &command).finish(PATIENCE)
    };
    for (arguments, said) in [
        (&["4"][..], "module 4 stands still and leaves the formation"),
        (&["4"], "module 4 is retired already"),
        (&["4", "--rejoin"], "module 4 takes part again"),
    ] {
        let answer = ask(arguments);
        assert_eq!(answer.status, 0, "{}", answer.stderr);
        assert!(answer.stderr.contains(said), "{}", answer.stderr);
    }
    let answer = ask(&["9"]);
    assert_eq!(answer.status, 1);
    let hosts = [
        "module 9 is not hosted by this process, which hosts 1, 2",
        "hosts 3, 4",
    ];
    assert!(
        hosts.iter().all(|host| answer.stderr.contains(host)),
        "{}",
        answer.stderr
    );
    for agent in agents {
        assert_eq!(agent.stop().status, 0);
    }
}
