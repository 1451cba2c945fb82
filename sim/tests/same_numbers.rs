//! Modules whose numbers or runs do not distinguish bodies: of another session, or of a clock that was set back.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::support::{Trial, drawn, drawn_beside, hold_a_plan, ids};
use formation_generate::Grouping;
use formation_model::{
    BodyReport, ClosedRoster, Epoch, Incarnation, Message, ModuleId, ModulePhase, ModuleState,
    Pose, Removal, Roster, RosterMessage, Voters, Whereabouts,
};
use formation_protocol::Agent;
use formation_sim::{AgentFactory, Cluster, ClusterParameters, Stores};

/// An incarnation that is later than every other.
pub const LATE: u64 = 1 << 40;

/// The distance from the body of a module to the nearest other one, in units.
fn nearest(trial: &Trial, module: ModuleId) -> f64 {
    let cluster = &trial.cluster;
    let here = cluster.body(module).unwrap();
    let others = cluster.modules().into_iter().filter(|&one| one != module);
    let bodies = others.filter_map(|one| cluster.body(one));
    bodies
        .map(|body| body.distance_to(&here).to_units())
        .fold(f64::MAX, f64::min)
}

fn of_other_session(module: u32, x: f64) -> Message {
    let run = ModuleId(module).run(Incarnation(LATE));
    let pose = Pose::from_units(x, 5_000.0, 0.0).unwrap();
    Message::OtherSessionState(Arc::new(ModuleState::standing(run, pose)))
}

/// Whether these modules hold a plan within this time.
fn form_within(trial: &mut Trial, modules: &[u32], seconds: u32) -> bool {
    (0..seconds).any(|_| {
        trial.run_for(Duration::from_secs(1));
        hold_a_plan(&trial.cluster, &ids(modules))
    })
}

/// The third module restarts, and ends after this time; whether it moved in between.
fn restart_for(trial: &mut Trial, seconds: u64) -> bool {
    let third = ModuleId(3);
    let before = trial.cluster.body(third).unwrap();
    trial.cluster.restart(third);
    trial.run_for(Duration::from_secs(seconds));
    let after = trial.cluster.body(third).unwrap();
    trial.cluster.crash(third);
    after.distance_to(&before).to_units() > 0.9
}

/// The links between these groups of modules.
fn between(groups: &[&[u32]]) -> BTreeSet<(ModuleId, ModuleId)> {
    let group_of = |module| groups.iter().position(|group| group.contains(&module));
    let modules = || groups.iter().flat_map(|group| group.iter().copied());
    let pairs = modules().flat_map(|from| modules().map(move |to| (from, to)));
    let apart = pairs.filter(|&(from, to)| group_of(from) != group_of(to));
    apart
        .map(|(from, to)| (ModuleId(from), ModuleId(to)))
        .collect()
}

/// Agents of which this one has these incarnations, one a run.
pub fn with_runs(module: ModuleId, incarnations: &'static [u64]) -> AgentFactory {
    let runs = AtomicU64::new(0);
    AgentFactory::new(move |mut identity, parameters, now| {
        if identity.module == module {
            let run = runs.fetch_add(1, Ordering::Relaxed);
            let run = usize::try_from(run).unwrap().min(incarnations.len() - 1);
            identity.incarnation = Incarnation(incarnations[run]);
        }
        Agent::new(identity, parameters, now)
    })
}

/// Shows B6.
#[test]
fn a_module_of_another_session_takes_no_body_from_one_with_its_number() {
    for seed in 0..4 {
        let problem = drawn(6, 5, Grouping::Singletons, seed);
        let mut trial = Trial::with(&problem, ClusterParameters::default(), seed);
        trial.until(Cluster::has_formed);
        let (lost, _) = trial.settled()[1];
        trial.cluster.inject(&of_other_session(lost.0, 5_000.0));
        trial.run_for(Duration::from_secs(5));
        trial.cluster.cut(&[lost].into());
        trial.run_for(Duration::from_secs(120));
        assert!(nearest(&trial, lost) > 0.9, "seed {seed}");
    }
}

/// Shows B6.
#[test]
fn bodies_of_another_session_take_no_room_from_those_of_this_one() {
    let problem = drawn_beside(6, 5, Grouping::Singletons, 0);
    let mut trial = Trial::with(&problem, ClusterParameters::default(), 0);
    trial
        .cluster
        .start_late(ModuleId(3), Duration::from_secs(5));
    trial.run_for(Duration::from_millis(600));
    for number in 0..10_000 {
        let state = of_other_session(100_000 + number, 5_000.0 + f64::from(number));
        trial.cluster.inject(&state);
    }
    trial.until(Cluster::has_formed);
    let (lost, _) = trial.settled()[1];
    trial.cluster.cut(&[lost].into());
    trial.run_for(Duration::from_secs(120));
    assert!(nearest(&trial, lost) > 0.9);
}

/// Shows M7.
#[test]
fn the_body_of_a_run_that_is_earlier_by_its_clock_is_known() {
    for seed in 0..12 {
        let agents = with_runs(ModuleId(3), &[LATE, 1_001]);
        let problem = drawn_beside(6, 5, Grouping::Singletons, seed);
        let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), seed, agents);
        // A spare that could take the spot of the third module.
        let spare = Duration::from_secs(300);
        trial.cluster.start_late(ModuleId(6), spare);
        trial.run_for(Duration::from_millis(700));
        trial.cluster.crash(ModuleId(3));
        // Until what the silent run claimed keeps no other out.
        trial.run_for(Duration::from_secs(22));
        trial.cluster.restart(ModuleId(3));
        assert!(
            form_within(&mut trial, &[1, 2, 3, 4, 5], 200),
            "seed {seed}"
        );
        trial.run_for(spare);
        trial.cluster.cut(&ids(&[3]));
        trial.run_for(Duration::from_secs(120));
        assert!(nearest(&trial, ModuleId(3)) > 0.9, "seed {seed}");
    }
}

/// Shows M7.
#[test]
fn the_removal_of_a_run_whose_clock_was_ahead_ends_with_it() {
    let agents = with_runs(ModuleId(5), &[LATE, 1_001, 1_002]);
    let problem = drawn(5, 5, Grouping::Singletons, 5);
    let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), 5, agents);
    trial.until(Cluster::has_formed);
    for restart in 0..2 {
        let run = trial.cluster.run_of(ModuleId(5)).unwrap();
        trial.cluster.crash(ModuleId(5));
        trial.run_for(Duration::from_secs(30));
        trial
            .cluster
            .inject(&Message::Removal(Removal::of_body(run)));
        trial.run_for(Duration::from_secs(30));
        trial.cluster.restart(ModuleId(5));
        assert!(
            form_within(&mut trial, &[1, 2, 3, 4, 5], 300),
            "restart {restart}"
        );
    }
}

/// The last member of a majority restarts, once or twice: it counts no more, whatever its clock says.
#[test]
fn a_member_that_a_run_replaces_which_is_earlier_by_its_clock_is_missing() {
    let first = ModuleId(1);
    for runs in [
        &[LATE, LATE + 1, LATE + 2, LATE + 3],
        &[LATE, 1_001, 1_002, 1_003],
    ] {
        let problem = drawn(3, 3, Grouping::Singletons, 1);
        let parameters = ClusterParameters {
            ..ClusterParameters::default()
        };
        let mut trial = Trial::of_agents(&problem, parameters, 1, with_runs(first, runs));
        trial.until(Cluster::has_formed);
        trial.cluster.crash(ModuleId(2));
        trial.run_for(Duration::from_secs(60));
        trial.cluster.crash(first);
        trial.run_for(Duration::from_secs(30));
        trial.cluster.restart(first);
        trial.run_for(Duration::from_secs(120));
        for _ in 0..2 {
            let waiting = trial.in_phase(ModulePhase::WaitingForQuorum);
            assert_eq!(waiting, [first, ModuleId(3)], "{runs:?}");
            trial.cluster.crash(first);
            trial.run_for(Duration::from_secs(10));
            trial.cluster.restart(first);
            trial.run_for(Duration::from_secs(120));
        }
    }
}

/// A module that was cut off knows a former run of another, which is the later one by its clock: what it reports of that takes
/// no spot from the body of the present run.
#[test]
fn a_module_that_was_cut_off_takes_no_body_from_a_run_that_is_earlier_by_its_clock() {
    let third = ModuleId(3);
    let until_it_is_admitted = Duration::from_secs(22);
    for runs in [&[LATE, 1_001][..], &[LATE, 1_002, 1_001]] {
        let mut moved = 0;
        for seed in 0..12 {
            let problem = drawn(6, 5, Grouping::Singletons, seed);
            let agents = with_runs(third, runs);
            let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), seed, agents);
            for _ in &runs[2..] {
                trial.run_for(Duration::from_millis(700));
                trial.cluster.crash(third);
                trial.run_for(until_it_is_admitted);
                trial.cluster.restart(third);
            }
            trial.run_for(Duration::from_millis(700));
            trial.cluster.crash(third);
            trial.cluster.cut(&ids(&[5]));
            trial.run_for(until_it_is_admitted);
            moved += usize::from(restart_for(&mut trial, 300));
            trial.run_for(Duration::from_secs(1));
            trial.cluster.heal();
            trial.run_for(Duration::from_secs(180));
            assert!(nearest(&trial, third) > 0.9, "{runs:?}, seed {seed}");
        }
        assert!(moved > 2, "{runs:?}: {moved}");
    }
}

/// All others restart after a clock was set back, so that they know only by reports what the second run replaced: the body of a
/// third one, which they see themselves, counts.
#[test]
fn modules_that_restarted_know_the_body_of_a_run_after_a_clock_was_set_back() {
    let third = ModuleId(3);
    let mut moved = 0;
    for seed in 0..8 {
        let problem = drawn_beside(8, 7, Grouping::Singletons, seed);
        let agents = with_runs(third, &[LATE, 1_001, 1_002]);
        let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), seed, agents);
        trial
            .cluster
            .start_late(ModuleId(8), Duration::from_secs(900));
        trial.run_for(Duration::from_millis(700));
        trial.cluster.crash(third);
        trial.run_for(Duration::from_secs(22));
        trial.cluster.restart(third);
        trial.run_for(Duration::from_secs(1));
        trial.cluster.crash(third);
        trial.run_for(Duration::from_secs(40));
        for module in [1, 2, 4, 5, 6, 7].map(ModuleId) {
            trial.cluster.crash(module);
            trial.run_for(Duration::from_secs(10));
            trial.cluster.restart(module);
            trial.run_for(Duration::from_secs(40));
        }
        moved += usize::from(restart_for(&mut trial, 400));
        trial.run_for(Duration::from_secs(500));
        assert!(nearest(&trial, third) > 0.9, "seed {seed}");
    }
    assert!(moved > 2, "{moved}");
}

/// All restart at once, the others from stores that hold a former run of one whose clock was set back.
#[test]
fn what_stores_hold_of_a_run_whose_clock_was_ahead_takes_no_spot_from_a_later_one() {
    let third = ModuleId(3);
    let mut moved = 0;
    for seed in 0..8 {
        let agents = with_runs(third, &[LATE, 1_001]);
        let problem = drawn_beside(6, 5, Grouping::Singletons, seed);
        let parameters = ClusterParameters {
            stores: Stores::All,
            ..ClusterParameters::default()
        };
        let mut trial = Trial::of_agents(&problem, parameters, seed, agents);
        trial.cluster.take_store(third);
        trial
            .cluster
            .start_late(ModuleId(6), Duration::from_secs(500));
        trial.run_for(Duration::from_secs(1));
        trial.cluster.crash(third);
        trial.run_for(Duration::from_secs(60));
        for module in [1, 2, 4, 5].map(ModuleId) {
            trial.cluster.crash(module);
            trial.cluster.restart(module);
        }
        moved += usize::from(restart_for(&mut trial, 300));
        trial.run_for(Duration::from_secs(400));
        assert!(nearest(&trial, third) > 0.9, "seed {seed}");
    }
    assert!(moved > 2, "{moved}");
}

/// Only the fifth module knows the former run of the third, which moves in a run that is earlier by its clock. They come
/// together, and the third ends `wait` later; `severed` links carry nothing from then on.
fn end_after(wait: Duration, severed: &BTreeSet<(ModuleId, ModuleId)>) {
    let third = ModuleId(3);
    let mut moved = 0;
    for seed in 0..12 {
        let problem = drawn_beside(6, 5, Grouping::Singletons, seed);
        let agents = with_runs(third, &[LATE, 1_001]);
        let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), seed, agents);
        trial
            .cluster
            .start_late(ModuleId(6), Duration::from_secs(200));
        trial.cluster.sever(&between(&[&[3, 5], &[1, 2, 4, 6]]));
        trial.run_for(Duration::from_millis(1_500));
        trial.cluster.crash(third);
        let before = trial.cluster.body(third).unwrap();
        trial.cluster.sever(&between(&[&[1, 2, 3, 4, 6], &[5]]));
        trial.run_for(Duration::from_secs(1));
        trial.cluster.restart(third);
        trial.run_for(Duration::from_secs(190));
        let after = trial.cluster.body(third).unwrap();
        moved += usize::from(after.distance_to(&before).to_units() > 0.9);
        trial.cluster.sever(severed);
        trial.run_for(wait);
        trial.cluster.crash(third);
        trial.run_for(Duration::from_secs(250));
        assert!(nearest(&trial, third) > 0.9, "{wait:?}, seed {seed}");
    }
    assert!(moved > 6, "{moved}");
}

#[test]
fn a_run_that_ends_when_others_learn_of_it_keeps_its_spot() {
    for seconds in [1, 3, 6, 20] {
        end_after(Duration::from_secs(seconds), &BTreeSet::new());
    }
    end_after(
        Duration::from_secs(100),
        &[(ModuleId(5), ModuleId(3))].into(),
    );
}

/// Five modules have formed without stores, and a stranger names later runs of all of them.
#[test]
fn what_a_stranger_says_of_later_runs_costs_no_memory() {
    for seed in 0..3 {
        for in_roster in [false, true] {
            let problem = drawn(5, 5, Grouping::Singletons, seed);
            let mut trial = Trial::new(&problem, seed);
            trial.until(Cluster::has_formed);
            let stranger = ModuleId(99).run(Incarnation(5));
            let last = trial.rosters.last().unwrap().clone();
            let message = if in_roster {
                let epoch = Epoch {
                    number: last.epoch.number + 3,
                    convener: stranger.module,
                };
                let mut members = last.members.clone();
                for member in &mut members {
                    member.incarnation = Incarnation(LATE);
                }
                trial.cluster.forge_heartbeat(stranger, 1, Some(epoch));
                let roster = ClosedRoster::from(Roster {
                    epoch,
                    target: last.target.clone(),
                    members,
                    voters: Voters::default(),
                    timing: last.timing,
                    bodies: Vec::new(),
                });
                Message::Roster(RosterMessage::Plan(Arc::new(roster)))
            } else {
                let elsewhere = |module: u32| BodyReport {
                    module: ModuleId(module),
                    incarnation: Incarnation(LATE),
                    epoch: None,
                    sequence: 0,
                    whereabouts: Whereabouts::Seen(
                        Pose::from_units(600.0, f64::from(module), 0.0).unwrap(),
                    ),
                };
                let pose = Pose::from_units(500.0, 500.0, 0.0).unwrap();
                Message::ModuleState(Arc::new(ModuleState {
                    sequence: 1,
                    bodies: (1..=5).map(elsewhere).collect(),
                    ..ModuleState::standing(stranger, pose)
                }))
            };
            trial.cluster.inject(&message);
            trial.run_for(Duration::from_secs(200));
            let together = hold_a_plan(&trial.cluster, &ids(&[1, 2, 3, 4, 5]));
            assert!(together, "seed {seed}, in a roster: {in_roster}");
        }
    }
}

/// Two runs of the third module learn of the same former one, on two sides of a cut, and the first of them is in a majority.
#[test]
fn a_later_run_does_not_count_as_one_that_learned_of_the_same_former_run() {
    let third = ModuleId(3);
    for seed in 0..6 {
        let problem = drawn(5, 5, Grouping::Singletons, seed);
        let parameters = ClusterParameters {
            stores: Stores::All,
            ..ClusterParameters::default()
        };
        let agents = with_runs(third, &[LATE, 1_001, 1_002]);
        let mut trial = Trial::of_agents(&problem, parameters, seed, agents);
        trial.cluster.take_store(third);
        trial.until(Cluster::has_formed);
        trial.cluster.crash(third);
        trial.cluster.sever(&between(&[&[1, 2, 3, 4], &[5]]));
        trial.run_for(Duration::from_secs(25));
        trial.cluster.restart(third);
        trial.run_for(Duration::from_secs(90));
        let second_run = trial.cluster.run_of(third).unwrap();
        trial.cluster.sever(&between(&[&[1, 3], &[2, 4], &[5]]));
        trial.run_for(Duration::from_secs(60));
        trial.cluster.crash(third);
        trial.cluster.sever(&between(&[&[1], &[2, 4], &[3, 5]]));
        trial.run_for(Duration::from_secs(25));
        trial.cluster.restart(third);
        trial.run_for(Duration::from_secs(30));
        let third_run = trial.cluster.run_of(third).unwrap();
        assert!(second_run.incarnation > Incarnation(LATE), "{second_run:?}");
        assert!(third_run.incarnation > Incarnation(LATE), "{third_run:?}");
        for module in [2, 4].map(ModuleId) {
            trial.cluster.crash(module);
            trial.cluster.restart(module);
        }
        trial.run_for(Duration::from_secs(1));
        trial.cluster.sever(&between(&[&[1], &[2, 3, 4, 5]]));
        for _ in 0..120 {
            trial.run_for(Duration::from_secs(1));
            let both = hold_a_plan(&trial.cluster, &ids(&[1]))
                && hold_a_plan(&trial.cluster, &ids(&[2, 3, 4, 5]));
            assert!(!both, "seed {seed}");
        }
    }
}
