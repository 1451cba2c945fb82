//! Drivers that fall silent: nobody knows where such a module stands, if it stands.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::time::Duration;

use crate::service::{in_a_row, on_the_way, on_the_way_from};
use crate::support::{Trial, hold_a_plan, in_phase};
use formation_model::{
    BodyReport, ModuleId, ModulePhase, Service, TargetAnnouncement, Whereabouts,
};
use formation_protocol::{Command, Event};
use formation_sim::Cluster;

/// How long the drives move on after the last goal.
const COASTING: Option<Duration> = Some(Duration::from_millis(1_500));

/// Six modules on their paths, one of which has been on its way for a second when its driver falls silent.
fn with_a_silent_driver(silent: ModuleId) -> Trial {
    let mut trial = on_the_way(silent, COASTING);
    trial.cluster.mute_drive(silent);
    trial.run_for(Duration::from_secs(25));
    trial
}

/// Its agent does not know where it stands: what it last measured is no place where it has halted.
#[test]
fn a_module_that_was_not_measured_to_stand_is_on_its_way_for_the_others() {
    let silent = ModuleId(3);
    let mut trial = with_a_silent_driver(silent);
    trial.cluster.command(ModuleId(6), Command::Retire);
    trial.run_for(Duration::from_secs(30));
    assert!(trial.rosters.len() > 2, "an epoch left it out before");
    assert_is_on_its_way(&trial, silent);
}

/// Withdraws the first target and announces it again, and waits for this long after each.
fn withdraw_and_announce(trial: &mut Trial, pause: Duration) {
    let announced = trial.cluster.announcement().unwrap();
    let announced = TargetAnnouncement::clone(announced);
    for (revision, target) in [(2, None), (3, announced.target.clone())] {
        trial.cluster.announce(TargetAnnouncement {
            revision,
            target,
            ..announced.clone()
        });
        trial.run_for(pause);
    }
}

#[test]
fn a_module_that_may_move_on_is_on_its_way_after_the_target_is_withdrawn() {
    let silent = ModuleId(3);
    let mut trial = with_a_silent_driver(silent);
    withdraw_and_announce(&mut trial, Duration::from_secs(30));
    let last = trial.rosters.last().unwrap();
    assert_eq!(last.target.revision, 3);
    assert_is_on_its_way(&trial, silent);
}

/// The last roster does not list a module, and takes it to be anywhere on the rest of its way.
fn assert_is_on_its_way(trial: &Trial, module: ModuleId) {
    let last = trial.rosters.last().unwrap();
    let mut members = last.members.iter();
    assert!(members.all(|member| member.module.id != module));
    let mut bodies = last.bodies.iter();
    let body: &BodyReport = bodies.find(|body| body.module == module).unwrap();
    let whereabouts = &body.whereabouts;
    assert!(
        matches!(
            whereabouts,
            Whereabouts::OnTheWay(_) | Whereabouts::InBlock(_)
        ),
        "{body:?}"
    );
}

/// Otherwise each epoch would wait for it, and none would settle.
#[test]
fn a_module_that_rejoins_before_it_stands_is_not_waited_for() {
    let silent = ModuleId(3);
    let mut trial = with_a_silent_driver(silent);
    trial.run_for(Duration::from_secs(60));
    trial.cluster.command(silent, Command::Rejoin);
    let before = trial.convened.len();
    trial.run_for(Duration::from_secs(600));
    assert!(trial.convened.len() - before < 10);
    assert!(!trial.settled().is_empty());
}

/// It would wait for its own rest, and the others for its roster.
/// Shows E4.
#[test]
fn a_module_whose_driver_falls_silent_convenes_no_other() {
    let silent = ModuleId(1);
    let mut trial = with_a_silent_driver(silent);
    trial.run_for(Duration::from_secs(30));
    assert_eq!(trial.convened.len(), 2);
    assert_ne!(trial.rosters.last().unwrap().epoch.convener, silent);
    assert_is_on_its_way(&trial, silent);
    assert!(!in_phase(&trial.cluster, ModulePhase::Settled).is_empty());
}

/// The same if its driver falls silent while it halts to convene.
/// Shows G6.
#[test]
fn a_convener_whose_driver_falls_silent_leaves_the_gathering() {
    let silent = ModuleId(1);
    let mut trial = on_the_way(silent, COASTING);
    trial.cluster.command(ModuleId(6), Command::Retire);
    trial.until(|cluster| {
        let convening = cluster.standing(silent).unwrap().epoch;
        convening.is_some_and(|epoch| epoch.number > 1)
    });
    trial.cluster.mute_drive(silent);
    trial.run_for(Duration::from_secs(60));
    assert_eq!(trial.convened.len(), 3);
    assert_ne!(trial.rosters.last().unwrap().epoch.convener, silent);
    assert!(!in_phase(&trial.cluster, ModulePhase::Settled).is_empty());
}

/// Its drive gets no goal on which it would never report again: the module freezes, and its vote counts.
/// Shows S4.
#[test]
fn a_module_whose_driver_is_silent_does_not_make_way_when_it_is_retired() {
    for commands in [&[Command::Retire][..], &[Command::Rejoin, Command::Retire]] {
        check_that_it_makes_no_way(commands);
    }
}

fn check_that_it_makes_no_way(commands: &[Command]) {
    let mut trial = in_a_row(4, 6, "", 5.0);
    trial.until(Cluster::has_formed);
    let settled = trial.settled();
    let (silent, dies) = (settled[0].0, settled[2].0);
    trial.cluster.mute_drive(silent);
    trial.run_for(Duration::from_secs(10));
    for &command in commands {
        trial.cluster.command(silent, command);
    }
    trial.run_for(Duration::from_secs(30));
    trial.cluster.crash(dies);
    trial.run_for(Duration::from_secs(60));
    let members = trial.rosters.last().unwrap().members.iter();
    let members: Vec<(ModuleId, Service)> = members
        .map(|member| (member.module.id, member.service))
        .collect();
    assert_eq!(members.len(), 3);
    assert!(members.contains(&(silent, Service::MotionFailed)));
}

/// No command means that it stands.
/// Shows E4.
#[test]
fn a_module_whose_driver_fell_silent_convenes_no_other_after_a_command() {
    let silent = ModuleId(1);
    for commands in [
        &[Command::Retire][..],
        &[Command::Rejoin],
        &[Command::Rejoin, Command::Retire],
    ] {
        let mut trial = with_a_silent_driver(silent);
        trial.run_for(Duration::from_secs(35));
        for &command in commands {
            trial.cluster.command(silent, command);
        }
        withdraw_and_announce(&mut trial, Duration::from_secs(5));
        trial.run_for(Duration::from_secs(60));
        let mut events = trial.noted.iter();
        let convenes = |(module, event): &(ModuleId, Event)| {
            *module == silent && matches!(event, Event::Convened(epoch, _) if epoch.number > 1)
        };
        assert!(!events.any(convenes), "{commands:?}");
    }
}

/// It alone follows a convener that dies, never freezes, and opens no epoch itself: the others go on without the two.
#[test]
fn a_module_that_never_freezes_in_a_later_epoch_is_not_waited_for() {
    let silent = ModuleId(3);
    // The rest of each path blocks no other's spot.
    let mut trial = on_the_way_from(|id| id - 1, silent, COASTING);
    let others = [2, 4, 5, 6].map(ModuleId);
    let links = others.iter().map(|&other| (ModuleId(1), other));
    trial.cluster.sever(&links.collect());
    trial.cluster.mute_drive(silent);
    trial.until(|cluster| {
        let epoch = cluster.standing(silent).unwrap().epoch;
        epoch.is_some_and(|epoch| epoch.number > 1)
    });
    trial.run_for(Duration::from_millis(200));
    trial.cluster.crash(ModuleId(1));
    trial.cluster.heal();
    trial.run_for(Duration::from_secs(600));
    assert!(hold_a_plan(&trial.cluster, &BTreeSet::from(others)));
}
