//! Processes are killed at moments drawn from a seed, and by the part that they play.
//!
//! Recovery is the time from a kill to the first verdict that the formation is whole again: COMPLETE, without a violation,
//! and judged on a roster of the living. The bodies of killed modules are reported as removed, as those of simulated robots
//! vanish with their processes.

use std::collections::BTreeMap;
use std::fmt;
use std::thread;
use std::time::{Duration, Instant};

use formation_generate::Random;
use formation_tests::{Domain, Fleet, FleetTiming, report};

use super::{PATIENCE, SPARES};

/// When a module is killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Moment {
    Gathering,
    Planning,
    Acting,
    Done,
}

impl Moment {
    /// What is logged when it begins, and the longest time after that, in milliseconds.
    fn cue(self) -> (&'static str, u64) {
        match self {
            Self::Gathering => ("halted for", 400),
            Self::Planning => ("planning epoch", 30),
            Self::Acting => ("moving to", 1_500),
            Self::Done => ("settled on", 0),
        }
    }
}

/// One kill, and how long the recovery took.
struct Recovery {
    moment: Moment,
    module: u32,
    duration: Duration,
}

impl fmt::Display for Recovery {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            moment,
            module,
            duration,
        } = self;
        let seconds = duration.as_secs_f64();
        write!(
            formatter,
            "module {module} killed while {moment:?}: whole after {seconds:.1} s"
        )
    }
}

/// Waits for the moment to begin, lets a random part of it pass, and kills a random module.
fn kill_at(
    moment: Moment,
    marks: &BTreeMap<u32, usize>,
    fleet: &mut Fleet,
    random: &mut Random,
) -> (Moment, u32, Instant) {
    let (cue, spread_ms) = moment.cue();
    let first = fleet.wait_for_any(marks, cue, PATIENCE);
    assert!(first.is_some(), "no {cue:?} in\n{}", fleet.story());
    thread::sleep(Duration::from_millis(random.below(spread_ms + 1)));
    let living: Vec<u32> = fleet.living().into_iter().collect();
    let module = living[random.index(living.len())];
    (moment, module, fleet.kill_and_remove(module))
}

fn random_moment(random: &mut Random) -> Moment {
    [Moment::Gathering, Moment::Planning, Moment::Acting][random.index(3)]
}

/// Forms with spares over DDS, and kills as [`kill_some`] does.
fn run_with_kills(timing: FleetTiming, seed: u64, kills: usize) -> Vec<Recovery> {
    let domain = &*Domain::for_processes(12);
    kill_some(Fleet::new("kills", SPARES, domain, timing), seed, kills)
}

/// Forms and kills at most five modules at moments drawn from the seed: one while they first form, then, again and again, one
/// that has settled and another while the others recover from that.
fn kill_some(mut fleet: Fleet, seed: u64, kills: usize) -> Vec<Recovery> {
    let mut random = Random::from_seed(seed);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    let marks = fleet.marks();
    fleet.start_all();
    let moment = random_moment(&mut random);
    let mut killed = vec![kill_at(moment, &marks, &mut fleet, &mut random)];
    let mut recoveries = Vec::new();
    loop {
        let last = killed.last().unwrap().2;
        let whole = fleet.wait_until_whole(&judge, last, PATIENCE);
        assert_eq!(whole.violations, [""; 0]);
        for &(moment, module, at) in &killed {
            recoveries.push(Recovery {
                moment,
                module,
                duration: whole.at.duration_since(at),
            });
        }
        if recoveries.len() >= kills {
            break;
        }
        let marks = fleet.marks();
        let holders: Vec<u32> = whole.assignments.keys().copied().collect();
        let module = holders[random.index(holders.len())];
        killed = vec![(Moment::Done, module, fleet.kill_and_remove(module))];
        if recoveries.len() + killed.len() < kills {
            let moment = random_moment(&mut random);
            killed.push(kill_at(moment, &marks, &mut fleet, &mut random));
        }
    }
    for (module, finished) in fleet.stop_all() {
        assert_eq!(finished.status, 0, "module {module}:\n{}", finished.stderr);
    }
    recoveries
}

fn report_times(recoveries: &[Recovery]) {
    let mut times: Vec<Duration> = recoveries.iter().map(|one| one.duration).collect();
    times.sort_unstable();
    let median = times[times.len() / 2].as_secs_f64();
    let worst = times[times.len() - 1].as_secs_f64();
    report(&format!(
        "{} kills, all hole-free; recovery: median {median:.1} s, worst {worst:.1} s",
        times.len()
    ));
}

#[test]
fn three_kills_at_random_moments_leave_no_hole() {
    let recoveries = run_with_kills(FleetTiming::Quick, 1, 3);
    report_times(&recoveries);
}

#[cfg(feature = "zenoh")]
#[test]
fn three_kills_over_zenoh_leave_no_hole() {
    let domain = &*Domain::for_processes(13);
    let router = crate::zenoh::Router::start(domain);
    let fleet = Fleet::new("zenoh kills", SPARES, domain, FleetTiming::Quick);
    let recoveries = kill_some(fleet.over_zenoh(&router.endpoint()), 1, 3);
    report_times(&recoveries);
}

/// Run by `tests/soak_kills.sh`, which says how many kills from which seed.
#[test]
#[ignore = "takes minutes; run tests/soak_kills.sh"]
fn many_kills_at_random_moments_leave_no_hole() {
    const KILLS_PER_RUN: usize = 5;
    let number = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |value| value.parse().unwrap())
    };
    let kills = usize::try_from(number("FORMATION_KILLS", 50)).unwrap();
    let mut seed = number("FORMATION_SEED", 1);
    let mut recoveries = Vec::new();
    while recoveries.len() < kills {
        let run = run_with_kills(
            FleetTiming::Usual,
            seed,
            KILLS_PER_RUN.min(kills - recoveries.len()),
        );
        for recovery in &run {
            report(&format!("seed {seed}: {recovery}"));
        }
        recoveries.extend(run);
        seed += 1;
    }
    report_times(&recoveries);
}

/// Shows G2.
#[test]
fn the_convener_and_then_a_leader_may_die() {
    let domain = &*Domain::for_processes(12);
    let mut fleet = Fleet::new("convener", SPARES, domain, FleetTiming::Quick);
    let judge = fleet.judge(None);
    let _announcer = fleet.announce(None);
    let marks = fleet.marks();
    fleet.start_all();
    // The lowest module that lives then: another than 1 if that one is late.
    let convener = fleet.wait_for_any(&marks, "convened epoch", PATIENCE);
    let convener = convener.unwrap_or_else(|| panic!("{}", fleet.story()));
    fleet.kill_and_remove(convener);
    // The others go on without it, whether or not its roster came out. Module 2 leads the docked modules; without it, each
    // leads itself.
    let leader = if convener == 2 {
        fleet.wait_for_any(&marks, "moving to", PATIENCE)
    } else {
        let moves = fleet.agent(2).wait_for_log(0, "moving to", PATIENCE);
        moves.map(|_| 2)
    };
    let leader = leader.unwrap_or_else(|| panic!("{}", fleet.story()));
    let died = fleet.kill_and_remove(leader);
    fleet.wait_until_whole(&judge, died, PATIENCE);
}

#[test]
fn the_target_publisher_and_the_verifier_may_die() {
    let domain = &*Domain::for_processes(12);
    let mut fleet = Fleet::new("watchers", SPARES, domain, FleetTiming::Quick);
    let mut judge = fleet.judge(None);
    let mut announcer = fleet.announce(None);
    let marks = fleet.marks();
    fleet.start_all();
    let planning = fleet.wait_for_any(&marks, "planning epoch", PATIENCE);
    assert!(planning.is_some(), "{}", fleet.story());
    announcer.kill();
    judge.kill();
    assert!(judge.verdicts().is_empty(), "it died before it could judge");
    let settled = fleet.wait_for_any(&marks, "settled on", PATIENCE);
    assert!(settled.is_some(), "{}", fleet.story());
    // A verifier that starts later receives enough to judge.
    let started = Instant::now();
    let judge = fleet.judge(None);
    let whole = fleet.wait_until_whole(&judge, started, PATIENCE);
    // The members know what they planned for, so the formation recovers from a death without the publisher.
    let &module = whole.assignments.keys().next_back().unwrap();
    let died = fleet.kill_and_remove(module);
    fleet.wait_until_whole(&judge, died, PATIENCE);
}
