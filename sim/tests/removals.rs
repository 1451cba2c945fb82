//! Reports that a body was taken away: proposals, which take effect in a roster that lists them.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use crate::same_numbers::{LATE, with_runs};
use crate::support::{Trial, drawn, drawn_beside, hold_a_plan, ids, newest_epoch, settled, spots};
use formation_generate::Grouping;
use formation_model::{
    BodyReport, ClosedRoster, Epoch, Incarnation, Message, ModuleId, ModulePhase, ModuleState,
    Removal, Roster, RosterMessage, SpotId, Whereabouts,
};
use formation_protocol::{Agent, Event, Mutation, Refusal};
use formation_sim::{AgentFactory, Cluster, ClusterParameters, Stores};

/// Forms five spots with one spare.
fn formed(seed: u64, agents: AgentFactory) -> Trial {
    let problem = drawn(6, 5, Grouping::Singletons, seed);
    let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), seed, agents);
    trial.until(Cluster::has_formed);
    trial
}

fn sound(seed: u64) -> Trial {
    formed(seed, AgentFactory::default())
}

/// A settled module that is not the first.
fn settled_one(trial: &Trial) -> (ModuleId, SpotId) {
    trial.settled()[1]
}

/// The report that the body of the present run of a module was taken away.
fn removal(trial: &Trial, module: ModuleId) -> Message {
    Message::Removal(Removal::of_body(trial.cluster.run_of(module).unwrap()))
}

fn others(trial: &Trial, than: &[ModuleId]) -> Vec<ModuleId> {
    let running = trial.cluster.running().into_iter();
    running.filter(|module| !than.contains(module)).collect()
}

fn stands_alone(trial: &Trial, module: ModuleId) -> bool {
    let here = trial.cluster.body(module).unwrap();
    let all = trial.cluster.modules().into_iter();
    let bodies = all.filter(|&other| other != module);
    let mut bodies = bodies.filter_map(|other| trial.cluster.body(other));
    bodies.all(|body| body.distance_to(&here).to_units() >= 0.5)
}

/// The end of what happened.
fn story(trial: &Trial) -> String {
    let transcript = trial.cluster.transcript().to_string();
    let lines: Vec<&str> = transcript.lines().collect();
    lines[lines.len().saturating_sub(80)..].join("\n")
}

fn noted(trial: &Trial, by: ModuleId, is_it: impl Fn(&Event) -> bool) -> bool {
    trial
        .noted
        .iter()
        .any(|(one, event)| *one == by && is_it(event))
}

/// Shows B5.
#[test]
fn a_report_that_names_a_settled_living_module_moves_nobody() {
    for seed in 0..6 {
        let mut trial = sound(seed);
        let before = (trial.newest_epoch(), trial.settled());
        let (named, spot) = settled_one(&trial);
        let report = removal(&trial, named);
        trial.cluster.inject(&report);
        trial.run_for(Duration::from_secs(60));
        assert_eq!(
            (trial.newest_epoch(), trial.settled()),
            before,
            "seed {seed}"
        );
        for other in others(&trial, &[named]) {
            let is_dropped = |event: &Event| *event == Event::RemovalRefuted(named);
            assert!(noted(&trial, other, is_dropped), "seed {seed}, {other}");
        }
        // The report says nothing about a death after it.
        trial.cluster.crash(named);
        trial.until_formed_again();
        assert!(!spots(&trial.settled()).contains(&spot), "seed {seed}");
        let before = trial.newest_epoch();
        trial.cluster.remove(named);
        trial.until_formed_after(before);
        assert!(spots(&trial.settled()).contains(&spot), "seed {seed}");
    }
}

/// Shows B5.
#[test]
fn a_blind_flood_drops_no_module_opens_no_epoch_and_is_counted() {
    let mut trial = sound(1);
    let before = (trial.newest_epoch(), trial.settled());
    for module in 1..=10_000 {
        for run in 1..=3 {
            // The first run of each module in the simulator; of those that there are, it is the present one.
            let message =
                Message::Removal(Removal::of_body(ModuleId(module).run(Incarnation(run))));
            trial.cluster.inject(&message);
        }
    }
    trial.run_for(Duration::from_secs(120));
    assert_eq!((trial.newest_epoch(), trial.settled()), before);
    let agent = trial.cluster.agent(ModuleId(1)).unwrap();
    let refused = agent.refusals().of(Refusal::RemovalOfUnknownRun);
    assert_eq!(refused, 30_000 - 5);
    let (lost, spot) = settled_one(&trial);
    trial.cluster.crash(lost);
    trial.until_formed_again();
    assert!(!spots(&trial.settled()).contains(&spot));
}

/// The attack is real: agents that believe a report drive onto a living module.
/// Shows B5.
#[test]
fn agents_that_trust_reports_drive_onto_a_living_module() {
    let agents = AgentFactory::new(|identity, parameters, now| {
        Agent::new(identity, parameters, now).mutated(Mutation::TrustRemovals)
    });
    for seed in 0..3 {
        let mut trial = formed(seed, agents.clone());
        let (named, _) = settled_one(&trial);
        let report = removal(&trial, named);
        for other in others(&trial, &[named]) {
            trial.cluster.tell(other, &report);
        }
        trial.run_for(Duration::from_secs(60));
        assert!(!stands_alone(&trial, named), "seed {seed}");
    }
}

/// A report that names a run which never was, or a former one.
/// Shows B5.
#[test]
fn a_report_of_another_run_than_the_known_one_is_refused() {
    let mut trial = sound(3);
    let (lost, spot) = settled_one(&trial);
    trial.cluster.crash(lost);
    trial.until_formed_again();
    let before = trial.newest_epoch();
    for run in [0, 2, 1 << 51] {
        trial.cluster.inject(&Message::Removal(Removal::of_body(
            lost.run(Incarnation(run)),
        )));
    }
    trial.run_for(Duration::from_secs(60));
    assert_eq!(trial.newest_epoch(), before);
    trial.cluster.restart(lost);
    trial.until(|cluster| cluster.has_formed() && newest_epoch(cluster) > before);
    assert_eq!(trial.spot_of(lost), Some(spot));
}

/// The others have dropped the report. The spare starts while the module is silent, and receives the latched report.
/// Shows B5.
#[test]
fn a_late_module_that_receives_a_dropped_report_has_no_effect() {
    for seed in 0..6 {
        let mut trial = Trial::new(&drawn_beside(6, 5, Grouping::Singletons, seed), seed);
        let late = ModuleId(6);
        trial.cluster.start_late(late, Duration::from_secs(120));
        trial.run_for(Duration::from_secs(80));
        let (named, spot) = settled_one(&trial);
        let report = removal(&trial, named);
        trial.cluster.inject(&report);
        trial.run_for(Duration::from_secs(38));
        assert_eq!(trial.spot_of(named), Some(spot), "seed {seed}");
        trial.cluster.pause(named, Duration::from_secs(60));
        trial.run_for(Duration::from_secs(4));
        trial.cluster.tell(late, &report);
        trial.run_for(Duration::from_secs(3));
        // By now it has received the states of the others.
        trial.cluster.tell(late, &report);
        trial.run_for(Duration::from_secs(50));
        assert!(stands_alone(&trial, named), "seed {seed}");
        let before = trial.convened.len();
        trial.until(|cluster| cluster.has_formed() && cluster.running().len() == 6);
        trial.run_for(Duration::from_secs(120));
        assert!(trial.convened.len() <= before + 2, "seed {seed}");
        assert_eq!(trial.spot_of(named), Some(spot), "seed {seed}");
        assert!(stands_alone(&trial, named), "seed {seed}");
    }
}

/// Only one member receives the module, and knows of no report.
/// Shows B5.
#[test]
fn a_member_that_hears_the_run_refuses_the_roster_by_name() {
    for seed in 0..6 {
        let mut trial = sound(seed);
        let (named, _) = settled_one(&trial);
        let hears = *others(&trial, &[named]).last().unwrap();
        let deaf = others(&trial, &[named, hears]);
        let report = removal(&trial, named);
        let links = deaf.iter().map(|&other| (named, other));
        trial.cluster.sever(&links.collect());
        trial.run_for(Duration::from_secs(1));
        for &other in &deaf {
            trial.cluster.tell(other, &report);
        }
        trial.run_for(Duration::from_secs(120));
        let refuses = |event: &Event| matches!(event, Event::RemovalsHeard { modules, .. } if modules == &[named]);
        assert!(noted(&trial, hears, refuses), "seed {seed}");
        assert!(stands_alone(&trial, named), "seed {seed}");
        let is_dropped = |event: &Event| *event == Event::RemovalOverruled(named);
        assert!(noted(&trial, deaf[0], is_dropped), "seed {seed}");
        // Who repeats the report halts the others rarely.
        let before = trial.convened.len();
        for _ in 0..300 {
            for &other in &deaf {
                trial.cluster.tell(other, &report);
            }
            trial.run_for(Duration::from_secs(1));
        }
        assert!(stands_alone(&trial, named), "seed {seed}");
        let opened = trial.convened.len() - before;
        assert!(opened <= 40, "seed {seed}: {opened} epochs");
        trial.cluster.heal();
        trial.until(|cluster| cluster.has_formed() && spots(&settled(cluster)).len() == 5);
    }
}

/// The spare starts just before the roster that is the first to list the removal.
/// Shows B5.
#[test]
fn a_member_that_has_listened_for_less_refuses_the_roster_by_name() {
    for seed in 0..6 {
        let mut trial = Trial::new(&drawn_beside(6, 5, Grouping::Singletons, seed), seed);
        let young = ModuleId(6);
        trial.cluster.start_late(young, Duration::from_secs(120));
        trial.run_for(Duration::from_secs(116));
        let (lost, spot) = settled_one(&trial);
        trial.cluster.crash(lost);
        trial.run_for(Duration::from_secs(1));
        trial.cluster.remove(lost);
        trial.until(|cluster| {
            let settled = settled(cluster);
            settled.len() == 5 && cluster.has_formed()
        });
        let refuses = |event: &Event| matches!(event, Event::RemovalsEarly { modules, .. } if modules == &[lost]);
        assert!(
            noted(&trial, young, refuses),
            "seed {seed}:\n{}",
            story(&trial)
        );
        assert!(spots(&trial.settled()).contains(&spot), "seed {seed}");
        // It tried again in bounded time.
        let after = trial.cluster.now().saturating_sub(Duration::from_secs(120));
        assert!(after < Duration::from_secs(60), "seed {seed}: {after:?}");
    }
}

/// Nobody hears a module that is cut off, so a false report is believed. When it is heard again, the removal is over.
/// Shows B5.
#[test]
fn a_run_that_was_falsely_reported_as_removed_takes_part_once_it_is_heard() {
    for seed in 0..6 {
        let mut trial = sound(seed);
        let (lost, spot) = settled_one(&trial);
        let report = removal(&trial, lost);
        trial.cluster.cut(&[lost].into());
        trial.run_for(Duration::from_secs(1));
        trial.cluster.inject(&report);
        let rest: BTreeSet<ModuleId> = others(&trial, &[lost]).into_iter().collect();
        let is_taken = |&(module, filled): &(ModuleId, SpotId)| module != lost && filled == spot;
        trial.until(|cluster| hold_a_plan(cluster, &rest) && settled(cluster).iter().any(is_taken));
        trial.cluster.heal();
        trial.run_for(Duration::from_secs(60));
        let settled = trial.settled();
        assert_eq!(spots(&settled).len(), 5, "seed {seed}: {settled:?}");
        for &one in &rest {
            let is_over = |event: &Event| *event == Event::RemovalRefuted(lost);
            assert!(noted(&trial, one, is_over), "seed {seed}");
        }
        // The plans that follow know both bodies.
        let (next, _) = trial.settled()[2];
        trial.cluster.crash(next);
        trial.until(|cluster| {
            let mut running = cluster.running();
            running.remove(&lost);
            hold_a_plan(cluster, &running)
        });
        trial.cluster.restart(next);
        trial.until(Cluster::has_formed);
    }
}

/// Whoever it lists, or does not list, goes on when the stranger is found to be alone.
/// Shows B5.
#[test]
fn a_roster_of_a_stranger_that_lists_the_living_as_removed_drops_nobody() {
    for seed in 0..3 {
        let mut trial = sound(seed);
        let before = trial.newest_epoch();
        let stranger = ModuleId(9_000);
        let last = trial.rosters.last().unwrap().clone();
        let epoch = Epoch {
            number: before + 2,
            convener: stranger,
        };
        let gone = |module: ModuleId| BodyReport {
            module,
            incarnation: trial.cluster.run_of(module).unwrap().incarnation,
            epoch: Some(epoch),
            sequence: 0,
            whereabouts: Whereabouts::Removed,
        };
        let roster = Roster {
            epoch,
            target: last.target.clone(),
            members: Vec::new(),
            voters: last.voters.clone(),
            timing: last.timing,
            bodies: trial.cluster.running().into_iter().map(gone).collect(),
        };
        let run = stranger.run(Incarnation(1));
        trial.cluster.forge_heartbeat(run, 1, None);
        let roster = RosterMessage::Plan(Arc::new(ClosedRoster::from(roster)));
        trial.cluster.inject(&Message::Roster(roster));
        trial.run_for(Duration::from_secs(60));
        let all = ids(&[1, 2, 3, 4, 5, 6]);
        trial.until(|cluster| hold_a_plan(cluster, &all));
        assert_eq!(spots(&trial.settled()).len(), 5, "seed {seed}");
    }
}

/// The removed module is back in a run that is earlier by its clock, and the convener receives nothing of it.
/// Shows B5.
#[test]
fn a_removal_that_only_the_convener_believes_keeps_the_others_from_nothing() {
    for seed in 0..8 {
        let lost = ModuleId(3);
        let mut trial = formed(seed, with_runs(lost, &[LATE, 1_001]));
        trial.until_formed_without(&[lost]);
        trial.cluster.sever(&[(lost, ModuleId(1))].into());
        trial.cluster.restart(lost);
        // Until what the silent run claimed keeps no other out.
        trial.run_for(Duration::from_secs(40));
        let rest = ids(&[1, 2, 4, 5, 6]);
        let (next, _) = trial
            .settled()
            .into_iter()
            .rfind(|(module, _)| *module != lost)
            .unwrap();
        trial.cluster.crash(next);
        trial.cluster.restart(next);
        trial.run_for(Duration::from_secs(1));
        trial.until(|cluster| hold_a_plan(cluster, &rest));
        trial.cluster.heal();
        trial.until(|cluster| cluster.has_formed() && spots(&settled(cluster)).len() == 5);
    }
}

/// The store of the sixth module was written before all had agreed on the second roster, which makes two modules count no more. Its
/// later run is needed for a majority, and has not listened for long when the roster comes that is the first to list a removal.
/// Shows B5.
#[test]
fn a_restarted_member_that_refuses_a_removal_opens_the_next_epoch() {
    for seed in 0..6 {
        let restarted = ModuleId(6);
        let parameters = ClusterParameters {
            stores: Stores::All,
            ..ClusterParameters::default()
        };
        let problem = drawn(11, 8, Grouping::Singletons, seed);
        let mut trial = Trial::with(&problem, parameters, seed);
        trial.until(Cluster::has_formed);
        let lost = [ModuleId(9), ModuleId(11)];
        for module in lost {
            trial.cluster.crash(module);
        }
        trial.until_formed_again();
        trial.cluster.crash(restarted);
        trial.cluster.cut(&ids(&[1, 2, 3]));
        trial.cluster.report_removed(lost[0]);
        // The others of the majority have gathered.
        trial.run_for(Duration::from_secs(12));
        trial.cluster.restart(restarted);
        let majority = ids(&[4, 5, 6, 7, 8, 10]);
        trial.until(|cluster| hold_a_plan(cluster, &majority));
        let refuses = |event: &Event| matches!(event, Event::RemovalsEarly { modules, .. } if modules == &[lost[0]]);
        assert!(noted(&trial, restarted, refuses), "seed {seed}");
    }
}

/// The spot is held, and the removal of the body frees none.
/// Shows B5.
#[test]
fn a_due_removal_of_a_body_on_a_held_spot_gets_a_roster_that_lists_it() {
    for seed in 0..4 {
        let mut trial = sound(seed);
        let (holder, _) = settled_one(&trial);
        let spare = trial.in_phase(ModulePhase::Spare)[0];
        let before = trial.settled();
        trial.cluster.crash(spare);
        trial.until_formed_again();
        // An invented module, which nobody hears again, showed itself on the spot.
        let pose = trial.cluster.body(holder).unwrap();
        let dead = ModuleId(60).run(Incarnation(1));
        let state = ModuleState {
            sequence: 1,
            ..ModuleState::standing(dead, pose)
        };
        trial.cluster.inject(&Message::ModuleState(Arc::new(state)));
        trial.run_for(Duration::from_secs(60));
        let since = trial.rosters.len();
        trial
            .cluster
            .inject(&Message::Removal(Removal::of_body(dead)));
        trial.run_for(Duration::from_secs(60));
        let lists = |roster: &Arc<ClosedRoster>| {
            let mut bodies = roster.bodies.iter();
            bodies.any(|body| body.run() == dead && body.whereabouts == Whereabouts::Removed)
        };
        assert!(trial.rosters[since..].iter().any(lists), "seed {seed}");
        assert_eq!(trial.settled(), before, "seed {seed}");
    }
}
