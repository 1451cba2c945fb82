//! Attacks on the protocol, step by step.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use crate::support::{Trial, drawn, hold_a_plan, ids, newest_epoch, spots};
use formation_generate::Grouping;
use formation_model::{
    ClosedRoster, Epoch, Incarnation, Message, ModuleId, PlanningModule, Pose, Roster,
    RosterMember, RosterMessage, STAMP_AHEAD_MAX, Service, TargetAnnouncement,
};
use formation_protocol::{Agent, AgentParameters, Command, Event, Mutation};
use formation_sim::{
    AgentFactory, CampaignParameters, Cluster, ClusterParameters, FaultKind, ViolationKind,
    run_seed,
};

fn all() -> BTreeSet<ModuleId> {
    ids(&[1, 2, 3, 4, 5])
}

/// The third module agrees with the first two, restarts, and reaches the other two only, which know nothing of that agreement.
/// Returns whether these three form.
fn third_forgets(agents: &AgentFactory, seed: u64) -> (Trial, bool) {
    let problem = drawn(5, 5, Grouping::Singletons, seed);
    let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), seed, agents.clone());
    trial.until(Cluster::has_formed);
    trial.cluster.cut(&ids(&[4, 5]));
    trial.until(|cluster| {
        hold_a_plan(cluster, &ids(&[1, 2, 3])) && epoch_of(cluster, 3) > epoch_of(cluster, 4)
    });
    trial.run_for(Duration::from_secs(5));
    trial.cluster.crash(ModuleId(3));
    trial.cluster.cut(&ids(&[3, 4, 5]));
    trial.cluster.restart(ModuleId(3));
    trial.run_for(Duration::from_secs(60));
    assert!(!hold_a_plan(&trial.cluster, &ids(&[1, 2])), "two of five");
    let have_formed = hold_a_plan(&trial.cluster, &ids(&[3, 4, 5]));
    (trial, have_formed)
}

/// Shows Q2.
#[test]
fn a_restarted_module_does_not_count_towards_the_quorum() {
    for seed in 0..6 {
        let (mut trial, have_formed) = third_forgets(&AgentFactory::default(), seed);
        assert!(!have_formed, "seed {seed}");
        let waiting = trial.count(|event| matches!(event, Event::WaitingForQuorum(_)));
        assert!(waiting > 0, "seed {seed}");
        trial.cluster.heal();
        trial.until_formed_again();
        assert_eq!(spots(&trial.settled()).len(), 5, "seed {seed}");
    }
}

/// The attack is real: if restarted modules count, those form that do not know where the others went.
#[test]
fn counting_restarted_modules_lets_those_form_that_have_forgotten() {
    let agents = AgentFactory::new(|identity, parameters, now| {
        Agent::new(identity, parameters, now).mutated(Mutation::CountForgetful)
    });
    assert!(third_forgets(&agents, 0).1);
}

fn epoch_of(cluster: &Cluster, module: u32) -> u64 {
    let standing = cluster.standing(ModuleId(module));
    standing
        .and_then(|one| one.epoch)
        .map_or(0, |epoch| epoch.number)
}

/// Runs for ten minutes with some links severed, and returns how many epochs were opened in the last five of them.
fn epochs_with_severed(links: &BTreeSet<(ModuleId, ModuleId)>, seed: u64) -> (Trial, usize) {
    let mut trial = Trial::new(&drawn(5, 5, Grouping::Singletons, seed), seed);
    trial.cluster.sever(links);
    trial.run_for(Duration::from_secs(300));
    let before = trial.convened.len();
    trial.run_for(Duration::from_secs(300));
    let opened = trial.convened.len() - before;
    (trial, opened)
}

/// Shows E6.
#[test]
fn a_module_that_receives_nothing_does_not_keep_the_others_from_forming() {
    for receiver in [1, 3, 5] {
        let links = all()
            .iter()
            .map(|&other| (other, ModuleId(receiver)))
            .collect();
        let (mut trial, opened) = epochs_with_severed(&links, 7);
        let mut others = all();
        others.remove(&ModuleId(receiver));
        assert!(hold_a_plan(&trial.cluster, &others), "module {receiver}");
        assert!(opened <= 1, "module {receiver}: {opened} epochs");
        trial.cluster.heal();
        trial.until(|cluster| hold_a_plan(cluster, &all()));
    }
}

/// Shows E7.
#[test]
fn a_module_that_reaches_no_other_does_not_keep_the_others_from_forming() {
    for sender in [1, 3, 5] {
        let links = all()
            .iter()
            .map(|&other| (ModuleId(sender), other))
            .collect();
        let (mut trial, opened) = epochs_with_severed(&links, 7);
        let mut others = all();
        others.remove(&ModuleId(sender));
        assert!(hold_a_plan(&trial.cluster, &others), "module {sender}");
        assert!(opened <= 1, "module {sender}: {opened} epochs");
        trial.cluster.heal();
        trial.until(|cluster| hold_a_plan(cluster, &all()));
    }
}

/// Two modules receive messages of all others, and not of each other: one of them is left out, once and for all.
/// Shows E4, E7.
#[test]
fn of_two_modules_that_do_not_receive_each_other_one_is_left_out() {
    for (one, other) in [(1, 4), (2, 5), (4, 5)] {
        for in_both_directions in [false, true] {
            let mut links: BTreeSet<_> = [(ModuleId(one), ModuleId(other))].into();
            if in_both_directions {
                links.insert((ModuleId(other), ModuleId(one)));
            }
            let (mut trial, opened) = epochs_with_severed(&links, 7);
            let mut left = all();
            left.remove(&ModuleId(other));
            assert!(hold_a_plan(&trial.cluster, &left), "{one}-{other}");
            assert_eq!(opened, 0, "{one}-{other}");
            trial.cluster.heal();
            trial.until(|cluster| hold_a_plan(cluster, &all()));
        }
    }
}

/// The target changes while some modules are cut off from its publisher. A module that freezes on a spot of the former target
/// does not stand on the spot of the same number in the new target.
/// Shows P1.
#[test]
fn a_spot_of_another_target_is_no_pin() {
    let parameters = |agents| CampaignParameters {
        faults: FaultKind::Hostile,
        modules_min: 3,
        modules_max: 12,
        agents,
        ..CampaignParameters::default()
    };
    let bug = AgentFactory::new(|identity, parameters, now| {
        Agent::new(identity, parameters, now).mutated(Mutation::PinForAnyTarget)
    });
    let mut broken = (0..100).filter(|&seed| {
        let report = run_seed(&parameters(bug.clone()), seed).unwrap();
        let mut kinds = report.violations.iter().map(|violation| violation.kind);
        kinds.any(|kind| kind == ViolationKind::SettledElsewhere)
    });
    let seed = broken.next().unwrap();
    let sound = run_seed(&parameters(AgentFactory::default()), seed).unwrap();
    assert!(sound.violations.is_empty(), "{:?}", sound.violations);
}

#[test]
fn a_target_that_is_ignored_as_old_names_no_voters() {
    let problem = drawn(5, 5, Grouping::Singletons, 6);
    let mut trial = Trial::new(&problem, 6);
    trial.until(Cluster::has_formed);
    let known = TargetAnnouncement::clone(trial.cluster.announcement().unwrap());
    let old = TargetAnnouncement {
        revision: 0,
        voters: vec![ModuleId(9_000)],
        ..known
    };
    trial.cluster.inject(&Message::Target(Arc::new(old)));
    trial.run_for(Duration::from_secs(5));
    trial.cluster.crash(ModuleId(5));
    trial.cluster.remove(ModuleId(5));
    let remaining = ids(&[1, 2, 3, 4]);
    trial.until(|cluster| hold_a_plan(cluster, &remaining));
}

/// A member that a stranger invents.
fn invented(id: u32) -> RosterMember {
    RosterMember {
        incarnation: Incarnation(1),
        knows: true,
        is_idle: true,
        service: Service::Active,
        module: PlanningModule {
            id: ModuleId(id),
            pose: Pose::from_units(f64::from(id), 500.0, 0.0).unwrap(),
            links: BTreeSet::new(),
            configuration: None,
            leader: None,
            pin: None,
        },
    }
}

/// A module that starts when all spots are taken stands aside, and leaves it to the members to open epochs.
#[test]
fn a_module_that_comes_late_to_a_full_target_opens_no_epoch() {
    let mut trial = Trial::new(&drawn(6, 4, Grouping::Singletons, 3), 3);
    let late = ModuleId(6);
    trial.cluster.start_late(late, Duration::from_secs(60));
    trial.until(Cluster::has_formed);
    trial.until(|cluster| epoch_of(cluster, 6) == epoch_of(cluster, 1));
    let before = trial.convened.len();
    trial.run_for(Duration::from_secs(120));
    assert_eq!(trial.convened.len(), before);
    let members = &trial.rosters.last().unwrap().members;
    assert!(members.iter().all(|member| member.module.id != late));
}

/// A stranger publishes a roster of invented modules, and of `living` ones in their present runs. Whether or not living modules are a majority of it, they form again.
fn forge_roster(living: &[u32]) {
    let problem = drawn(5, 5, Grouping::Singletons, 3);
    let mut trial = Trial::new(&problem, 3);
    trial.until(Cluster::has_formed);
    let living = living.iter().map(|&id| RosterMember {
        incarnation: trial.cluster.run_of(ModuleId(id)).unwrap().incarnation,
        ..invented(id)
    });
    let before = trial.newest_epoch();
    let stranger = ModuleId(9_000);
    let epoch = Epoch {
        number: before + 2,
        convener: stranger,
    };
    let strangers = [9_100, 9_101, 9_102].map(invented);
    let members = living.chain(strangers.clone()).collect();
    let voters = trial.rosters.last().unwrap().voters.clone();
    let roster = Roster {
        epoch,
        target: TargetAnnouncement::clone(trial.cluster.announcement().unwrap()),
        members,
        voters,
        timing: AgentParameters::default().timing(),
        bodies: Vec::new(),
    };
    let run = stranger.run(Incarnation(1));
    trial.cluster.forge_heartbeat(run, 1, None);
    let roster = RosterMessage::Plan(Arc::new(ClosedRoster::from(roster)));
    trial.cluster.inject(&Message::Roster(roster));
    trial.run_for(Duration::from_secs(60));
    trial.until(|cluster| hold_a_plan(cluster, &all()));
}

/// Shows E3, E4.
#[test]
fn a_link_that_fails_in_one_direction_interrupts_once() {
    for (from, to) in [(2, 5), (1, 2), (4, 1)] {
        let mut trial = Trial::new(&drawn(5, 5, Grouping::Singletons, 3), 3);
        trial.until(Cluster::has_formed);
        let link = (ModuleId(from), ModuleId(to));
        let before = trial.convened.len();
        trial.cluster.sever(&BTreeSet::from([link]));
        trial.run_for(Duration::from_secs(600));
        let epochs = trial.convened.len() - before;
        // Either end may notice first, and the other before it hears of that.
        assert!(epochs <= 2, "nothing from {from} to {to}: {epochs}");
    }
}

/// A stranger's number is near enough to the clock of module 1, which is a minute ahead, and too far from the others'.
/// Shows E2.
#[test]
fn a_number_that_only_one_module_takes_over_reaches_the_others_in_time() {
    let mut trial = Trial::new(&drawn(5, 5, Grouping::Singletons, 3), 3);
    let fast = ModuleId(1);
    trial.cluster.set_clock_ahead(fast, Duration::from_secs(60));
    trial.until(Cluster::has_formed);
    trial.run_for(Duration::from_secs(10));
    let run = trial.cluster.run_of(fast).unwrap();
    let uptime = u64::try_from(trial.cluster.now().as_micros()).unwrap();
    let number = STAMP_AHEAD_MAX + run.incarnation.0 + uptime - 600_000;
    let convener = ModuleId(9_000);
    let stranger = convener.run(Incarnation(1));
    let epoch = Epoch { number, convener };
    trial.cluster.forge_heartbeat(stranger, 1, Some(epoch));
    trial.cluster.command(ModuleId(2), Command::Retire);
    trial.run_for(Duration::from_secs(60));
    trial.cluster.command(ModuleId(2), Command::Rejoin);
    trial.run_for(Duration::from_secs(300));
    let before = trial.convened.len();
    trial.run_for(Duration::from_secs(600));
    assert!(trial.convened.len() - before < 10);
    assert!(trial.cluster.has_formed());
}

/// A module that starts later knows none of the epochs by which a stranger has raised the number, step by step.
/// Shows E2.
#[test]
fn a_number_that_a_stranger_raises_keeps_no_module_out() {
    let mut trial = Trial::new(&drawn(5, 5, Grouping::Singletons, 3), 3);
    trial.until(Cluster::has_formed);
    let stranger = ModuleId(9_000).run(Incarnation(1));
    for (sequence, number) in [(1, 1 << 20), (2, 1 << 21)] {
        let convener = stranger.module;
        trial
            .cluster
            .forge_heartbeat(stranger, sequence, Some(Epoch { number, convener }));
    }
    trial.cluster.crash(ModuleId(5));
    trial.until(|cluster| newest_epoch(cluster) > 1 << 21);
    trial.cluster.restart(ModuleId(5));
    trial.until(|cluster| cluster.has_formed() && hold_a_plan(cluster, &all()));
}

/// Shows Q1.
#[test]
fn a_roster_that_lists_the_majority_that_it_invents_ends_no_formation() {
    forge_roster(&[]);
}

/// Shows E6.
#[test]
fn a_roster_that_lists_live_modules_which_refuse_it_ends_no_formation() {
    forge_roster(&[5]);
    forge_roster(&[1, 2, 3, 4]);
}
