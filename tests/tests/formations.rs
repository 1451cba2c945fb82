//! Formations of real processes on real DDS, over loopback, each on a domain of its own.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a failure in a helper fails the test that calls it"
)]

use std::collections::BTreeSet;
use std::net::{Ipv4Addr, UdpSocket};
use std::path::Path;
use std::time::Duration;

use formation_model::Scenario;
use formation_tests::{
    Domain, EIGHT, Finished, Fleet, FleetTiming, Peer, Running, ScenarioFile, overlaps,
    room_for_many_processes, scenario_path,
};
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(120);

/// Runs the launcher on a shipped scenario.
fn launch(command: &str, scenario: &str, domain: &str, more: &[&str]) -> Finished {
    let path = scenario_path(scenario);
    let mut arguments = vec![command, path.to_str().unwrap(), "--json"];
    arguments.extend(more);
    Running::start("formation", domain, &arguments).finish(PATIENCE)
}

/// Asserts that the plan of the processes equals that of the offline planner; returns the run's report, or `None` where
/// the network does not let this many processes discover each other.
pub(crate) fn runs_as_planned(scenario: &str, outcome: &str, more: &[&str]) -> Option<Value> {
    room_for_many_processes()?;
    let text = std::fs::read_to_string(scenario_path(scenario)).unwrap();
    let modules = Scenario::from_yaml(&text)
        .unwrap()
        .problem()
        .modules()
        .len();
    let domain = &*Domain::for_processes(u32::try_from(modules).unwrap() + 2);
    let plan = launch("plan", scenario, domain, &[]);
    assert_eq!(plan.status, 0, "{}", plan.stderr);
    let plan = plan.json();
    let options = [&["--domain", domain, "--timeout", "90"], more].concat();
    let run = launch("run", scenario, domain, &options);
    assert_eq!(run.status, 0, "{scenario}: {}\n{}", run.stdout, run.stderr);
    let run = run.json();
    for key in [
        "assignments",
        "unassigned",
        "open_spots",
        "kept_links",
        "broken_links",
        "detached_modules",
        "port_changes",
        "evictions",
        "total_utility",
        "total_distance",
        "assembly_order",
    ] {
        assert!(!plan[key].is_null(), "{scenario}: plan lacks {key}");
        assert_eq!(run[key], plan[key], "{scenario}: {key}");
    }
    let verdict = run["verdict"]
        .as_str()
        .or(run["verdict"]["outcome"].as_str());
    assert_eq!(verdict, Some(outcome), "{scenario}: {run}");
    Some(run)
}

/// What other code finds in the trace of a run, and the verifier in its messages.
fn assert_free_of_collisions(run: &Value, trace: &Path, modules: usize) {
    assert_eq!(run["collision_free"], true, "{run}");
    let trace = std::fs::read_to_string(trace).unwrap();
    let traced: BTreeSet<u64> = trace
        .lines()
        .map(|line| {
            serde_json::from_str::<Value>(line).unwrap()["module"]
                .as_u64()
                .unwrap()
        })
        .collect();
    assert_eq!(traced.len(), modules);
    let mut overlaps = overlaps(&trace);
    overlaps.retain(|overlap| overlap.depth > 0.01);
    assert_eq!(overlaps, [], "{} lines", trace.lines().count());
}

/// Shows X8.
#[test]
fn figure_1_forms_with_seventeen_agent_processes_and_no_two_bodies_overlap() {
    let directory = tempfile::tempdir().unwrap();
    let trace = directory.path().join("trace.jsonl");
    let more = ["--trace", trace.to_str().unwrap()];
    let Some(run) = runs_as_planned("figure1_ladder17", "COMPLETE", &more) else {
        return;
    };
    assert_eq!(run["assignments"].as_array().unwrap().len(), 17);
    assert_free_of_collisions(&run, &trace, 17);
}

#[test]
fn fifty_modules_that_start_apart_form_and_no_two_bodies_overlap() {
    if room_for_many_processes().is_none() {
        return;
    }
    let domain = &*Domain::for_processes(14);
    let options = "generate --modules 50 --spots 50 --mixed --seed 5";
    let options: Vec<&str> = options.split(' ').collect();
    let generated = Running::start("formation", domain, &options).finish(PATIENCE);
    assert_eq!(generated.status, 0, "{}", generated.stderr);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("apart.yaml");
    std::fs::write(&path, &generated.stdout).unwrap();
    let path = path.to_str().unwrap();
    let plan = Running::start("formation", domain, &["plan", path, "--json"]).finish(PATIENCE);
    assert_eq!(plan.json()["motion"]["collision_free"], true);
    let trace = directory.path().join("trace.jsonl");
    let run = ["run", path, "--json", "--domain", domain, "--timeout", "90"];
    let more = [
        "--modules-per-process",
        "5",
        "--trace",
        trace.to_str().unwrap(),
    ];
    let run = Running::start("formation", domain, &[&run[..], &more].concat()).finish(PATIENCE);
    assert_eq!(run.status, 0, "{}\n{}", run.stdout, run.stderr);
    let run = run.json();
    assert_eq!(run["verdict"], "COMPLETE");
    assert_eq!(run["open_spots"].as_array().unwrap().len(), 0);
    assert_free_of_collisions(&run, &trace, 50);
}

#[test]
fn a_trace_that_lacks_states_is_an_error_of_the_verifier() {
    let one = "{target: {spots: [{id: 1, x: 5, y: 5}]}, singletons: [{id: 4, x: 1, y: 1}]}";
    let domain = &*Domain::for_processes(3);
    let mut fleet = Fleet::new("one", one, domain, FleetTiming::Quick);
    let limit = PATIENCE.as_secs().to_string();
    let options = ["--trace", "/dev/full", "--time-limit-s", &limit];
    let verifier = Running::start("verifier", domain, &options);
    let _announcer = fleet.announce(None);
    fleet.start_all();
    let ended = verifier.finish(PATIENCE);
    assert!(ended.stdout.starts_with("COMPLETE"), "{}", ended.stdout);
    assert_eq!(ended.status, 1);
    let reason = "--trace /dev/full: states are missing from it: ";
    assert!(ended.stderr.contains(reason), "{}", ended.stderr);
}

#[test]
fn ten_singletons_form() {
    runs_as_planned("singletons_10", "COMPLETE", &[]);
}

/// Obstacles and walls reach all processes with the target, so all plan the same paths through the door.
#[test]
fn two_rooms_are_crossed_along_paths() {
    let Some(run) = runs_as_planned("two_rooms", "COMPLETE", &[]) else {
        return;
    };
    assert_eq!(run["open_spots"], serde_json::json!([]), "{run}");
}

#[test]
fn spares_stand_by() {
    let Some(run) = runs_as_planned("oversupply", "COMPLETE", &[]) else {
        return;
    };
    assert!(!run["unassigned"].as_array().unwrap().is_empty());
}

#[test]
fn too_few_modules_fill_a_connected_part() {
    let Some(run) = runs_as_planned("undersupply", "PARTIAL", &[]) else {
        return;
    };
    assert!(!run["open_spots"].as_array().unwrap().is_empty());
}

#[test]
fn a_configuration_that_cannot_fit_whole_breaks() {
    let Some(run) = runs_as_planned("mcs_detach", "COMPLETE", &[]) else {
        return;
    };
    assert!(run["broken_links"].as_u64().unwrap() > 0);
}

/// Eight agents, each a process of its own; module 2 leads its configuration.
fn start_eight(file: &ScenarioFile, domain: &str) -> Vec<Running> {
    (1..=8)
        .map(|id: u32| {
            let program = if id == 2 {
                "leader_agent"
            } else {
                "module_agent"
            };
            let id = id.to_string();
            Running::start(
                program,
                domain,
                &["--module", &id, "--scenario", file.path(), "--speed", "10"],
            )
        })
        .collect()
}

/// The announcement of the eight's target, as the .msg file has it.
fn target_sample(revision: u64) -> Value {
    let scenario = Scenario::from_yaml(EIGHT).unwrap();
    let raw = scenario.problem().target().to_raw();
    let spots: Vec<Value> = raw
        .spots
        .iter()
        .map(|spot| json!({"id": spot.id, "x": spot.x, "y": spot.y, "theta": spot.theta}))
        .collect();
    let edges: Vec<Value> = raw
        .edges
        .iter()
        .map(|[first, second]| json!({"first": first, "second": second}))
        .collect();
    json!({
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "map"},
        "revision": revision,
        "name": "eight",
        "withdrawn": false,
        "expected_modules": 8,
        "spots": spots,
        "edges": edges,
        "planner": {
            "policy": "exact", "order": 0, "d_max": -1, "exact_finish": false, "weight_loc": 1.0,
            "weight_dock": 0.1, "weight_undock": 0.05, "cut_price": 1.0, "spread": 0.001, "keep_all_spots": false,
        },
    })
}

fn pairs(assignments: &Value) -> BTreeSet<(u64, u64)> {
    assignments
        .as_array()
        .unwrap()
        .iter()
        .map(|pair| {
            let number =
                |names: [&str; 2]| names.iter().find_map(|name| pair[*name].as_u64()).unwrap();
            (number(["module", "module_id"]), number(["spot", "spot_id"]))
        })
        .collect()
}

#[test]
fn another_vendor_announces_the_target_and_reads_the_formation() {
    let domain = &*Domain::for_processes(14);
    let file = ScenarioFile::new("driven", EIGHT);
    let (Some(mut announcer), Some(claims), Some(verdicts), Some(states)) = (
        Peer::start("put", "target", domain),
        Peer::start("take", "claims", domain),
        Peer::start("take", "verdict", domain),
        Peer::start("take", "module_states", domain),
    ) else {
        return;
    };
    announcer.put(&target_sample(3));
    let agents = start_eight(&file, domain);
    let verifier = Running::start("verifier", domain, &["--timeout-s", "90", "--json"]);
    let state = states.taken();
    assert!(
        (1..=8).contains(&state["modules"][0]["module_id"].as_u64().unwrap()),
        "{state}"
    );
    let claim = claims.taken();
    assert_eq!(claim["epoch"]["number"], 1, "{claim}");
    assert!(
        !claim["selections"].as_array().unwrap().is_empty(),
        "{claim}"
    );
    let verdict = verdicts.taken();
    let judged = verifier.finish(PATIENCE);
    assert_eq!(judged.status, 0, "{}{}", judged.stdout, judged.stderr);
    assert_eq!(verdict["outcome"], 1, "COMPLETE is 1: {verdict}");
    let plan =
        Running::start("formation", domain, &["plan", file.path(), "--json"]).finish(PATIENCE);
    assert_eq!(
        pairs(&verdict["assignments"]),
        pairs(&plan.json()["assignments"])
    );
    for agent in agents {
        assert_eq!(agent.stop().status, 0);
    }
}

/// A target of a revision far ahead, with a spot that is too far away.
fn bad_target() -> Value {
    let mut target = target_sample(u64::MAX);
    target["spots"][0]["x"] = json!(f64::MAX);
    target
}

/// RustDDS seeks the participants 0 to 11 of its host, so CycloneDDS as participant 12 has to seek it.
#[test]
fn another_vendor_finds_a_process_that_starts_later_on_a_port_that_was_free() {
    let domain = Domain::for_processes(2);
    let port = |participant: u16| 7_400 + 250 * domain.number() + 10 + 2 * participant;
    let taken = (0..12).map(|participant| (Ipv4Addr::UNSPECIFIED, port(participant)));
    let mut taken: Vec<UdpSocket> = taken.map(|at| UdpSocket::bind(at).unwrap()).collect();
    let Some(mut forger) = Peer::start("put", "target", &domain) else {
        return;
    };
    forger.await_ready();
    drop(taken.remove(5));
    let file = ScenarioFile::new("late", EIGHT);
    let arguments = ["--module", "1", "--scenario", file.path()];
    let agent = Running::start("module_agent", &domain, &arguments);
    forger.put(&bad_target());
    let refused = agent.wait_for_log(0, "target: spots[0].x", PATIENCE);
    assert!(refused.is_some(), "{:?}", agent.log_since(0));
}

#[test]
fn bad_messages_are_refused_and_counted_and_stop_no_process() {
    let domain = &*Domain::for_processes(14);
    let file = ScenarioFile::new("hostile", EIGHT);
    let (Some(mut garbler), Some(mut liar), Some(mut forger)) = (
        Peer::start("garble", "claims", domain),
        Peer::start("put", "claims", domain),
        Peer::start("put", "target", domain),
    ) else {
        return;
    };
    let agents = start_eight(&file, domain);
    let announcer = Running::start(
        "target_publisher",
        domain,
        &["--scenario", file.path(), "--expected-modules", "8"],
    );
    garbler.put(&json!("0001000007"));
    let claim = json!({
        "epoch": {"number": 1, "convener": 1}, "turn": 0, "claimant_id": 4, "incarnation": 1,
        "selections": [{"spot_id": 1, "module_id": 4}], "evictions": [], "detached": [],
    });
    liar.put(&claim);
    forger.put(&bad_target());
    let verifier = Running::start("verifier", domain, &["--timeout-s", "90", "--json"]);
    // The run may be over before the peers and all agents have found each other.
    for agent in &agents {
        for refusal in ["target: spots[0].x", "kind=malformed"] {
            let refused = agent.wait_for_log(0, refusal, PATIENCE);
            let logged = || {
                let lines = agent.log_since(0).into_iter().map(|line| line.text);
                lines.collect::<Vec<_>>().join("\n")
            };
            assert!(refused.is_some(), "no {refusal:?} in\n{}", logged());
        }
    }
    let judged = verifier.finish(PATIENCE);
    assert_eq!(judged.status, 0, "{}{}", judged.stdout, judged.stderr);
    assert_eq!(announcer.stop().status, 0);
    for agent in agents {
        assert_eq!(agent.stop().status, 0);
    }
}

/// Shows G2.
#[test]
fn a_missing_module_is_named_and_nothing_hangs() {
    let domain = &*Domain::for_processes(10);
    let file = ScenarioFile::new("missing", EIGHT);
    let mut agents = start_eight(&file, domain);
    // Module 3 is docked to module 2, so it is missed by name.
    drop(agents.remove(2));
    let _announcer = Running::start(
        "target_publisher",
        domain,
        &["--scenario", file.path(), "--expected-modules", "8"],
    );
    let verifier = Running::start("verifier", domain, &["--timeout-s", "12", "--json"]);
    let judged = verifier.finish(PATIENCE);
    assert_eq!(judged.status, 1, "{}{}", judged.stdout, judged.stderr);
    let output = format!("{}{}", judged.stdout, judged.stderr);
    assert!(output.contains("FAILED"), "{output}");
    let logs: Vec<String> = agents
        .into_iter()
        .map(|agent| agent.stop().stderr)
        .collect();
    // The first convenes, unless its DDS library locks itself up meanwhile.
    let conveners = if logs[0].contains("has locked itself up") {
        &logs[..]
    } else {
        &logs[..1]
    };
    let names_it = |log: &String| log.contains("7 of 8 modules have gathered; absent: 3");
    assert!(conveners.iter().any(names_it), "{}", conveners.concat());
}

#[test]
fn modules_can_agree_without_moving() {
    let domain = &*Domain::for_processes(10);
    let file = ScenarioFile::new("still", EIGHT);
    let run = ["run", file.path(), "--json", "--plan-only"];
    let finished = Running::start("formation", domain, &run).finish(PATIENCE);
    assert_eq!(finished.status, 0, "{}", finished.stderr);
    let report = finished.json();
    assert_eq!(report["verdict"], "AGREED");
    let plan =
        Running::start("formation", domain, &["plan", file.path(), "--json"]).finish(PATIENCE);
    assert_eq!(
        pairs(&report["assignments"]),
        pairs(&plan.json()["assignments"])
    );
    assert!(
        !finished.stderr.contains("settled 1"),
        "a module moved:\n{}",
        finished.stderr
    );
}
