//! Modules that leave the formation without dying: retired ones, and those whose drives fail.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::time::Duration;

use crate::support::{Trial, drawn, drawn_beside, in_phase, scenario, spots, waiting_for_a_lease};
use formation_generate::Grouping;
use formation_model::{BlockedSpot, ModuleId, ModulePhase, Service, SpotId};
use formation_protocol::{AgentParameters, Command, EpochReason, Event};
use formation_sim::{Cluster, ClusterParameters};

const SEEDS: std::ops::Range<u64> = 0..6;

/// Shows S1.
#[test]
fn a_spare_takes_the_spot_of_a_retired_module() {
    for seed in SEEDS {
        let mut trial = Trial::new(&drawn(7, 5, Grouping::Mixed, seed), seed);
        trial.until(Cluster::has_formed);
        let before = trial.settled();
        let (retired, spot) = before[2];
        trial.cluster.command(retired, Command::Retire);
        trial.until_formed_again();
        trial.run_for(Duration::from_secs(5));
        let after = trial.settled();
        assert_eq!(spots(&after), spots(&before), "seed {seed}");
        let (heir, _) = after.iter().copied().find(|&(_, one)| one == spot).unwrap();
        assert!(before.iter().all(|&(module, _)| module != heir), "a spare");
        // No other module moved.
        let stayed = before.iter().filter(|&&(module, _)| module != retired);
        assert!(
            stayed.clone().all(|pair| after.contains(pair)),
            "seed {seed}"
        );
        assert_eq!(trial.spot_of(retired), None);
        assert_eq!(trial.in_phase(ModulePhase::Spare).len(), 2);
        assert!(trial.cluster.agent(retired).unwrap().links().is_empty());
        // It is a member, so that it counts, and no part of the plan.
        let roster = trial.rosters.last().unwrap();
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
            trial.noted.iter().any(|(_, event)| *event == named),
            "seed {seed}"
        );
    }
}

/// Shows S3.
#[test]
fn without_a_spare_the_spot_of_a_retired_module_is_reported_open_until_it_rejoins() {
    for seed in SEEDS {
        let mut trial = Trial::new(&drawn(6, 6, Grouping::Mixed, seed), seed);
        trial.until(Cluster::has_formed);
        let (retired, spot) = trial.settled()[3];
        trial.cluster.command(retired, Command::Retire);
        trial.until_formed_again();
        assert_eq!(trial.open_spots(), Some(vec![spot]), "seed {seed}");
        assert_eq!(trial.settled().len(), 5);
        trial.cluster.command(retired, Command::Rejoin);
        trial.until_formed_again();
        assert_eq!(trial.spot_of(retired), Some(spot), "seed {seed}");
    }
}

/// Shows S2.
#[test]
fn retired_modules_count_as_present_until_their_votes_are_removed() {
    let mut trial = Trial::new(&drawn(7, 7, Grouping::Singletons, 3), 3);
    trial.until(Cluster::has_formed);
    // Five of seven leave: the two that stay would never be a majority if the five did not count.
    for id in 3..=7 {
        trial.cluster.command(ModuleId(id), Command::Retire);
    }
    trial.until_formed_again();
    assert_eq!(trial.settled().len(), 2);
    for id in 3..=7 {
        trial.cluster.crash(ModuleId(id));
        trial.cluster.remove_with(ModuleId(id), true);
    }
    trial.until_formed_again();
    assert_eq!(trial.settled().len(), 2);
    assert_eq!(trial.rosters.last().unwrap().voters.listed.len(), 5);
}

/// Shows S1.
#[test]
fn a_module_that_is_retired_while_moving_halts_and_harms_no_other() {
    for seed in SEEDS {
        let mut trial = Trial::new(&drawn(6, 6, Grouping::Singletons, seed), seed);
        trial.until(|cluster| !in_phase(cluster, ModulePhase::Moving).is_empty());
        let moving = trial.in_phase(ModulePhase::Moving)[0];
        trial.cluster.command(moving, Command::Retire);
        assert!(!trial.cluster.standing(moving).unwrap().moving);
        trial.until_formed_again();
        let settled = trial.settled();
        assert_eq!(settled.len(), 5, "seed {seed}");
        assert!(settled.iter().all(|&(module, _)| module != moving));
        assert!(trial.open_spots().is_some_and(|open| open.len() == 1));
    }
}

/// Shows X4.
#[test]
fn a_drive_that_fails_is_named_and_a_spare_takes_its_spot() {
    for seed in SEEDS {
        let problem = drawn_beside(7, 6, Grouping::Singletons, seed);
        let mut trial = Trial::with(&problem, waiting_for_a_lease(), seed);
        trial.until(|cluster| !in_phase(cluster, ModulePhase::Waiting).is_empty());
        let broken = *trial.in_phase(ModulePhase::Waiting).last().unwrap();
        trial.cluster.break_drive(broken, true);
        trial.until(Cluster::has_formed);
        let settled = trial.settled();
        // Where it stands on a spot, that stays open.
        let blocked = trial.rosters.last().unwrap().blocked_spots();
        assert_eq!(settled.len() + blocked.len(), 6, "seed {seed}");
        assert!(settled.iter().all(|&(module, _)| module != broken));
        assert_eq!(
            trial.count(|event| matches!(event, Event::MotionFailed(_))),
            1
        );
        let named = trial.count(|event| match event {
            Event::Convened(_, EpochReason::OutOfService(modules)) => {
                *modules == [(broken, Service::MotionFailed)]
            }
            _ => false,
        });
        assert!(named >= 1, "seed {seed}");
        // There are no further attempts: two epochs are enough.
        trial.run_for(Duration::from_secs(200));
        assert_eq!(trial.newest_epoch(), 2, "seed {seed}");
    }
}

/// Shows S4.
#[test]
fn a_module_with_a_repaired_drive_rejoins() {
    let mut trial = Trial::new(&drawn(5, 5, Grouping::Singletons, 1), 1);
    let broken = ModuleId(4);
    trial.until(|cluster| cluster.running().contains(&broken));
    trial.cluster.break_drive(broken, true);
    trial.until(Cluster::has_formed);
    assert_eq!(trial.settled().len(), 4);
    assert!(trial.open_spots().is_some_and(|open| open.len() == 1));
    trial.cluster.break_drive(broken, false);
    trial.cluster.command(broken, Command::Rejoin);
    trial.until_formed_again();
    assert_eq!(trial.settled().len(), 5);
}

/// The convener does not receive that it failed, and so calls no other epoch before the lease of its heartbeats ends.
/// Shows A3.
#[test]
fn modules_halt_when_the_motion_of_another_fails() {
    let broken = ModuleId(6);
    let mut trial = on_the_way(broken, None);
    let others = [2, 3, 4, 5].map(ModuleId);
    assert!(others.iter().all(|&other| trial.cluster.is_moving(other)));
    let convener = trial.rosters.last().unwrap().epoch.convener;
    trial.cluster.sever(&BTreeSet::from([(broken, convener)]));
    trial.cluster.break_drive(broken, true);
    trial.until(|cluster| !cluster.is_moving(broken));
    trial.run_for(Duration::from_millis(500));
    let moving: Vec<ModuleId> = trial.cluster.modules().into_iter().collect();
    let moving = moving
        .iter()
        .filter(|&&module| trial.cluster.is_moving(module));
    assert_eq!(moving.collect::<Vec<_>>(), [&convener]);
    assert_eq!(trial.convened.len(), 1);
    trial.cluster.heal();
    trial.until_formed_again();
    assert_eq!(trial.settled().len(), 5);
}

/// Docked modules turn together onto the lattice. They are one body as long as all of them stay docked: each halts by its
/// own clock.
/// Shows S4.
#[test]
fn a_spare_that_leaves_service_while_all_turn_together_stays_docked_until_a_plan_without_it() {
    let problem = scenario(
        "target: {map: 'o-o'}
configurations:
  - id: 1
    modules:
      - {id: 1, x: 20.0, y: 0.0, theta: 0.5}
      - {id: 2, x: 20.877583, y: 0.479426, theta: 0.5}
      - {id: 3, x: 21.755165, y: 0.958851, theta: 0.5}
    edges: [[1, 2], [2, 3]]",
    );
    let (spare, neighbour, other) = (ModuleId(3), ModuleId(2), ModuleId(1));
    for breaks in [true, false] {
        let parameters = ClusterParameters {
            speed_units_per_s: 0.3,
            ..ClusterParameters::default()
        };
        let mut trial = Trial::with(&problem, parameters, 3);
        trial.until(|cluster| cluster.running().len() == 3);
        trial.cluster.break_drive(spare, breaks);
        trial.until(|cluster| cluster.is_moving(other));
        if !breaks {
            trial.until(|cluster| cluster.is_moving(spare));
            trial.cluster.command(spare, Command::Retire);
        }
        while trial.rosters.len() < 2 {
            let links = trial.cluster.links(spare);
            assert_eq!(links, Some(&BTreeSet::from([neighbour])), "{breaks}");
            trial.run_for(Duration::from_millis(1));
        }
        trial.until(Cluster::has_formed);
        let docked = |cluster: &Cluster| !cluster.links(spare).unwrap().is_empty();
        trial.until(|cluster| !docked(cluster));
        assert_eq!(trial.settled().len(), 2, "{breaks}");
    }
}

/// A spare takes its spot only after it has moved off, which it never does.
#[test]
fn a_retired_module_that_cannot_make_room_blocks_its_spot() {
    for seed in SEEDS {
        let mut trial = Trial::new(&drawn(7, 6, Grouping::Mixed, seed), seed);
        trial.until(Cluster::has_formed);
        let (retired, spot) = trial.settled()[1];
        trial.cluster.break_drive(retired, true);
        trial.cluster.command(retired, Command::Retire);
        let before = trial.cluster.now();
        trial.until(|cluster| {
            let standing = cluster.standing(retired).unwrap();
            cluster.has_formed() && standing.epoch.is_some_and(|epoch| epoch.number > 2)
        });
        let reason = EpochReason::OutOfService(vec![(retired, Service::MotionFailed)]);
        let named = |event: &Event| matches!(event, Event::Convened(_, one) if *one == reason);
        assert_eq!(trial.count(named), 1, "seed {seed}");
        let taken = trial.cluster.now() - before;
        assert!(
            taken < AgentParameters::default().stuck,
            "{taken:?}, seed {seed}"
        );
        let last = trial.rosters.last().unwrap();
        let module = retired;
        assert_eq!(
            last.blocked_spots(),
            [BlockedSpot { spot, module }],
            "seed {seed}"
        );
    }
}

/// Six modules on paths to six spots, one of which has been on its way for a second.
pub(crate) fn on_the_way(module: ModuleId, coasting: Option<Duration>) -> Trial {
    on_the_way_from(|id| 2 * id, module, coasting)
}

/// The same for modules that start in these columns.
pub(crate) fn on_the_way_from(
    column: impl Fn(u32) -> u32,
    module: ModuleId,
    coasting: Option<Duration>,
) -> Trial {
    let starts = (1..7).map(|id| format!("{{id: {id}, x: {}, y: 6}}", column(id)));
    let starts: Vec<String> = starts.collect();
    let starts = starts.join(", ");
    let text = format!("target: {{map: 'o-o-o-o-o-o'}}\nsingletons: [{starts}]");
    let parameters = ClusterParameters {
        coasting,
        speed_units_per_s: 0.3,
        ..ClusterParameters::default()
    };
    let mut trial = Trial::with(&scenario(&text), parameters, 3);
    trial.until(|cluster| cluster.is_moving(module));
    trial.run_for(Duration::from_secs(1));
    trial
}

/// Modules in a row at some distance from a target of three spots.
pub(crate) fn in_a_row(
    count: u32,
    distance: u32,
    surroundings: &str,
    speed_units_per_s: f64,
) -> Trial {
    let starts = (1..=count).map(|id| format!("{{id: {id}, x: {}, y: {distance}}}", 2 * id));
    let starts: Vec<String> = starts.collect();
    let starts = starts.join(", ");
    let text = format!("target: {{map: 'o-o-o'}}\nsingletons: [{starts}]\n{surroundings}");
    let parameters = ClusterParameters {
        speed_units_per_s,
        ..ClusterParameters::default()
    };
    Trial::with(&scenario(&text), parameters, 3)
}

/// Shows S6.
#[test]
fn a_retired_module_makes_way_along_a_path() {
    let walls = "obstacles: [{x: 40, y: 40, width: 1, height: 1}]";
    for surroundings in ["", walls] {
        let mut trial = in_a_row(4, 6, surroundings, 5.0);
        trial.until(Cluster::has_formed);
        let (module, spot) = trial.settled()[0];
        let before = trial.newest_epoch();
        trial.cluster.command(module, Command::Retire);
        trial.until_formed_after(before);
        assert_eq!(trial.rosters.last().unwrap().blocked_spots(), vec![]);
        let settled = trial.settled();
        assert_eq!(settled.len(), 3);
        assert!(
            settled
                .iter()
                .any(|&(holder, held)| held == spot && holder != module)
        );
        let own = trial.cluster.body(module).unwrap();
        for (holder, _) in settled {
            let body = trial.cluster.body(holder).unwrap();
            assert!(
                own.distance_to(&body).to_units() > 0.99,
                "{module} and {holder}"
            );
        }
        assert_eq!(trial.cluster.links(module), Some(&BTreeSet::new()));
    }
}

/// Three docked modules stand turned over the target, and one end of them is retired: it makes way by steps of its own. No module moves
/// while it is docked to one that moves apart from it, and the two that turn as one body begin only when both are free, however long
/// ports take to let go.
/// Shows S6, X2.
#[test]
fn a_retired_module_undocks_before_it_makes_way() {
    let problem = scenario(
        "
target: {map: 'o-o-o'}
configurations: [{id: 1, leader: 1, modules: [
  {id: 1, x: 0.0603, y: -0.342, theta: 0.349}, {id: 2, x: 1.0, y: 0.0, theta: 0.349}, {id: 3, x: 1.9397, y: 0.342, theta: 0.349}],
  edges: [[1, 2], [2, 3]]}]
singletons: [{id: 4, x: 6, y: 3}, {id: 5, x: 8, y: 3}]
",
    );
    for undocking in [0, 2_000].map(Duration::from_millis) {
        let parameters = ClusterParameters {
            undocking,
            speed_units_per_s: 0.5,
            ..ClusterParameters::default()
        };
        let mut trial = Trial::with(&problem, parameters, 3);
        trial.until(|cluster| cluster.standing(ModuleId(3)).is_some());
        trial.cluster.command(ModuleId(3), Command::Retire);
        let mut longest = [0.0_f64; 2];
        trial.until(|cluster| {
            for (pair, longest) in [(1, 2), (2, 3)].into_iter().zip(&mut longest) {
                let (one, other) = (ModuleId(pair.0), ModuleId(pair.1));
                let bodies = [one, other].map(|module| cluster.body(module).unwrap());
                if cluster.links(one).unwrap().contains(&other) {
                    *longest = longest.max(bodies[0].distance_to(&bodies[1]).to_units());
                }
            }
            cluster.has_formed()
        });
        // The two that turn set off within a message's time.
        assert!(
            longest[0] < 1.05 && longest[1] < 1.01,
            "{undocking:?}: {longest:?}"
        );
        assert_eq!(trial.cluster.links(ModuleId(3)), Some(&BTreeSet::new()));
    }
}

/// Walls leave it no place beside the lane, so it blocks its spot like one whose motion failed.
/// Shows S6.
#[test]
fn a_retired_module_that_cannot_make_way_blocks_its_spot() {
    let lane = scenario(
        "
target: {map: 'o-o-o'}
arena: {x: 2, y: 0, width: 7, height: 1}
singletons: [{id: 1, x: 0, y: 0}, {id: 2, x: 1, y: 0}, {id: 3, x: 2, y: 0}, {id: 4, x: 4, y: 0}]
",
    );
    let mut trial = Trial::new(&lane, 3);
    trial.until(Cluster::has_formed);
    let (module, spot) = (ModuleId(1), SpotId(1));
    assert!(
        trial.settled().contains(&(module, spot)),
        "{:?}",
        trial.settled()
    );
    let before = trial.newest_epoch();
    trial.cluster.command(module, Command::Retire);
    trial.until_formed_after(before);
    let blocked = vec![BlockedSpot { spot, module }];
    assert_eq!(trial.rosters.last().unwrap().blocked_spots(), blocked);
    assert_eq!(trial.settled().len(), 2);
    assert_eq!(
        trial.count(|event| matches!(event, Event::CannotMakeWay(_))),
        1
    );
}

/// Shows X12.
#[test]
fn a_retired_member_leaves_out_no_module_that_moves_along_its_path() {
    let mut trial = in_a_row(4, 100, "", 0.3);
    trial.until(|cluster| cluster.running().len() == 4);
    trial.cluster.command(ModuleId(1), Command::Retire);
    trial.until(Cluster::has_formed);
    let stuck = trial.count(|event| matches!(event, Event::Convened(_, EpochReason::Stuck(_))));
    assert_eq!(stuck, 0);
}

/// No other module knows of it in between, and it shows that it has settled.
#[test]
fn a_settled_module_that_retires_and_rejoins_freezes_with_its_spot() {
    let mut trial = Trial::new(&drawn(6, 5, Grouping::Singletons, 3), 3);
    trial.until(Cluster::has_formed);
    let (module, spot) = trial.settled()[2];
    trial.cluster.cut(&BTreeSet::from([module]));
    trial.cluster.command(module, Command::Retire);
    trial.cluster.command(module, Command::Rejoin);
    trial.cluster.heal();
    trial.run_for(Duration::from_secs(30));
    assert_eq!(trial.spot_of(module), Some(spot));
    let lost = trial.settled()[0].0;
    trial.cluster.crash(lost);
    trial.run_for(Duration::from_secs(60));
    let mut members = trial.rosters.last().unwrap().members.iter();
    let member = members.find(|one| one.module.id == module).unwrap();
    assert_eq!(member.module.pin, Some(spot));
}
