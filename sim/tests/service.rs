//! Modules that leave the formation without dying: retired ones, and those whose drives give up.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::time::Duration;

use crate::support::{Stage, drawn, in_phase, spots};
use formation::generate::Grouping;
use formation::model::{ModuleId, ModulePhase, Service};
use formation::protocol::{Command, EpochReason, Event};
use formation_sim::Cluster;

const SEEDS: std::ops::Range<u64> = 0..6;

#[test]
fn a_spare_takes_the_spot_of_a_retired_module() {
    for seed in SEEDS {
        let mut stage = Stage::new(&drawn(7, 5, Grouping::Mixed, seed), seed);
        stage.until(Cluster::has_formed);
        let before = stage.settled();
        let (retired, spot) = before[2];
        stage.cluster.command(retired, Command::Retire);
        stage.until_formed_anew();
        stage.run_for(Duration::from_secs(5));
        let after = stage.settled();
        assert_eq!(spots(&after), spots(&before), "seed {seed}");
        let (heir, _) = after.iter().copied().find(|&(_, one)| one == spot).unwrap();
        assert!(before.iter().all(|&(module, _)| module != heir), "a spare");
        // Nobody else was sent anywhere.
        let stayed = before.iter().filter(|&&(module, _)| module != retired);
        assert!(
            stayed.clone().all(|pair| after.contains(pair)),
            "seed {seed}"
        );
        assert_eq!(stage.spot_of(retired), None);
        assert_eq!(stage.in_phase(ModulePhase::Spare).len(), 2);
        assert!(stage.cluster.agent(retired).unwrap().links().is_empty());
        // It is a member, so that it counts, and no part of the plan.
        let roster = stage.rosters.last().unwrap();
        let member = roster
            .members
            .iter()
            .find(|one| one.module.id == retired)
            .unwrap();
        assert_eq!(member.service, Service::Retired);
        let named = Event::Convened(
            roster.epoch,
            EpochReason::OutOfService(vec![(retired, Service::Retired)]),
        );
        assert!(
            stage.noted.iter().any(|(_, event)| *event == named),
            "seed {seed}"
        );
    }
}

#[test]
fn without_a_spare_the_spot_of_a_retired_module_is_reported_open_until_it_rejoins() {
    for seed in SEEDS {
        let mut stage = Stage::new(&drawn(6, 6, Grouping::Mixed, seed), seed);
        stage.until(Cluster::has_formed);
        let (retired, spot) = stage.settled()[3];
        stage.cluster.command(retired, Command::Retire);
        stage.until_formed_anew();
        assert_eq!(stage.open_spots(), Some(vec![spot]), "seed {seed}");
        assert_eq!(stage.settled().len(), 5);
        stage.cluster.command(retired, Command::Rejoin);
        stage.until_formed_anew();
        assert_eq!(stage.spot_of(retired), Some(spot), "seed {seed}");
    }
}

#[test]
fn retired_modules_count_as_present_and_may_then_be_switched_off() {
    let mut stage = Stage::new(&drawn(7, 7, Grouping::Singletons, 3), 3);
    stage.until(Cluster::has_formed);
    // Five of seven leave: the two that stay would never be a majority if the five did not count.
    for id in 3..=7 {
        stage.cluster.command(ModuleId(id), Command::Retire);
    }
    stage.until_formed_anew();
    assert_eq!(stage.settled().len(), 2);
    for id in 3..=7 {
        stage.cluster.crash(ModuleId(id));
    }
    stage.until_formed_anew();
    assert_eq!(stage.settled().len(), 2);
}

#[test]
fn a_module_that_is_retired_on_its_way_halts_and_harms_nobody() {
    for seed in SEEDS {
        let mut stage = Stage::new(&drawn(6, 6, Grouping::Singletons, seed), seed);
        stage.until(|cluster| !in_phase(cluster, ModulePhase::Moving).is_empty());
        let moving = stage.in_phase(ModulePhase::Moving)[0];
        stage.cluster.command(moving, Command::Retire);
        assert!(!stage.cluster.standing(moving).unwrap().moving);
        stage.until_formed_anew();
        let settled = stage.settled();
        assert_eq!(settled.len(), 5, "seed {seed}");
        assert!(settled.iter().all(|&(module, _)| module != moving));
        assert!(stage.open_spots().is_some_and(|open| open.len() == 1));
    }
}

#[test]
fn a_drive_that_gives_up_is_named_and_a_spare_takes_its_spot() {
    for seed in SEEDS {
        let mut stage = Stage::new(&drawn(7, 6, Grouping::Mixed, seed), seed);
        stage.until(|cluster| !in_phase(cluster, ModulePhase::Waiting).is_empty());
        let broken = *stage.in_phase(ModulePhase::Waiting).last().unwrap();
        stage.cluster.break_drive(broken, true);
        stage.until(Cluster::has_formed);
        let settled = stage.settled();
        assert_eq!(settled.len(), 6, "seed {seed}");
        assert!(settled.iter().all(|&(module, _)| module != broken));
        assert_eq!(
            stage.count(|event| matches!(event, Event::MotionFailed(Some(_)))),
            1
        );
        let named = stage.count(|event| match event {
            Event::Convened(_, EpochReason::OutOfService(modules)) => {
                *modules == [(broken, Service::MotionFailed)]
            }
            _ => false,
        });
        assert!(named >= 1, "seed {seed}");
        // It does not try again and again: two epochs are all that it takes.
        stage.run_for(Duration::from_secs(200));
        assert_eq!(stage.newest_epoch(), 2, "seed {seed}");
    }
}

#[test]
fn a_mended_drive_rejoins() {
    let mut stage = Stage::new(&drawn(5, 5, Grouping::Singletons, 1), 1);
    let broken = ModuleId(4);
    stage.until(|cluster| cluster.running().contains(&broken));
    stage.cluster.break_drive(broken, true);
    stage.until(Cluster::has_formed);
    assert_eq!(stage.settled().len(), 4);
    assert!(stage.open_spots().is_some_and(|open| open.len() == 1));
    stage.cluster.break_drive(broken, false);
    stage.cluster.command(broken, Command::Rejoin);
    stage.until_formed_anew();
    assert_eq!(stage.settled().len(), 5);
}
