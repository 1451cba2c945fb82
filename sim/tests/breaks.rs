//! Schedules and forged messages that once broke a promise of the fault model.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use crate::support::{Trial, drawn, hold_a_plan, ids, run_each};
use formation_generate::Grouping;
use formation_model::{Incarnation, Message, ModuleId, ModuleRun, TargetAnnouncement};
use formation_protocol::{Agent, Event, Mutation, Refusal};
use formation_sim::{
    AgentFactory, CampaignParameters, Cluster, ClusterParameters, Ending, FaultKind, run_seed,
};

fn five(seed: u64) -> Trial {
    five_with(None, seed)
}

/// Five modules that have formed, with a bug if one is given.
fn five_with(mutation: Option<Mutation>, seed: u64) -> Trial {
    let agents = AgentFactory::new(move |identity, parameters, now| {
        let agent = Agent::new(identity, parameters, now);
        match mutation {
            Some(mutation) => agent.mutated(mutation),
            None => agent,
        }
    });
    let problem = drawn(5, 5, Grouping::Singletons, seed);
    let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), seed, agents);
    trial.until(Cluster::has_formed);
    trial
}

/// The members of the plan that a module holds; empty without one.
fn members_of_plan(trial: &Trial, module: u32) -> BTreeSet<ModuleId> {
    let standing = trial.cluster.standing(ModuleId(module));
    let epoch = standing
        .filter(|one| one.digest.is_some())
        .and_then(|one| one.epoch);
    let roster = trial
        .rosters
        .iter()
        .rev()
        .find(|roster| Some(roster.epoch) == epoch);
    let members = roster.into_iter().flat_map(|roster| &roster.members);
    members.map(|member| member.module.id).collect()
}

/// Runs until these modules, and no others, have carried out one plan.
#[track_caller]
fn until_formed_by(trial: &mut Trial, modules: &[u32]) {
    let modules = ids(modules);
    let first = modules.first().unwrap().0;
    for _ in 0..600 {
        trial.run_for(Duration::from_secs(1));
        if hold_a_plan(&trial.cluster, &modules) && members_of_plan(trial, first) == modules {
            return;
        }
    }
    panic!("{modules:?} do not form:\n{}", trial.cluster.transcript());
}

/// Three of five die, and the two that stay wait until the votes of these are removed. The roster counts them no more, and once it is
/// in force two of two are needed.
/// Shows Q3.
#[test]
fn two_of_five_form_once_the_votes_of_the_others_are_removed() {
    for seed in 0..6 {
        let mut trial = five(seed);
        for module in [1, 3, 5].map(ModuleId) {
            trial.cluster.crash(module);
            trial.cluster.remove(module);
        }
        trial.run_for(Duration::from_secs(60));
        assert!(!hold_a_plan(&trial.cluster, &ids(&[2, 4])), "seed {seed}");
        for module in [1, 3, 5].map(ModuleId) {
            trial.cluster.remove_with(module, true);
        }
        until_formed_by(&mut trial, &[2, 4]);
        let voters = &trial.rosters.last().unwrap().voters;
        assert_eq!(voters.listed, ids(&[1, 3, 5]));
        // A later run of one of them takes part, and has no vote: the other one alone is no majority with it.
        trial.cluster.restart(ModuleId(5));
        until_formed_by(&mut trial, &[2, 4, 5]);
        trial.cluster.crash(ModuleId(2));
        trial.run_for(Duration::from_secs(60));
        assert!(!hold_a_plan(&trial.cluster, &ids(&[4, 5])), "seed {seed}");
    }
}

/// A module with the voters of another session is refused by name, and takes no part.
/// Shows Q4.
#[test]
fn a_module_with_other_voters_takes_no_part() {
    for stranger in [1, 5] {
        let agents = AgentFactory::new(move |identity, parameters, now| {
            let is_stranger = identity.module == ModuleId(stranger);
            let others = [ModuleId(stranger)];
            let named = if is_stranger { &others[..] } else { &[] };
            Agent::new(identity, parameters, now).with_voters(named)
        });
        let problem = drawn(5, 5, Grouping::Singletons, 6);
        let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), 6, agents);
        let mut others = vec![1, 2, 3, 4, 5];
        others.retain(|&module| module != stranger);
        until_formed_by(&mut trial, &others);
        let is_refused = |event: &Event| matches!(event, Event::Refused { reason, .. } if *reason == Refusal::OtherVoters);
        assert!(trial.count(is_refused) > 0);
        let by_others = |trial: &Trial| {
            let rosters = trial.rosters.iter();
            rosters
                .filter(|roster| roster.epoch.convener != ModuleId(stranger))
                .count()
        };
        let before = by_others(&trial);
        trial.run_for(Duration::from_secs(120));
        assert_eq!(by_others(&trial), before, "it halts nobody");
    }
}

fn violations(kind: FaultKind, modules: usize, seed: u64) -> Vec<String> {
    let parameters = CampaignParameters {
        faults: kind,
        modules_min: modules,
        modules_max: modules,
        ..CampaignParameters::default()
    };
    let report = run_seed(&parameters, seed).unwrap();
    let mut violations: Vec<String> = report
        .violations
        .iter()
        .map(|one| format!("{one:?}"))
        .collect();
    if report.ending == Ending::Neither && violations.is_empty() {
        violations.push("neither formed nor waiting".to_owned());
    }
    violations
}

/// One of three modules is needed for a majority, shows a later epoch, and is excluded by the two others again and again.
#[test]
fn modules_that_a_cut_left_in_different_epochs_come_together() {
    assert_eq!(violations(FaultKind::Hostile, 3, 7_106_766), [""; 0]);
}

/// A module sets off from its spot and another epoch opens before it has moved.
/// Shows P1.
#[test]
fn a_pin_is_not_lost_when_an_epoch_opens_as_its_module_sets_off() {
    for (modules, seed) in [
        (2, 7_014_634),
        (3, 7_102_439),
        (3, 7_111_253),
        (3, 7_117_603),
    ] {
        let found = violations(FaultKind::Hostile, modules, seed);
        assert_eq!(found, [""; 0], "seed {seed}");
    }
}

/// A module settles while a goal for the same spot waits for its store.
#[test]
fn a_pin_is_not_lost_to_a_goal_that_waits_for_the_store() {
    for (modules, seed) in [(3, 7_106_981), (3, 7_114_645), (2, 7_023_197)] {
        let found = violations(FaultKind::Hostile, modules, seed);
        assert_eq!(found, [""; 0], "seed {seed}");
    }
}

/// A module wakes from a pause, and would settle by its plan at the moment at which it learns of two later targets, the last of
/// which is one that it had settled for before.
/// Shows E8.
#[test]
fn a_pin_is_not_lost_to_a_plan_for_a_former_target() {
    run_each(FaultKind::Hostile, [2, 12], &[110_009_944, 110_012_526]);
}

/// The module knows of a roster from the history of a member, and the members are in later epochs, which lack a quorum.
#[test]
fn an_outsider_of_an_epoch_that_is_over_waits_with_the_members() {
    assert_eq!(violations(FaultKind::Churn, 4, 11_675), [""; 0]);
}

/// The channel from one that was stuck counts as failed, and its module shows the same plan a little later.
/// Shows M6.
#[test]
fn a_failed_channel_is_up_again_when_its_module_agrees() {
    assert_eq!(violations(FaultKind::Churn, 7, 2_307), [""; 0]);
}

/// Bodies block all spots for the only module with a quorum, and a stranger's roster has led the modules of two bodies astray.
/// Shows E3.
#[test]
fn modules_in_later_epochs_are_called_by_one_that_finds_all_spots_blocked() {
    assert_eq!(violations(FaultKind::Churn, 7, 1_009_019), [""; 0]);
}

/// The module crashes a tenth of a unit away from the spot on which it had settled.
/// Shows Q8.
#[test]
fn a_pin_does_not_outlive_the_process_of_a_module_that_has_set_off() {
    assert_eq!(violations(FaultKind::Churn, 6, 8_249), [""; 0]);
}

/// The third module has a shorter lease than the others.
/// Shows E11.
#[test]
fn a_roster_for_other_times_is_refused() {
    let agents = AgentFactory::new(|identity, mut parameters, now| {
        if identity.module == ModuleId(3) {
            parameters.lease = Duration::from_millis(2_000);
        }
        Agent::new(identity, parameters, now)
    });
    let problem = drawn(5, 5, Grouping::Singletons, 6);
    let mut trial = Trial::of_agents(&problem, ClusterParameters::default(), 6, agents);
    until_formed_by(&mut trial, &[1, 2, 4, 5]);
    let is_refused = |(module, event): &(ModuleId, Event)| {
        let reason = Refusal::DifferentTiming;
        *module == ModuleId(3)
            && matches!(event, Event::Refused { reason: given, .. } if *given == reason)
    };
    assert!(trial.noted.iter().any(is_refused));
}

/// A stranger sends a heartbeat as this run of the fifth module.
fn squat(trial: &mut Trial, incarnation: u64, sequence: u64) {
    let run = ModuleRun {
        module: ModuleId(5),
        incarnation: Incarnation(incarnation),
    };
    trial.cluster.forge_heartbeat(run, sequence, None);
}

/// A stranger publishes a roster whose voters are modules that do not exist, and another epoch is needed.
fn forge_roster_and_crash(trial: &mut Trial) {
    trial.cluster.forge_roster();
    trial.run_for(Duration::from_secs(10));
    trial.cluster.crash(ModuleId(5));
}

/// Shows Q4.
#[test]
fn a_roster_of_a_stranger_names_no_voters() {
    let mut trial = five(3);
    forge_roster_and_crash(&mut trial);
    until_formed_by(&mut trial, &[1, 2, 3, 4]);
}

/// A squatter sends four heartbeats as a module that has not started yet.
#[test]
fn a_squatter_keeps_a_module_out_only_while_it_sends() {
    let problem = drawn(5, 5, Grouping::Singletons, 4);
    let mut trial = Trial::new(&problem, 4);
    trial
        .cluster
        .start_late(ModuleId(5), Duration::from_secs(20));
    trial.run_for(Duration::from_secs(3));
    for sequence in 1..=4 {
        squat(&mut trial, 1 << 63, sequence);
        trial.run_for(Duration::from_millis(500));
    }
    trial.run_for(Duration::from_secs(180));
    until_formed_by(&mut trial, &[1, 2, 3, 4, 5]);
}

/// The squatter claims a later run, and the module starts while that counts: its only state arrives then.
/// Shows M3.
#[test]
fn a_module_that_starts_under_a_silent_squatter_takes_part_again() {
    for seed in 0..4 {
        let mut trial = five(seed);
        trial.cluster.crash(ModuleId(5));
        trial.cluster.remove(ModuleId(5));
        until_formed_by(&mut trial, &[1, 2, 3, 4]);
        for sequence in 1..=4 {
            squat(&mut trial, 1 << 40, sequence);
            trial.run_for(Duration::from_millis(250));
        }
        trial.cluster.restart(ModuleId(5));
        until_formed_by(&mut trial, &[1, 2, 3, 4, 5]);
    }
}

/// A stranger announces a target with the greatest revision there is.
/// Shows E10.
#[test]
fn a_revision_of_a_stranger_does_not_end_all_targets() {
    let mut trial = five(5);
    let last = TargetAnnouncement::clone(trial.cluster.announcement().unwrap());
    let forged = TargetAnnouncement {
        revision: u64::MAX,
        ..last.clone()
    };
    trial.cluster.inject(&Message::Target(Arc::new(forged)));
    trial.run_for(Duration::from_secs(5));
    let other = drawn(5, 5, Grouping::Singletons, 77);
    trial.cluster.announce_problem(&other, last.revision + 1);
    trial.until_formed_again();
    let epoch = trial.newest_epoch();
    let roster = trial
        .rosters
        .iter()
        .find(|roster| roster.epoch.number == epoch)
        .unwrap();
    assert_eq!(roster.target.target.as_ref(), Some(other.target()));
}

/// It has waited for a quorum, and moves to another spot as soon as the other members are back.
/// Shows Q6.
#[test]
fn a_module_that_goes_on_shows_no_more_that_it_waits_for_a_quorum() {
    run_each(FaultKind::Mixed, [2, 12], &[82_008_280]);
}

/// A module that restarts keeps rosters until it knows their conveners; that of a stranger takes the place of none.
/// Shows G7.
#[test]
fn a_roster_of_a_stranger_keeps_no_restarted_module_outside() {
    run_each(FaultKind::Clocks, [2, 9], &[37_422, 44_789]);
}

/// Two runs of a module learn of the same former run, and each takes a number above that.
#[test]
fn two_runs_never_take_the_same_number() {
    let seeds = [19_019, 24_259, 28_000, 33_584, 34_261, 34_512, 38_915];
    run_each(FaultKind::Clocks, [2, 9], &seeds);
}

/// A member comes back from behind a cut, where it was in a later epoch that lacks a majority now. Those that stayed settled or spare
/// take all members to be live.
/// Shows E3.
#[test]
fn members_leave_their_epoch_when_one_of_them_waits_for_a_quorum_in_a_later_one() {
    run_each(FaultKind::Clocks, [2, 12], &[77_011_167]);
    run_each(FaultKind::Churn, [2, 12], &[77_016_776]);
}
