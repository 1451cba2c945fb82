//! The services of the suite, called by CycloneDDS, another vendor's DDS.

#![allow(
    clippy::unwrap_used,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::time::{Duration, Instant};

use formation_tests::{Peer, RosTool, Running, alone, scenario_path};
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

/// Asks again and again until the formation has come to this stage of `Progress.msg`.
fn wait_for_stage(tool: &mut RosTool, stage: u8) -> Value {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let status = query_status(tool);
        if status["progress"]["stage"] == stage {
            return status;
        }
        assert!(Instant::now() < deadline, "still at {status}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn status_is_told_and_a_withdrawn_target_stays_withdrawn() {
    let _alone = alone();
    let domain = "100";
    let node = "/formation/target_publisher";
    let Some(mut tool) = RosTool::start(&["call", node, "--domain", domain]) else {
        return;
    };
    let named = ["--expected-modules", "10", "--revision", "7"];
    let publisher = start("target_publisher", domain, "singletons_10", &named);
    let hosted = ["--modules", "1-10", "--speed", "50"];
    let agents = start("module_agent", domain, "singletons_10", &hosted);
    let done = wait_for_stage(&mut tool, 6);
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

    // A process that was stopped joins the graph anew, and must not bring back what was withdrawn.
    publisher
        .wait_for_log(0, "withdrew the target", PATIENCE)
        .unwrap();
    let mark = publisher.logged();
    publisher.signal("STOP");
    publisher.signal("CONT");
    let anew = publisher.wait_for_log(mark, "joining anew", PATIENCE);
    assert!(anew.is_some(), "it did not notice that it went deaf");
    let again = publisher.wait_for_log(mark, "withdrew the target", PATIENCE);
    assert!(again.is_some(), "it announces what it announced last");
    let peer = Peer::start("take", "target", domain).unwrap();
    assert_eq!(peer.taken()["withdrawn"], true);
    let told = agents.stop().stderr;
    let stood = told.matches("the target was withdrawn").count();
    assert_eq!(stood, 10, "{told}");
    let publisher = publisher.stop();
    assert_eq!(publisher.status, 0);
    let announced = publisher.stderr.matches("announced the target").count();
    assert_eq!(announced, 1, "{}", publisher.stderr);
}
