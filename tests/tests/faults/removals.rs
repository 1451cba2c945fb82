//! Reports that bodies were taken away, of strangers and of clients.

use std::collections::BTreeMap;
use std::thread;
use std::time::Instant;

use formation_tests::{Domain, Fleet, FleetTiming, Peer, RosTool, Running, ScenarioFile};
use serde_json::{Value, json};

use super::PATIENCE;

/// A row of three spots, and four modules.
const ROW: &str = "
name: row
target:
  spots: [{id: 1, x: 4, y: 5}, {id: 2, x: 5, y: 5}, {id: 3, x: 6, y: 5}]
  edges: [[1, 2], [2, 3]]
singletons:
  - {id: 1, x: 4, y: 2}
  - {id: 2, x: 6, y: 2}
  - {id: 3, x: 12, y: 12}
  - {id: 4, x: 5, y: 4}
";

/// The incarnations of these modules, by their heartbeats.
fn incarnations(peer: &Peer, modules: u32) -> BTreeMap<u32, u64> {
    let mut known = BTreeMap::new();
    while (1..=modules).any(|module| !known.contains_key(&module)) {
        let sample = peer.taken();
        for heartbeat in sample["modules"].as_array().unwrap() {
            let module = heartbeat["module_id"].as_u64().unwrap();
            let incarnation = heartbeat["incarnation"].as_u64().unwrap();
            known.insert(u32::try_from(module).unwrap(), incarnation);
        }
    }
    known
}

fn removals(runs: impl IntoIterator<Item = (u32, u64)>) -> Value {
    let runs = runs.into_iter();
    let removals: Vec<Value> = runs
        .map(|(module, incarnation)| json!({"module_id": module, "incarnation": incarnation}))
        .collect();
    json!({"removals": removals})
}

/// CycloneDDS reports a settled module as removed that lives, and all modules there may be, blindly.
/// Shows B5.
#[test]
fn a_sample_of_a_stranger_removes_no_living_module() {
    let domain = &*Domain::for_processes(6);
    let Some(mut stranger) = Peer::start("put", "commands", domain) else {
        return;
    };
    let heartbeats = Peer::start("take", "heartbeats", domain).unwrap();
    let mut fleet = Fleet::new("row", ROW, domain, FleetTiming::Quick);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    fleet.start_all();
    let whole = fleet.wait_until_whole(&judge, Instant::now(), PATIENCE);
    let runs = incarnations(&heartbeats, 4);
    let (&named, &spot) = whole.assignments.iter().next_back().unwrap();
    stranger.await_ready();

    let marks = fleet.marks();
    let verdicts = judge.verdicts().len();
    stranger.put(&removals([(named, runs[&named])]));
    for other in fleet.living() {
        if other != named {
            let dropped =
                format!("the report that the body of module {named} was removed is dropped");
            let agent = fleet.agent(other);
            let found = agent.wait_for_log(marks[&other], &dropped, PATIENCE);
            assert!(found.is_some(), "module {other}:\n{}", fleet.story());
        }
    }
    stranger.put(&removals((1..=10_000).map(|module| (module, 0))));
    for other in fleet.living() {
        let agent = fleet.agent(other);
        let refused = agent.wait_for_log(marks[&other], "0 names no run", PATIENCE);
        assert!(refused.is_some(), "module {other}:\n{}", fleet.story());
    }
    stranger.put(&removals((1..=10_000).map(|module| (module, 1))));
    // Nothing happens for longer than it took to send a spare onto the spot.
    thread::sleep(FleetTiming::Quick.suspicion() * 4);
    for other in fleet.living() {
        let lines = fleet.agent(other).log_since(marks[&other]);
        let convened = lines.iter().find(|line| line.text.contains("convened"));
        assert!(convened.is_none(), "{}", fleet.story());
    }
    assert_eq!(judge.verdicts().len(), verdicts);

    let died = fleet.kill(named);
    let living = fleet.living();
    let partial = judge.wait_until(died, PATIENCE, |judged| {
        judged.outcome == "PARTIAL" && judged.modules() == living
    });
    let partial = partial.unwrap_or_else(|last| panic!("{last:?}\n{}", fleet.story()));
    assert_eq!(partial.blocked, BTreeMap::from([(spot, named)]));
    let removed = Instant::now();
    stranger.put(&removals([(named, runs[&named])]));
    let whole = fleet.wait_until_whole(&judge, removed, PATIENCE);
    let spare = whole
        .assignments
        .iter()
        .find(|&(_, &filled)| filled == spot);
    assert_ne!(*spare.unwrap().0, named);
}

/// A program of a user, which serves nothing, announces the target.
/// Shows B5.
#[test]
fn the_process_of_any_member_takes_the_report_where_no_target_publisher_does() {
    let domain = &*Domain::for_processes(5);
    let node = "/formation/modules_1_to_3";
    let Some(mut tool) = RosTool::start(&["call", node, "--domain", domain]) else {
        return;
    };
    let mut announcer = Peer::start("put", "target", domain).unwrap();
    announcer.await_ready();
    announcer.put(&json!({
        "revision": 1, "name": "row", "expected_modules": 4, "header": {"frame_id": "map"},
        "spots": [{"id": 1, "x": 4.0, "y": 5.0}, {"id": 2, "x": 5.0, "y": 5.0}, {"id": 3, "x": 6.0, "y": 5.0}],
        "edges": [{"first": 1, "second": 2}, {"first": 2, "second": 3}],
        "planner": {"d_max": -1, "weight_loc": 1.0, "weight_dock": 0.1, "weight_undock": 0.05},
    }));
    let file = ScenarioFile::new("row-announced", ROW);
    let quick = "--suspicion-s 2.5 --lease-s 1.25 --heartbeat-s 0.25 --gather-s 1 --epoch-interval-s 0.5 --speed 5";
    let start = |modules: &str| {
        let own = ["--modules", modules, "--scenario", file.path()];
        let own = [&own[..], &["--service-mapping", "cyclone"]].concat();
        let quick: Vec<&str> = quick.split(' ').collect();
        Running::start("module_agent", domain, &[own, quick].concat())
    };
    let fleet = Fleet::new("row-judged", ROW, domain, FleetTiming::Quick);
    let judge = fleet.judge(None);
    let first = start("1-3");
    let mut second = start("4");
    let whole = judge.wait_until(Instant::now(), PATIENCE, |judged| judged.is_whole());
    let whole = whole.unwrap_or_else(|last| panic!("{last:?}"));
    let spot = whole.assignments[&4];
    let mut ask = |module: u32| {
        let request = json!({"module_id": module, "incarnation": 0});
        let answer = tool.call("remove_module", "formation_msgs/srv/RemoveModule", &request);
        let message = answer["message"].as_str().unwrap().to_owned();
        (answer["success"] == true, message)
    };
    for (module, reason) in [
        (4, "heartbeats of module 4 arrive"),
        (9, "no message of module 9 came"),
        (1, "module 1 lives in this process"),
    ] {
        let (success, message) = ask(module);
        assert!(!success && message.contains(reason), "{message}");
    }
    let died = Instant::now();
    second.kill();
    let partial = judge.wait_until(died, PATIENCE, |judged| {
        judged.outcome == "PARTIAL" && judged.blocked.get(&spot) == Some(&4)
    });
    partial.unwrap_or_else(|last| panic!("{last:?}"));
    let asked = Instant::now();
    let (success, message) = ask(4);
    assert!(success, "{message}");
    let due =
        "takes effect in the next roster after no member has heard it for suspicion_s (2.5 s)";
    assert!(message.contains(due), "{message}");
    let again = judge.wait_until(asked, PATIENCE, |judged| judged.is_whole());
    let again = again.unwrap_or_else(|last| panic!("{last:?}"));
    assert!(again.assignments.values().any(|&filled| filled == spot));
    tool.finish();
    drop(first);
}
