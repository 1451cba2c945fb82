//! Modules whose memory outlives their processes.

use std::fs;
use std::thread;
use std::time::{Duration, Instant};

use formation_tests::{Domain, Fleet, FleetTiming, Running};

use super::{PATIENCE, SPARES};

/// Kills the process of every module, and starts all of them again.
fn restart_all(fleet: &mut Fleet) {
    for module in fleet.modules().to_vec() {
        fleet.kill(module);
    }
    fleet.start_all();
}

#[test]
fn a_formation_whose_processes_are_all_killed_goes_on_from_its_stores() {
    let domain = &*Domain::for_processes(12);
    let mut fleet = Fleet::new("stores", SPARES, domain, FleetTiming::Quick).with_stores();
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    fleet.start_all();
    let marks = fleet.marks();
    let moving = fleet.wait_for_any(&marks, "moving to", PATIENCE);
    assert!(moving.is_some(), "{}", fleet.story());
    let killed = Instant::now();
    restart_all(&mut fleet);
    let whole = fleet.wait_until_whole(&judge, killed, PATIENCE);
    // Again, once all stand on their spots.
    let killed = Instant::now();
    let marks = fleet.marks();
    restart_all(&mut fleet);
    let again = judge.wait_until(killed, PATIENCE, |judged| {
        judged.is_whole() && judged.epoch > whole.epoch
    });
    let again = again.unwrap_or_else(|last| panic!("{last:?}\n{}", fleet.story()));
    assert_eq!(again.assignments, whole.assignments);
    let moved = fleet.wait_for_any(&marks, "moving to", Duration::ZERO);
    assert_eq!(moved, None, "each is on its spot");
}

/// One spot for one module.
const ONE: &str = "
target: {spots: [{id: 1, x: 5, y: 5}]}
singletons: [{id: 4, x: 1, y: 1}]
";

#[test]
fn a_store_serves_one_process_and_ends_it_when_it_cannot_be_written() {
    let domain = &*Domain::for_processes(1);
    let fleet = Fleet::new("one-store", ONE, domain, FleetTiming::Quick);
    let directory = tempfile::tempdir().unwrap();
    let state_dir = directory.path().to_str().unwrap();
    let start = || {
        let arguments = "--module 4 --x 0 --y 0 --state-dir";
        let arguments: Vec<&str> = arguments.split(' ').chain([state_dir]).collect();
        Running::start("module_agent", domain, &arguments)
    };
    let first = start();
    assert!(
        first
            .wait_for_log(0, "joined the ROS 2 graph", PATIENCE)
            .is_some()
    );
    let second = start().finish(PATIENCE);
    assert_eq!(second.status, 2, "{}", second.stderr);
    let reason =
        "module_4.lock: another process uses it; end that process, or use another directory";
    assert!(second.stderr.contains(reason), "{}", second.stderr);
    // Long enough for the state at the start; the target leads to an epoch, which needs another write.
    thread::sleep(Duration::from_secs(1));
    fs::remove_dir_all(directory.path()).unwrap();
    let _announcer = fleet.announce(None);
    let first = first.finish(PATIENCE);
    assert_eq!(first.status, 1, "{}", first.stderr);
    let reason = "module_4.session_0.json: cannot write it: No such file or directory (os error 2); the modules stop";
    assert!(first.stderr.contains(reason), "{}", first.stderr);
}
