//! The verdicts of observers on whole runs: late ones, distant ones, and ones that miss messages.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use formation_generate::{GeneratorParameters, Grouping, Random, generate_apart};
use formation_model::{Message, ModuleId, PlanningProblem, Scenario, TargetAnnouncement};
use formation_planner as planner;
use formation_protocol::{Agent, Mutation};
use formation_sim::{AgentFactory, Cluster, ClusterParameters, NetworkParameters, Observation};
use formation_verify::{Observer, ObserverParameters, Outcome, Verdict, Violation};

fn problem(modules: usize, spots: usize, seed: u64) -> PlanningProblem {
    problem_of(modules, spots, Grouping::Mixed, seed)
}

fn problem_of(modules: usize, spots: usize, grouping: Grouping, seed: u64) -> PlanningProblem {
    let parameters = GeneratorParameters::new(modules, spots, seed).grouped(grouping);
    let raw = generate_apart(&parameters).unwrap();
    Scenario::try_from(raw).unwrap().problem().clone()
}

fn announcement(problem: &PlanningProblem) -> TargetAnnouncement {
    TargetAnnouncement {
        revision: 1,
        name: "observed".to_owned(),
        target: Some(Arc::clone(problem.target())),
        parameters: *problem.parameters(),
        expected_modules: u32::try_from(problem.modules().len()).ok(),
        voters: Vec::new(),
    }
}

/// Everything that was published in a run, from the target on.
fn published(problem: &PlanningProblem, network: NetworkParameters, seed: u64) -> Vec<Message> {
    let parameters = ClusterParameters {
        network,
        ..ClusterParameters::default()
    };
    let mut cluster = Cluster::new(problem, parameters, seed);
    cluster.announce(announcement(problem));
    assert!(cluster.run_until(Duration::from_secs(600), Cluster::has_formed));
    // Heartbeats and the last links follow.
    let end = cluster.now() + Duration::from_secs(3);
    cluster.run_until(end, |_| false);
    let mut messages = vec![Message::Target(Arc::new(announcement(problem)))];
    messages.extend(received(&mut cluster));
    messages
}

/// The messages of a run along paths, as an observer receives them whose clock is as exact as that of the senders.
fn judge_paths(
    agents: AgentFactory,
    problem: &PlanningProblem,
    seed: u64,
    disturb: impl FnOnce(&mut Cluster),
) -> Verdict {
    let mut cluster = Cluster::of_agents(problem, ClusterParameters::default(), seed, agents);
    cluster.announce(announcement(problem));
    disturb(&mut cluster);
    cluster.run_until(Duration::from_secs(300), Cluster::has_formed);
    let end = cluster.now() + Duration::from_secs(3);
    cluster.run_until(end, |_| false);
    let mut observer = Observer::new(ObserverParameters {
        clock_error: Duration::from_millis(1),
        silence: Duration::MAX,
        ..ObserverParameters::default()
    });
    observer.handle(
        Duration::ZERO,
        &Message::Target(Arc::new(announcement(problem))),
    );
    for message in received(&mut cluster) {
        observer.handle(Duration::ZERO, &message);
    }
    let mut now = Duration::ZERO;
    loop {
        if let Some(verdict) = observer.verdict(now) {
            return verdict.clone();
        }
        now = observer.poll_timeout().unwrap();
    }
}

#[test]
fn bodies_are_judged_by_what_modules_publish() {
    for seed in 0..24 {
        let problem = problem(18, 18, seed);
        let verdict = judge_paths(AgentFactory::default(), &problem, seed, |_| {});
        assert_formed(&verdict, &problem, seed);
        assert_eq!(verdict.collision_risk, None, "seed {seed}");
        assert_eq!(verdict.counts.missed_states, 0, "seed {seed}");
        assert!(verdict.counts.segments > 18 * 4, "seed {seed}");
    }
}

fn after(cluster: &mut Cluster, millis: u64) {
    let end = cluster.now() + Duration::from_millis(millis);
    cluster.run_until(end, |_| false);
}

#[test]
fn faults_on_the_way_are_no_breaches() {
    for seed in 0..32 {
        let problem = problem(14, 14, seed);
        let verdict = judge_paths(AgentFactory::default(), &problem, seed, |cluster| {
            let moving = |cluster: &Cluster| {
                let mut running = cluster.running().into_iter();
                running.find(|&module| cluster.is_moving(module))
            };
            let limit = Duration::from_secs(100);
            assert!(cluster.run_until(limit, |cluster| moving(cluster).is_some()));
            after(cluster, 150 + 97 * (seed / 4));
            let Some(module) = moving(cluster) else {
                return;
            };
            match seed % 4 {
                0 => {
                    let aside = cluster.running().into_iter().take(5).collect();
                    cluster.cut(&aside);
                    after(cluster, 9_000);
                    cluster.heal();
                }
                1 => cluster.pause(module, Duration::from_secs(4)),
                2 => {
                    cluster.crash(module);
                    after(cluster, 2_000);
                    cluster.remove(module);
                }
                _ => {
                    cluster.crash(module);
                    after(cluster, 1_000);
                    cluster.restart(module);
                }
            }
        });
        let is_breach = |violation: &&Violation| {
            matches!(
                violation,
                Violation::BodiesOverlap { .. }
                    | Violation::WaitNotKept { .. }
                    | Violation::BlockTorn { .. }
            )
        };
        let breaches: Vec<&Violation> = verdict.violations.iter().filter(is_breach).collect();
        assert!(breaches.is_empty(), "seed {seed}: {breaches:?}");
        assert!(verdict.counts.segments > 14, "seed {seed}");
    }
}

#[test]
fn modules_that_do_not_wait_are_found_by_what_they_publish() {
    let agents = AgentFactory::new(|identity, parameters, now| {
        Agent::new(identity, parameters, now).mutated(Mutation::SkipWaits)
    });
    let (mut early, mut met) = (0, 0);
    for seed in 0..20 {
        let verdict = judge_paths(agents.clone(), &problem(18, 18, seed), seed, |_| {});
        let mut violations = verdict.violations.iter();
        early += u32::from(violations.any(|one| matches!(one, Violation::WaitNotKept { .. })));
        met += u32::from(verdict.collision_risk.is_some());
    }
    println!("waits {early}, overlaps {met} of 20 runs");
    assert!(
        early >= 18 && met >= 12,
        "waits {early}, overlaps {met} of 20 runs"
    );
}

fn received(cluster: &mut Cluster) -> impl Iterator<Item = Message> {
    let observations = cluster.take_observations().into_iter();
    observations.filter_map(|(_, observation)| match observation {
        Observation::Published(_, message) => Some(message),
        _ => None,
    })
}

/// The verdict once every wait is over. All messages come in the first instant, so that no silence counts.
fn judge(messages: &[Message]) -> Verdict {
    let mut observer = Observer::new(ObserverParameters {
        silence: Duration::MAX,
        ..ObserverParameters::default()
    });
    for message in messages {
        observer.handle(Duration::ZERO, message);
    }
    observer.verdict(Duration::ZERO);
    let due = observer.poll_timeout().unwrap_or_default();
    observer.verdict(due).unwrap().clone()
}

#[track_caller]
fn assert_formed(verdict: &Verdict, problem: &PlanningProblem, seed: u64) {
    let is_short = problem.modules().len() < problem.target().spots().len();
    let expected = if is_short {
        Outcome::Partial
    } else {
        Outcome::Complete
    };
    assert_eq!(
        (verdict.outcome, &verdict.violations, &verdict.missing),
        (expected, &Vec::new(), &Vec::new()),
        "seed {seed}"
    );
    let offline = planner::plan(Arc::new(problem.clone())).plan;
    assert_eq!(verdict.assignments, offline.assignments, "seed {seed}");
}

/// Shows X2, X11.
#[test]
fn whole_runs_are_complete_or_partial() {
    for seed in 0..12 {
        for (modules, spots) in [(9, 9), (12, 7), (7, 12)] {
            let problem = problem(modules, spots, seed);
            let network = if seed % 2 == 0 {
                NetworkParameters::default()
            } else {
                NetworkParameters::rough()
            };
            let messages = published(&problem, network, seed);
            assert_formed(&judge(&messages), &problem, seed);
        }
    }
}

#[test]
fn an_observer_that_comes_late_receives_enough() {
    for seed in 0..12 {
        let problem = problem(10, 10, seed);
        let messages = published(&problem, NetworkParameters::default(), seed);
        // What is latched: the last state of each module, the last roster, all claims; and the heartbeats to come.
        let mut states: BTreeMap<ModuleId, Message> = BTreeMap::new();
        let mut heartbeats: BTreeMap<ModuleId, Message> = BTreeMap::new();
        let mut latched = Vec::new();
        for message in messages {
            match &message {
                Message::ModuleState(state) => {
                    states.insert(state.module, message);
                }
                Message::Heartbeat(heartbeat) => {
                    heartbeats.insert(heartbeat.module, message);
                }
                _ => latched.push(message),
            }
        }
        latched.extend(states.into_values());
        latched.extend(heartbeats.into_values());
        assert_formed(&judge(&latched), &problem, seed);
    }
}

/// Shows X5.
#[test]
fn an_observer_may_miss_half_of_it_and_receive_the_rest_in_any_order() {
    for seed in 0..12 {
        let problem = problem(10, 10, seed);
        let mut messages = published(&problem, NetworkParameters::default(), seed);
        let mut random = Random::from_seed(seed);
        let mut last_state: BTreeMap<ModuleId, u64> = BTreeMap::new();
        for message in &messages {
            if let Message::ModuleState(state) = message {
                last_state.insert(state.module, state.sequence);
            }
        }
        messages.retain(|message| match message {
            // The last state is latched; any heartbeat after the agreement shows it.
            Message::ModuleState(state) => {
                last_state.get(&state.module) == Some(&state.sequence) || random.below(2) == 0
            }
            Message::Heartbeat(_) => random.below(2) == 0,
            _ => true,
        });
        random.shuffle(&mut messages);
        assert_formed(&judge(&messages), &problem, seed);
    }
}

/// A module dies at any time: before the others move, on the way, or after all have settled. Its body stays, or is removed. The
/// observer reviews its verdict every second.
/// Shows X5.
#[test]
fn one_death_is_no_broken_promise() {
    let mut failed = Vec::new();
    for seed in 0..60 {
        let problem = problem_of(12, 10, Grouping::Singletons, seed);
        let mut random = Random::from_seed(seed);
        let mut cluster = Cluster::new(&problem, ClusterParameters::default(), seed);
        cluster.announce(announcement(&problem));
        if seed % 2 == 0 {
            assert!(cluster.run_until(Duration::from_secs(600), Cluster::has_formed));
        } else {
            after(&mut cluster, 4_000 + random.below(6_000));
        }
        let modules: Vec<ModuleId> = cluster.running().into_iter().collect();
        let module = modules[random.index(modules.len())];
        cluster.crash(module);
        if seed % 4 >= 2 {
            after(&mut cluster, 1_000);
            cluster.remove(module);
        }
        after(&mut cluster, 10_000);
        cluster.run_until(Duration::from_secs(600), Cluster::has_formed);
        after(&mut cluster, 5_000);
        let mut observer = Observer::new(ObserverParameters::default());
        let target = Message::Target(Arc::new(announcement(&problem)));
        observer.handle(Duration::ZERO, &target);
        let mut reviewed = Duration::ZERO;
        let mut verdicts = Vec::new();
        for (at, observation) in cluster.take_observations() {
            while reviewed + Duration::from_secs(1) < at {
                reviewed += Duration::from_secs(1);
                verdicts.extend(observer.review(reviewed).cloned());
            }
            if let Observation::Published(_, message) = observation {
                observer.handle(at, &message);
            }
        }
        let is_wrong = |verdict: &&Verdict| !verdict.violations.is_empty();
        let wrong = verdicts.iter().find(is_wrong).cloned();
        let last = verdicts.pop();
        let last = last.filter(|verdict| verdict.outcome == Outcome::Failed);
        if let Some(verdict) = wrong.or(last) {
            failed.push((seed, verdict.violations, verdict.missing));
        }
    }
    assert!(failed.is_empty(), "{} of 60: {failed:#?}", failed.len());
}
