//! Processes that come back: restarted, twice at once, or stopped for a while.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::thread;
use std::time::Instant;

use formation_model::Scenario;
use formation_planner as planner;
use formation_tests::{Domain, Fleet, FleetTiming, Judged, Peer, Signal};

use super::{PATIENCE, SPARES};

/// As many modules as spots, so that all are needed; modules 1 and 2 are docked.
pub(super) const NO_SPARES: &str = "
name: no-spares
target:
  frame_id: map
  spots:
    - {id: 1, x: 5, y: 5}
    - {id: 2, x: 6, y: 5}
    - {id: 3, x: 7, y: 5}
    - {id: 4, x: 8, y: 5}
  edges: [[1, 2], [2, 3], [3, 4]]
configurations:
  - id: 1
    leader: 2
    modules: [{id: 1, x: 1, y: 1}, {id: 2, x: 2, y: 1}]
    edges: [[1, 2]]
singletons:
  - {id: 3, x: 9, y: 2}
  - {id: 4, x: 2, y: 9, theta: 1.0}
";

const DUPLICATE: &str = "a second process runs as module";

#[test]
fn a_restarted_module_takes_part_again() {
    let domain = &*Domain::for_processes(6);
    let mut fleet = Fleet::new("restart", NO_SPARES, domain, FleetTiming::Quick);
    // It misses a module, and retracts its verdict a second later, before the others form without that module.
    let judge = fleet.judge_within(None, FleetTiming::Quick.suspicion() / 4);
    let _announcer = fleet.announce(None);
    let began = Instant::now();
    fleet.start_all();
    fleet.wait_until_whole(&judge, began, PATIENCE);
    // The leader of the configuration comes back at once, undocked and where it stood at the start.
    let died = fleet.kill(2);
    fleet.start(2, None);
    fleet.wait_until_whole(&judge, died, PATIENCE);
    // Another comes back only when the rest have made do without it.
    let died = fleet.kill(4);
    let broken = judge.wait_until(died, PATIENCE, |judged| judged.outcome == "FAILED");
    let broken = broken.unwrap();
    assert!(
        !broken.missing.is_empty(),
        "the verifier withdraws its verdict and gives the reason"
    );
    let partial = judge.wait_until(died, PATIENCE, |judged| judged.outcome == "PARTIAL");
    assert_eq!(partial.unwrap().modules(), BTreeSet::from([1, 2, 3]));
    fleet.start(4, None);
    fleet.wait_until_whole(&judge, died, PATIENCE);
}

#[test]
fn a_second_process_with_a_live_id_is_refused_and_both_log_it() {
    let domain = &*Domain::for_processes(7);
    let mut fleet = Fleet::new("duplicate", NO_SPARES, domain, FleetTiming::Quick);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    let began = Instant::now();
    fleet.start_all();
    fleet.wait_until_whole(&judge, began, PATIENCE);
    let before = judge.verdicts().len();
    let mark = fleet.agent(3).logged();
    let second = fleet.start_second(3);
    assert!(second.wait_for_log(0, DUPLICATE, PATIENCE).is_some());
    assert!(
        fleet
            .agent(3)
            .wait_for_log(mark, DUPLICATE, PATIENCE)
            .is_some(),
        "{}",
        fleet.story()
    );
    thread::sleep(FleetTiming::Quick.suspicion() * 2);
    assert_eq!(judge.verdicts().len(), before, "the formation stands");
    // When the first is gone, the second takes its place.
    let died = fleet.replace(3, second);
    fleet.wait_until_whole(&judge, died, PATIENCE);
}

#[test]
fn a_process_that_wakes_after_another_took_its_place_disturbs_nothing() {
    let domain = &*Domain::for_processes(7);
    let mut fleet = Fleet::new("succeeded", NO_SPARES, domain, FleetTiming::Quick);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    let began = Instant::now();
    fleet.start_all();
    fleet.wait_until_whole(&judge, began, PATIENCE);
    fleet.agent(3).signal(Signal::STOP);
    let stopped = Instant::now();
    let sleeper = fleet.succeed(3);
    fleet.wait_until_whole(&judge, stopped, PATIENCE);
    let before = judge.verdicts().len();
    let mark = sleeper.logged();
    sleeper.signal(Signal::CONT);
    assert!(sleeper.wait_for_log(mark, DUPLICATE, PATIENCE).is_some());
    thread::sleep(FleetTiming::Quick.suspicion() * 3);
    let verdicts = judge.verdicts();
    assert_eq!(
        verdicts.len(),
        before,
        "the formation stands: {:?}\n{}",
        verdicts.last(),
        fleet.story()
    );
    for line in sleeper.log_since(mark) {
        assert!(!line.text.contains("moving to"), "{}", line.text);
    }
}

/// A module that travels alone in the plan, far enough to be stopped on its way.
fn lone_traveller() -> u32 {
    let problem = Scenario::from_yaml(SPARES).unwrap().problem().clone();
    let plan = planner::plan(Arc::new(problem.clone())).plan;
    let mut alone = plan
        .assignments
        .keys()
        .copied()
        .filter(|&module| problem.module(module).unwrap().links.is_empty());
    alone.next_back().unwrap().0
}

/// Shows A1.
#[test]
fn a_process_that_was_stopped_does_not_act_on_its_stale_plan() {
    const SPEED: f64 = 0.25;
    let domain = &*Domain::for_processes(12);
    let sleeper = lone_traveller();
    let mut fleet = Fleet::new("stopped", SPARES, domain, FleetTiming::Quick);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    let states = Peer::start("take", "module_states", domain);
    for module in fleet.modules().to_vec() {
        let speed = if module == sleeper { SPEED } else { 10.0 };
        fleet.start_at_speed(module, speed);
    }
    let moving = fleet.agent(sleeper).wait_for_log(0, "moving to", PATIENCE);
    assert!(moving.is_some(), "{}", fleet.story());
    // Where another vendor's DDS is there to see it, only once that has its departure.
    if let Some(states) = &states {
        const MOVING: u8 = 6;
        states.await_state_of(sleeper, |_, state| state["phase"] == MOVING);
    }
    fleet.agent(sleeper).signal(Signal::STOP);
    let stopped = Instant::now();
    let mut others = fleet.living();
    others.remove(&sleeper);
    let partial = judge.wait_until(stopped, PATIENCE, |judged| {
        judged.outcome == "PARTIAL" && judged.modules() == others
    });
    let partial = partial.unwrap_or_else(|last| panic!("{last:?}\n{}", fleet.story()));
    assert!(partial.at.duration_since(stopped) > FleetTiming::Quick.suspicion());
    // Its body may be anywhere between its last pose and its spot, which no other module takes.
    let blockers: BTreeSet<u32> = partial.blocked.values().copied().collect();
    assert_eq!(blockers, BTreeSet::from([sleeper]), "{partial:?}");
    let mark = fleet.agent(sleeper).logged();
    fleet.agent(sleeper).signal(Signal::CONT);
    let woken = Instant::now();
    let joined = fleet
        .agent(sleeper)
        .wait_for_log(mark, "halted for", PATIENCE);
    let joined = joined.unwrap_or_else(|| panic!("{}", fleet.story()));
    for line in fleet.agent(sleeper).log_since(mark) {
        for deed in ["moving to", "settled on", "convened"] {
            assert!(
                line.at >= joined || !line.text.contains(deed),
                "{}",
                line.text
            );
        }
    }
    // With or without it: a spare may have taken its spot before it was back.
    let whole = judge.wait_until(woken, PATIENCE, Judged::is_whole);
    assert!(whole.is_ok(), "{}", fleet.story());
    // Its poses before and after, as another vendor's DDS received them.
    if let Some(states) = states {
        // Discovery of its new participant takes as long as it takes.
        states.await_state_of(sleeper, |at, _| at >= woken);
        let poses = states.poses_of(sleeper);
        let poses = poses.iter().filter(|(at, _)| *at < joined);
        let (before, after): (Vec<_>, Vec<_>) = poses.partition(|(at, _)| *at < woken);
        let &(_, (x, y)) = before.last().unwrap();
        // A drive whose goal is not repeated continues for one lease, which is half the suspicion.
        let allowed = SPEED * FleetTiming::Quick.suspicion().as_secs_f64();
        for (_, (later_x, later_y)) in after {
            let distance = (later_x - x).hypot(later_y - y);
            assert!(distance <= allowed, "it went on for {distance} units");
        }
    }
}
