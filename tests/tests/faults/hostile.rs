//! A peer of another vendor that sends false messages, and many of them.

use std::collections::BTreeMap;
use std::io::Write;
use std::process::Stdio;
use std::time::Instant;

use formation_tests::{
    Domain, EIGHT, Finished, Fleet, FleetTiming, Peer, Python, Running, ScenarioFile, Transcript,
    report,
};
use serde_json::{Value, json};

use super::PATIENCE;

/// What came of a run of eight modules in two processes.
struct Outcome {
    agents: Vec<Finished>,
    /// Of both processes together, each at its peak.
    memory_kb: u64,
    lies: Value,
}

/// Forms with two processes of four modules each and the hostile peer, which begins when it has observed the formation.
fn form(python: &Python, options: &[&str]) -> Outcome {
    let domain = &*Domain::for_processes(8);
    let file = ScenarioFile::new("lied-to", EIGHT);
    // Slow enough that the modules are on their way while the lies come.
    let agents = ["1-4", "5-8"].map(|modules| {
        let scenario = file.path();
        let arguments = ["--modules", modules, "--scenario", scenario, "--speed", "2"];
        Running::start("module_agent", domain, &arguments)
    });
    let announce = ["--scenario", file.path(), "--expected-modules", "8"];
    let _announcer = Running::start("target_publisher", domain, &announce);
    let judge = ["--json", "--time-limit-s", "80"];
    let verifier = Running::start("verifier", domain, &judge);
    let mut arguments = vec!["--domain", domain, "--messages", "10000", "--rate", "1000"];
    arguments.extend(options);
    let mut peer = python.start("tests/python/hostile_peer.py", &arguments, Stdio::inherit());
    let said = Transcript::of(peer.stdout.take().unwrap());
    let lies = said.wait_for(0, PATIENCE, |line| {
        let report: Value = serde_json::from_str(&line.text).unwrap();
        report.get("sent").is_some().then_some(report)
    });
    let _ = peer.wait();
    let lies =
        lies.unwrap_or_else(|| panic!("the peer failed, as is said above; {}", python.advice()));
    let judged = verifier.finish(PATIENCE);
    assert_eq!(judged.status, 0, "{}{}", judged.stdout, judged.stderr);
    let verdict = &judged.last_json()["verdict"];
    assert_eq!(verdict["outcome"], "COMPLETE", "{verdict}");
    assert_eq!(verdict["filled_spots"], 8, "{verdict}");
    let memory_kb = agents.iter().map(Running::peak_memory_kb).sum();
    Outcome {
        agents: agents.map(Running::stop).into(),
        memory_kb,
        lies,
    }
}

/// The number of refusals of each kind, which a process logs when it ends: those of its modules' agents, and those of its
/// subscriptions.
fn refusals(agents: &[Finished]) -> BTreeMap<String, u64> {
    let mut counts: BTreeMap<String, u64> = BTreeMap::new();
    let mut add = |counted: &str| {
        let mut words = counted.split_whitespace();
        let (kind, count) = (words.next().unwrap(), words.next().unwrap());
        *counts.entry(kind.to_owned()).or_default() += count.parse::<u64>().unwrap();
    };
    for line in agents.iter().flat_map(|agent| agent.stderr.lines()) {
        if let Some((_, refused)) = line.split_once("refused: ") {
            refused.split(", ").for_each(&mut add);
        } else if let Some((_, statistics)) = line.split_once("topic statistics: ") {
            let values = statistics.split([',', ';', ':']).map(str::trim);
            let refused = values.filter_map(|value| value.strip_prefix("refused."));
            refused.for_each(&mut add);
        }
    }
    counts
}

/// Shows C2, E2, T3.
#[test]
fn lies_and_a_flood_are_refused_counted_by_kind_and_fill_no_memory() {
    let Some(python) = Python::find() else {
        return;
    };
    // The memory that a third participant costs by itself.
    let quiet = form(&python, &["--silent"]);
    assert_eq!(quiet.lies["total"], 0, "{}", quiet.lies);
    let lied_to = form(&python, &[]);
    let sent = &lied_to.lies;
    assert_eq!(sent["total"], 10_000, "{sent}");
    let counts = refusals(&lied_to.agents);
    report(&format!(
        "sent {} lies in {} s; refused {counts:?}; memory {} kB, in silence {} kB",
        sent["total"], sent["seconds"], lied_to.memory_kb, quiet.memory_kb
    ));
    for kind in [
        // Claims, states, heartbeats and rosters in the name of the living.
        "wrong_source",
        "duplicate_module",
        "stale_incarnation",
        // Epochs that are over, and one too far away to be true.
        "stale_epoch",
        "implausible_epoch",
        // Another target under a known revision.
        "contradicting_target",
        // Lists too long, and poses that are no number.
        "invalid",
    ] {
        assert!(counts.contains_key(kind), "{kind} is not in {counts:?}");
    }
    let ordinary = refusals(&quiet.agents);
    assert!(!ordinary.contains_key("wrong_source"), "{ordinary:?}");
    // Of what remains, most are the huge messages: the DDS library keeps the latest of every topic, whatever their size.
    assert!(
        lied_to.memory_kb <= 2 * quiet.memory_kb,
        "{} kB are more than twice {} kB",
        lied_to.memory_kb,
        quiet.memory_kb
    );
}

/// A stranger publishes a roster with invented voters, a target and a command to stop of the highest revisions, and then
/// heartbeats of a module whose process has ended. Later epochs, targets, commands and the module itself are not kept out.
/// Shows E10.
#[test]
fn what_a_stranger_claims_has_no_lasting_effect() {
    let Some(python) = Python::find() else {
        return;
    };
    let domain = &*Domain::for_processes(8);
    let mut fleet = Fleet::new("strangers", EIGHT, domain, FleetTiming::Quick);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    fleet.start_all();
    fleet.wait_until_whole(&judge, Instant::now(), PATIENCE);
    let arguments = ["--domain", domain, "--stranger"];
    let mut peer = python.start("tests/python/hostile_peer.py", &arguments, Stdio::inherit());
    let said = Transcript::of(peer.stdout.take().unwrap());
    let reports = |key: &str| {
        let found = said.wait_for(0, PATIENCE, |line| {
            let report: Value = serde_json::from_str(&line.text).unwrap();
            report.get(key).map(|_| ())
        });
        assert!(found.is_some(), "no {key}; {}", python.advice());
    };
    reports("forged");
    // The next epoch needs a majority of the last one, and of nothing else.
    let died = fleet.kill_and_remove(8);
    let living = fleet.living();
    let partial = judge.wait_until(died, PATIENCE, |judged| {
        judged.outcome == "PARTIAL" && judged.modules() == living
    });
    partial.unwrap_or_else(|last| panic!("{last:?}\n{}", fleet.story()));
    let mut input = peer.stdin.take().unwrap();
    writeln!(input, "8").unwrap();
    reports("squatted");
    // Another target, under a revision of its own time, and the module itself.
    let other = ScenarioFile::new("strangers-again", &EIGHT.replace("y: 6}", "y: 4}"));
    let announce = ["--scenario", other.path(), "--expected-modules", "8"];
    let _again = Running::start("target_publisher", domain, &announce);
    let restarted = Instant::now();
    fleet.start(8, None);
    let whole = fleet.wait_until_whole(&judge, restarted, PATIENCE);
    assert_eq!(whole.assignments.len(), 8, "{whole:?}");
    let stopped = Running::start("formation", domain, &["stop"]).finish(PATIENCE);
    assert_eq!(stopped.status, 0, "{}", stopped.stderr);
    drop(input);
    let _ = peer.wait();
    let agents: Vec<Finished> = fleet.stop_all().into_values().collect();
    let counts = refusals(&agents);
    for kind in [
        "no_quorum",
        "invalid",
        "implausible_stop",
        "implausible_incarnation",
    ] {
        assert!(counts.contains_key(kind), "{kind} is not in {counts:?}");
    }
}

/// One sample that says SETTLED without an epoch, of a module that takes no part, made a right formation FAILED.
#[test]
fn one_state_of_an_unknown_module_changes_no_verdict() {
    let domain = &*Domain::for_processes(8);
    let Some(mut stranger) = Peer::start("put", "module_states", domain) else {
        return;
    };
    stranger.await_ready();
    stranger.put(&json!({"modules": [{
        "module_id": 40, "incarnation": 1, "sequence": 1, "phase": 7, "service": 1, "drive": 1, "x": 900.0, "y": 900.0,
        "configuration_id": u32::MAX, "leader_id": u32::MAX, "spot_id": 1, "unit_id": 40, "settled_since": 1,
    }]}));
    let file = ScenarioFile::new("unknown", EIGHT);
    let agents = ["--modules", "1-8", "--scenario", file.path()];
    let _agents = Running::start("module_agent", domain, &agents);
    let announce = ["--scenario", file.path(), "--expected-modules", "8"];
    let _announcer = Running::start("target_publisher", domain, &announce);
    let judge = ["--json", "--progress", "--time-limit-s", "80"];
    let judged = Running::start("verifier", domain, &judge).finish(PATIENCE);
    assert_eq!(judged.status, 0, "{}{}", judged.stdout, judged.stderr);
    // The sample is latched, so the verifier has received it by then.
    let joined = judged.stdout.lines().filter_map(|line| {
        let line: Value = serde_json::from_str(line).ok()?;
        line["progress"]["joined"].as_u64()
    });
    assert_eq!(joined.max(), Some(9), "{}", judged.stdout);
    let verdict = &judged.last_json()["verdict"];
    assert_eq!(verdict["outcome"], "COMPLETE", "{verdict}");
}
