//! Processes die or stop for a while, and their robots stay where they are.

use std::collections::{BTreeMap, BTreeSet};
use std::thread;
use std::time::{Duration, Instant};

use formation_tests::{Domain, Fleet, FleetTiming, Running, Signal, overlaps};
use tempfile::TempDir;

use super::{PATIENCE, SPARES};

const TRACE: &str = "trace.jsonl";

/// Shows B4.
#[test]
fn modules_that_die_block_their_spots_until_their_bodies_are_removed_and_count_until_their_votes_are()
 {
    let domain = &*Domain::for_processes(12);
    let mut fleet = Fleet::new("bodies", SPARES, domain, FleetTiming::Quick);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    let marks = fleet.marks();
    fleet.start_all();
    let _ = first_to_move(&fleet, &marks);
    let began = Instant::now();
    let whole = fleet.wait_until_whole(&judge, began, PATIENCE);
    // Spot 2 joins the others, so its module lives on.
    let holders = whole.assignments.iter().filter(|&(_, &spot)| spot != 2);
    let mut lost: Vec<u32> = holders.map(|(&module, _)| module).collect();
    assert_eq!(lost.len(), 4);
    let mut dead = BTreeSet::new();
    for batch in lost.chunks(3) {
        let died = batch.iter().map(|&module| fleet.kill(module)).max();
        dead.extend(batch.iter().copied());
        let living = fleet.living();
        let partial = judge.wait_until(died.unwrap(), PATIENCE, |judged| {
            judged.outcome == "PARTIAL" && judged.modules() == living
        });
        let partial = partial.unwrap_or_else(|last| panic!("{last:?}\n{}", fleet.story()));
        assert_eq!(partial.violations, [""; 0]);
        // Each spot of a dead module is blocked by name, and no other module stands on it.
        for (module, spot) in &whole.assignments {
            let blocker = partial.blocked.get(spot);
            assert_eq!(blocker, dead.get(module), "{partial:?}");
            assert_eq!(
                partial.assignments.get(module),
                blocker.xor(Some(module)).and(Some(spot))
            );
        }
    }
    let (_, spot) = whole
        .assignments
        .iter()
        .find(|(module, _)| **module == lost[0])
        .unwrap();
    let named = format!("spot {spot} is blocked by the body of module {}", lost[0]);
    let says_so = fleet.living().into_iter().any(|module| {
        let lines = fleet.agent(module).log_since(0);
        lines.iter().any(|line| line.text.contains(&named))
    });
    assert!(says_so, "no {named:?} in\n{}", fleet.story());
    // The living have no process of theirs reported as gone.
    let live = whole.assignments.iter().find(|&(_, &spot)| spot == 2);
    let live = live.unwrap().0.to_string();
    let refused = Running::start("formation", domain, &["remove", &live]).finish(PATIENCE);
    assert_eq!(refused.status, 1, "{}", refused.stderr);
    let removed = Instant::now();
    fleet.remove(&lost);
    let whole = fleet.wait_until_whole(&judge, removed, PATIENCE);
    // Two more, so that four of ten are left: nothing moves until the votes of the others are removed.
    let more = whole.assignments.iter().filter(|&(_, &spot)| spot != 2);
    let more: Vec<u32> = more.map(|(&module, _)| module).take(2).collect();
    let marks = fleet.marks();
    for &module in &more {
        fleet.kill(module);
    }
    lost.extend(&more);
    let waits = fleet.wait_for_any(&marks, "waiting for a quorum", PATIENCE);
    assert!(waits.is_some(), "{}", fleet.story());
    let removed = Instant::now();
    let ids: Vec<String> = lost.iter().map(u32::to_string).collect();
    let mut arguments = vec!["remove", "--vote-too"];
    arguments.extend(ids.iter().map(String::as_str));
    let done = Running::start("formation", domain, &arguments).finish(PATIENCE);
    assert_eq!(done.status, 0, "{}", done.stderr);
    judge
        .wait_until(removed, PATIENCE, |judged| {
            judged.outcome == "PARTIAL" && judged.modules() == fleet.living()
        })
        .unwrap_or_else(|last| panic!("{last:?}\n{}", fleet.story()));
}

/// A row of four spots, and eight modules whose paths cross.
const CROSSING: &str = "
name: crossing
target:
  spots: [{id: 1, x: 4, y: 5}, {id: 2, x: 5, y: 5}, {id: 3, x: 6, y: 5}, {id: 4, x: 7, y: 5}]
  edges: [[1, 2], [2, 3], [3, 4]]
singletons:
  - {id: 1, x: 1, y: 1}
  - {id: 2, x: 4, y: 0}
  - {id: 3, x: 7, y: 0}
  - {id: 4, x: 10, y: 1}
  - {id: 5, x: 1, y: 9}
  - {id: 6, x: 4, y: 10}
  - {id: 7, x: 7, y: 10}
  - {id: 8, x: 10, y: 9}
";

/// A module that sets off after `marks`.
fn first_to_move(fleet: &Fleet, marks: &BTreeMap<u32, usize>) -> u32 {
    let moving = fleet.wait_for_any(marks, "moving to", PATIENCE);
    moving.unwrap_or_else(|| panic!("{}", fleet.story()))
}

/// A verifier that writes down where the modules are.
struct Observer {
    process: Running,
    directory: TempDir,
}

impl Observer {
    fn start(domain: &str) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let trace = directory.path().join(TRACE);
        let options = ["--keep-watching", "--time-limit-s", "600", "--trace"];
        let options = [&options[..], &[trace.to_str().unwrap()]].concat();
        let process = Running::start("verifier", domain, &options);
        Self { process, directory }
    }

    fn assert_no_contact(self) {
        // It may not have judged yet, as it waits longer than the quick timing of the modules.
        let _ = self.process.stop();
        let trace = std::fs::read_to_string(self.directory.path().join(TRACE)).unwrap();
        assert_ne!(trace, "");
        let mut overlaps = overlaps(&trace);
        overlaps.retain(|overlap| overlap.depth > 0.01);
        assert_eq!(overlaps, [], "{trace}");
    }
}

#[test]
fn two_that_die_on_their_way_and_one_that_stops_for_a_while_are_not_touched() {
    let domain = &*Domain::for_processes(11);
    let mut fleet = Fleet::new("crossing", CROSSING, domain, FleetTiming::Quick);
    let observer = Observer::start(domain);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    let mut marks = fleet.marks();
    for module in fleet.modules().to_vec() {
        // A step of the path takes a second.
        fleet.start_at_speed(module, 1.0);
    }
    let mut died = Instant::now();
    for _ in 0..2 {
        let moving = first_to_move(&fleet, &marks);
        thread::sleep(Duration::from_millis(500));
        died = fleet.kill(moving);
        marks = fleet.marks();
    }
    let stopped = first_to_move(&fleet, &marks);
    fleet.agent(stopped).signal(Signal::STOP);
    thread::sleep(Duration::from_secs(5));
    fleet.agent(stopped).signal(Signal::CONT);
    let living = fleet.living();
    // One that the others went on without may be left out, if it could fill no spot that is connected to theirs.
    let rests = judge.wait_until(died, PATIENCE, |judged| {
        let is_formed = ["COMPLETE", "PARTIAL"].contains(&judged.outcome.as_str());
        is_formed && judged.modules().is_subset(&living)
    });
    let rests = rests.unwrap_or_else(|last| panic!("{last:?}\n{}", fleet.story()));
    assert_eq!(rests.violations, [""; 0]);
    assert!(!rests.assignments.is_empty(), "{rests:?}");
    observer.assert_no_contact();
}

/// One process stops in mid-motion for longer than the lease and for less than the suspicion: all others on their way halt,
/// and go on when it is back.
/// Shows X10.
#[test]
fn all_halt_when_one_is_silent_beyond_the_lease_and_then_go_on() {
    let domain = &*Domain::for_processes(11);
    let mut fleet = Fleet::new("lapse", CROSSING, domain, FleetTiming::Usual);
    let observer = Observer::start(domain);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    let marks = fleet.marks();
    for module in fleet.modules().to_vec() {
        // A step of the path takes two seconds, and each of the four goes several of them.
        fleet.start_at_speed(module, 0.5);
    }
    let silent = first_to_move(&fleet, &marks);
    thread::sleep(Duration::from_millis(1_000));
    let marks = fleet.marks();
    fleet.agent(silent).signal(Signal::STOP);
    let is_on_its_way = |&module: &u32| {
        let lines = fleet.agent(module).log_since(0);
        module != silent && lines.iter().any(|line| line.text.contains("moving to"))
    };
    let others: Vec<u32> = fleet.living().into_iter().filter(is_on_its_way).collect();
    assert!(!others.is_empty(), "{}", fleet.story());
    for other in others {
        let halted = fleet.agent(other).wait_for_log(
            marks[&other],
            "halted: agreement of modules",
            PATIENCE,
        );
        assert!(halted.is_some(), "module {other}:\n{}", fleet.story());
    }
    let back = Instant::now();
    fleet.agent(silent).signal(Signal::CONT);
    fleet.wait_until_whole(&judge, back, PATIENCE);
    observer.assert_no_contact();
}
