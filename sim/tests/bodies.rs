//! Bodies of absent modules: no other module drives onto them, and a removal report frees their spots.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;

use crate::support::{Trial, drawn, hold_a_plan, ids, in_phase, spots};
use formation_generate::Grouping;
use formation_model::{BlockedSpot, ModuleId, ModulePhase, SpotId};
use formation_protocol::{Agent, Event, Mutation};
use formation_sim::{AgentFactory, Cluster, ClusterParameters};

/// The blocked spots that were last reported.
fn blocked(trial: &Trial) -> Vec<BlockedSpot> {
    let last = trial.noted.iter().rev().find_map(|(_, event)| match event {
        Event::SpotsBlocked(blocked) => Some(blocked.clone()),
        _ => None,
    });
    last.unwrap_or_default()
}

/// Whether all modules but one have carried out a later plan.
fn others_have_formed(cluster: &Cluster, absent: ModuleId, after: u64) -> bool {
    let mut others = cluster.running();
    others.remove(&absent);
    others.iter().all(|&module| {
        cluster.standing(module).is_some_and(|standing| {
            let is_later = standing.epoch.is_some_and(|epoch| epoch.number > after);
            is_later && matches!(standing.phase, ModulePhase::Settled | ModulePhase::Spare)
        })
    })
}

/// Forms with one spare, cuts a settled module off, and lets the others form again; returns it with its spot.
fn cut_one_off(seed: u64, agents: AgentFactory) -> (Trial, ModuleId, SpotId) {
    let problem = drawn(6, 5, Grouping::Singletons, seed);
    let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), seed, agents);
    trial.until(Cluster::has_formed);
    let settled = trial.settled();
    let (lost, spot) = settled[usize::try_from(seed).unwrap() % settled.len()];
    let before = trial.newest_epoch();
    trial.cluster.cut(&[lost].into());
    trial.until(|cluster| others_have_formed(cluster, lost, before));
    (trial, lost, spot)
}

fn stands_alone(cluster: &Cluster, module: ModuleId) -> bool {
    let here = cluster.body(module).unwrap();
    let others = cluster
        .modules()
        .into_iter()
        .filter(|&other| other != module);
    others
        .filter_map(|other| cluster.body(other))
        .all(|body| body.distance_to(&here).to_units() >= 0.5)
}

/// Shows B1.
#[test]
fn the_spot_of_a_living_module_that_is_cut_off_is_given_to_no_other() {
    for seed in 0..50 {
        let (mut trial, lost, spot) = cut_one_off(seed, AgentFactory::default());
        assert!(stands_alone(&trial.cluster, lost), "seed {seed}");
        assert!(
            blocked(&trial).contains(&BlockedSpot { spot, module: lost }),
            "seed {seed}"
        );
        let named = Event::SpotsBlocked(vec![BlockedSpot { spot, module: lost }]).to_string();
        assert_eq!(named, format!("{spot} is blocked by the body of {lost}"));
        // It comes back to where it stands.
        trial.cluster.heal();
        trial.until(|cluster| hold_a_plan(cluster, &ids(&[1, 2, 3, 4, 5, 6])));
        assert_eq!(trial.spot_of(lost), Some(spot), "seed {seed}");
        assert_eq!(spots(&trial.settled()).len(), 5, "seed {seed}");
    }
}

/// Shows B3.
#[test]
fn agents_that_ignore_bodies_drive_onto_it() {
    let agents = AgentFactory::new(|identity, parameters, now| {
        Agent::new(identity, parameters, now).mutated(Mutation::IgnoreBodies)
    });
    for seed in 0..5 {
        let (trial, lost, _) = cut_one_off(seed, agents.clone());
        assert!(!stands_alone(&trial.cluster, lost), "seed {seed}");
    }
}

/// Shows B5.
#[test]
fn a_spare_takes_the_spot_of_a_dead_module_once_its_body_was_removed() {
    for seed in 0..6 {
        let mut trial = Trial::new(&drawn(6, 5, Grouping::Mixed, seed), seed);
        trial.until(Cluster::has_formed);
        let (lost, spot) = trial.settled()[1];
        trial.cluster.crash(lost);
        trial.until_formed_again();
        assert!(!spots(&trial.settled()).contains(&spot), "seed {seed}");
        let before = trial.newest_epoch();
        trial.cluster.remove(lost);
        trial.until_formed_after(before);
        assert_eq!(spots(&trial.settled()).len(), 5, "seed {seed}");
        // All members remember it, so a later plan does not find the body again.
        let first = *trial.cluster.running().first().unwrap();
        trial.cluster.crash(first);
        trial.until_formed_again();
        let still_blocked = blocked(&trial).iter().any(|blocked| blocked.module == lost);
        assert!(!still_blocked, "seed {seed}");
    }
}

/// Shows B2.
#[test]
fn a_module_that_died_on_its_way_blocks_all_that_it_may_have_reached() {
    for seed in 0..6 {
        let mut trial = Trial::new(&drawn(7, 6, Grouping::Singletons, seed), seed);
        // Modules without a spot may move as well, out of the way of others.
        let heading = |cluster: &Cluster| {
            let moving = in_phase(cluster, ModulePhase::Moving).into_iter();
            let mut heading =
                moving.filter_map(|module| Some((module, cluster.standing(module)?.spot?)));
            heading.next()
        };
        trial.until(|cluster| heading(cluster).is_some());
        let (lost, heads_for) = heading(&trial.cluster).unwrap();
        trial.cluster.crash(lost);
        trial.until_formed_again();
        let named: BTreeSet<SpotId> = blocked(&trial).iter().map(|one| one.spot).collect();
        assert!(named.contains(&heads_for), "seed {seed}");
        assert!(stands_alone(&trial.cluster, lost), "seed {seed}");
        let before = trial.newest_epoch();
        trial.cluster.remove(lost);
        trial.until_formed_after(before);
        assert_eq!(spots(&trial.settled()).len(), 6, "seed {seed}");
    }
}

/// Shows S6.
#[test]
fn a_retired_module_makes_room_for_the_spare_that_takes_its_spot() {
    for seed in 0..6 {
        let mut trial = Trial::new(&drawn(7, 6, Grouping::Mixed, seed), seed);
        trial.until(Cluster::has_formed);
        let (retired, spot) = trial.settled()[1];
        let command = formation_protocol::Command::Retire;
        trial.cluster.command(retired, command);
        trial.until_formed_again();
        assert!(spots(&trial.settled()).contains(&spot), "seed {seed}");
        assert!(stands_alone(&trial.cluster, retired), "seed {seed}");
    }
}
