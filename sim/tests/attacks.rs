//! Attacks on the protocol, step by step: each broke something once.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::time::Duration;

use crate::support::{Stage, drawn, settled, spots};
use formation::generate::Grouping;
use formation::model::{ModuleId, ModulePhase};
use formation::protocol::{Agent, Event, Mutation};
use formation_sim::{
    AgentFactory, CampaignParameters, Cluster, ClusterParameters, FaultKind, ViolationKind,
    run_seed,
};

fn ids(ids: &[u32]) -> BTreeSet<ModuleId> {
    ids.iter().copied().map(ModuleId).collect()
}

fn all() -> BTreeSet<ModuleId> {
    ids(&[1, 2, 3, 4, 5])
}

/// Whether these modules hold one plan that all of them have carried out.
fn hold_a_plan(cluster: &Cluster, modules: &BTreeSet<ModuleId>) -> bool {
    let standings = modules.iter().map(|&module| cluster.standing(module));
    let plans: BTreeSet<_> = standings
        .map(|standing| {
            standing
                .filter(|one| one.phase == ModulePhase::Settled)?
                .digest
        })
        .collect();
    plans.len() == 1 && !plans.contains(&None)
}

/// The third module agrees with the first two, forgets it with its process, and is heard by the other two only: they are
/// three of the five that agreed once, and the first two are a majority of the three that agreed last.
fn third_forgets(agents: &AgentFactory, seed: u64) -> (Stage, usize) {
    let problem = drawn(5, 5, Grouping::Singletons, seed);
    let mut stage = Stage::of_agents(&problem, ClusterParameters::default(), seed, agents.clone());
    stage.until(Cluster::has_formed);
    stage.cluster.cut(&ids(&[4, 5]));
    stage.until(|cluster| {
        hold_a_plan(cluster, &ids(&[1, 2, 3])) && epoch_of(cluster, 3) > epoch_of(cluster, 4)
    });
    stage.run_for(Duration::from_secs(5));
    let before = stage.rosters.len();
    stage.cluster.crash(ModuleId(3));
    stage.cluster.cut(&ids(&[3, 4, 5]));
    stage.cluster.restart(ModuleId(3));
    stage.run_for(Duration::from_secs(60));
    let held_by = |side: &[u32]| usize::from(hold_a_plan(&stage.cluster, &ids(side)));
    let plans = held_by(&[1, 2]) + held_by(&[3, 4, 5]);
    assert!(stage.rosters.len() > before);
    (stage, plans)
}

#[test]
fn whoever_forgot_what_it_agreed_on_makes_no_majority() {
    for seed in 0..6 {
        let (mut stage, plans) = third_forgets(&AgentFactory::default(), seed);
        assert_eq!(plans, 1, "seed {seed}");
        assert!(hold_a_plan(&stage.cluster, &ids(&[1, 2])), "seed {seed}");
        let waiting = stage.count(|event| matches!(event, Event::WaitingForQuorum { .. }));
        assert!(waiting > 0, "seed {seed}");
        stage.cluster.heal();
        stage.until_formed_anew();
        assert_eq!(spots(&stage.settled()).len(), 5, "seed {seed}");
    }
}

/// The attack is one: where modules that forgot count, there are two formations at once.
#[test]
fn two_formations_come_of_counting_whoever_forgot() {
    let agents = AgentFactory::new(|identity, parameters, now| {
        Agent::new(identity, parameters, now).mutated(Mutation::CountForgetful)
    });
    let (_, plans) = third_forgets(&agents, 0);
    assert_eq!(plans, 2);
}

fn epoch_of(cluster: &Cluster, module: u32) -> u64 {
    let standing = cluster.standing(ModuleId(module));
    standing
        .and_then(|one| one.epoch)
        .map_or(0, |epoch| epoch.number)
}

/// Runs for ten minutes with some links severed, and tells how many epochs were opened in the last five of them.
fn epochs_with_severed(links: &BTreeSet<(ModuleId, ModuleId)>, seed: u64) -> (Stage, usize) {
    let mut stage = Stage::new(&drawn(5, 5, Grouping::Singletons, seed), seed);
    stage.cluster.sever(links);
    stage.run_for(Duration::from_secs(300));
    let before = stage.convened.len();
    stage.run_for(Duration::from_secs(300));
    let opened = stage.convened.len() - before;
    (stage, opened)
}

#[test]
fn a_module_that_hears_nothing_does_not_keep_the_others_from_forming() {
    for deaf in [1, 3, 5] {
        let links = all().iter().map(|&other| (other, ModuleId(deaf))).collect();
        let (mut stage, opened) = epochs_with_severed(&links, 7);
        let mut others = all();
        others.remove(&ModuleId(deaf));
        assert!(hold_a_plan(&stage.cluster, &others), "deaf {deaf}");
        assert!(opened <= 1, "deaf {deaf}: {opened} epochs");
        stage.cluster.heal();
        stage.until(|cluster| hold_a_plan(cluster, &all()));
    }
}

#[test]
fn a_module_that_nobody_hears_does_not_keep_the_others_from_forming() {
    for mute in [1, 3, 5] {
        let links = all().iter().map(|&other| (ModuleId(mute), other)).collect();
        let (mut stage, opened) = epochs_with_severed(&links, 7);
        let mut others = all();
        others.remove(&ModuleId(mute));
        assert!(hold_a_plan(&stage.cluster, &others), "mute {mute}");
        assert!(opened <= 1, "mute {mute}: {opened} epochs");
        stage.cluster.heal();
        stage.until(|cluster| hold_a_plan(cluster, &all()));
    }
}

/// Who hears whom need not be transitive: here the lowest and another module hear everyone but each other.
#[test]
fn modules_that_do_not_hear_each_other_are_left_out_for_longer_and_longer() {
    for (one, other) in [(1, 4), (2, 5), (4, 5)] {
        for both_ways in [false, true] {
            let mut links: BTreeSet<_> = [(ModuleId(one), ModuleId(other))].into();
            if both_ways {
                links.insert((ModuleId(other), ModuleId(one)));
            }
            let (mut stage, opened) = epochs_with_severed(&links, 7);
            let placed = settled(&stage.cluster).len();
            println!("{one}-{other} {both_ways}: {opened} epochs, {placed} settled");
            assert!(placed >= 3, "{one}-{other}: {placed} settled");
            assert!(opened <= 8, "{one}-{other}: {opened} epochs");
            stage.cluster.heal();
            stage.until(|cluster| hold_a_plan(cluster, &all()));
        }
    }
}

/// The target changes while some are cut off from its publisher. One that froze on a spot of the former target was taken
/// for one that stands on the spot of that number in the new target, and stayed beside it.
#[test]
fn a_spot_of_another_target_is_no_pin() {
    let parameters = |agents| CampaignParameters {
        faults: FaultKind::Hostile,
        modules_max: 16,
        agents,
        ..CampaignParameters::default()
    };
    let bug = AgentFactory::new(|identity, parameters, now| {
        Agent::new(identity, parameters, now).mutated(Mutation::PinForAnyTarget)
    });
    let seed = 60;
    let broken = run_seed(&parameters(bug), seed).unwrap().violations;
    let elsewhere = |kind| matches!(kind, ViolationKind::SettledElsewhere);
    assert!(broken.iter().any(|one| elsewhere(one.kind)), "{broken:?}");
    let mended = run_seed(&parameters(AgentFactory::default()), seed).unwrap();
    assert!(mended.violations.is_empty(), "{:?}", mended.violations);
}
