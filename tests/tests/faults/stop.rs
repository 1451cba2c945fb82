//! All modules are stopped on command, and resumed.

use std::collections::{BTreeMap, BTreeSet};
use std::thread;
use std::time::{Duration, Instant};

use formation_tests::{Domain, Fleet, FleetTiming, Running};
use serde_json::Value;

use super::PATIENCE;
use super::restarts::NO_SPARES;

/// Half of the quick suspicion.
const LEASE: Duration = Duration::from_millis(1_250);

/// Gives a command, and waits until the launcher says that the modules show it.
fn command(name: &str, domain: &str) {
    let finished = Running::start("formation", domain, &[name]).finish(PATIENCE);
    assert_eq!(finished.status, 0, "{}", finished.stderr);
}

/// The modules that an event log shows at another pose than before, after a time.
fn moved_after(observer: &Running, since: Instant) -> BTreeSet<u64> {
    let mut poses = BTreeMap::new();
    let mut moved = BTreeSet::new();
    let mut left = observer.printed();
    observer.wait_for_line(0, Duration::ZERO, |line| {
        let entry: Value = serde_json::from_str(&line.text).unwrap();
        let kinds = ["pose", "state"].map(|kind| &entry["entry"][kind]);
        if let Some(shown) = kinds.into_iter().find(|shown| shown.is_object()) {
            let module = shown["module"].as_u64().unwrap();
            let before = poses.insert(module, shown["pose"].clone());
            if line.at > since && before.is_some_and(|before| before != shown["pose"]) {
                moved.insert(module);
            }
        }
        left -= 1;
        (left == 0).then_some(())
    });
    moved
}

/// Shows H2.
#[test]
fn a_stop_in_mid_motion_halts_all_and_outlasts_restarts_until_it_is_resumed() {
    let domain = &*Domain::for_processes(6);
    let mut fleet = Fleet::new("halted", NO_SPARES, domain, FleetTiming::Quick);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    let observe = [
        "--event-log",
        "--json",
        "--keep-watching",
        "--time-limit-s",
        "600",
    ];
    let observer = Running::start("verifier", domain, &observe);
    let marks = fleet.marks();
    for module in fleet.modules().to_vec() {
        // Each motion takes seconds, and one follows another.
        fleet.start_at_speed(module, 1.0);
    }
    let moving = fleet.wait_for_any(&marks, "moving to", PATIENCE);
    let moving = moving.unwrap_or_else(|| panic!("{}", fleet.story()));
    command("stop", domain);
    thread::sleep(LEASE);
    let halted = Instant::now();
    let marks = fleet.marks();
    thread::sleep(LEASE * 2);
    // The one on its way restarts, and the others open an epoch with it.
    fleet.kill(moving);
    fleet.start(moving, None);
    let joined = fleet.wait_for_any(&marks, "planning epoch", PATIENCE);
    assert!(joined.is_some(), "{}", fleet.story());
    let again = fleet
        .agent(moving)
        .wait_for_log(0, "stopped on command", PATIENCE);
    assert!(again.is_some(), "{}", fleet.story());
    thread::sleep(LEASE * 2);
    assert_eq!(
        fleet.wait_for_any(&marks, "moving to", Duration::ZERO),
        None
    );
    // The process that restarted shows the pose of its start.
    let moved = moved_after(&observer, halted);
    let is_restarted = |&module: &u64| module == u64::from(moving);
    assert!(moved.iter().all(is_restarted), "{moved:?}");
    assert!(
        judge.verdicts().is_empty(),
        "the time of a stop does not count"
    );
    let resumed = Instant::now();
    command("resume", domain);
    fleet.wait_until_whole(&judge, resumed, PATIENCE);
}
