//! Runs whose modules start apart and so move along paths: all at the same time, and without contact.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::sync::Arc;
use std::time::Duration;

use formation_generate::Apart;
use formation_model::{Message, ModuleId, Scenario, TargetAnnouncement};
use formation_motion::MotionReport;
use formation_motion::paths::MotionError;
use formation_protocol::{Agent, EpochReason, Event, Input, Mutation, Output};
use formation_sim::{
    AgentFactory, CampaignParameters, ClusterParameters, Ending, FaultKind, ViolationKind,
    run_seed, run_seeds,
};

use crate::support::{Trial, agent, run_all, scenario, settled};

/// The number of seeds of each kind.
fn seeds() -> u64 {
    std::env::var("FORMATION_SEEDS").map_or(60, |text| text.parse().unwrap())
}

fn parameters(faults: FaultKind, apart: Apart) -> CampaignParameters {
    CampaignParameters {
        faults,
        modules_max: 24,
        apart: (apart, 300),
        ..CampaignParameters::default()
    }
}

/// Shows X9.
#[test]
fn modules_form_without_contact() {
    for apart in [Apart::Cells, Apart::Circles] {
        run_all(&parameters(FaultKind::None, apart), 0..seeds());
    }
}

/// Shows X8.
#[test]
fn faults_lead_to_no_contact() {
    for faults in [FaultKind::Mixed, FaultKind::Hostile] {
        run_all(&parameters(faults, Apart::Circles), 0..seeds());
    }
}

/// Robots move on for a while after their agents' last goals, also those that a plan has left out. In seed 86 a drive fails while its
/// module moves on; in seed 593 a driver falls silent, and its agent never knows that it stands.
/// Shows A2, S1.
#[test]
fn drives_that_halt_late_lead_to_no_contact() {
    for faults in [FaultKind::Partition, FaultKind::Mixed, FaultKind::Hostile] {
        let parameters = CampaignParameters {
            coasting: Some(Duration::from_secs(2)),
            ..parameters(faults, Apart::Circles)
        };
        run_all(&parameters, 0..seeds() / 2);
        for seed in [86, 593] {
            run_all(&parameters, seed..seed + 1);
        }
    }
}

/// A module that is cut off on its way may be anywhere on the rest of its path.
/// Shows X10.
#[test]
fn cuts_lead_to_no_contact() {
    run_all(
        &parameters(FaultKind::Partition, Apart::Circles),
        0..seeds(),
    );
}

/// Modules that are stopped on their way resume, or plan again from where they stand if an epoch follows. None is left behind.
#[test]
fn stops_lead_to_no_contact_and_all_modules_go_on() {
    let mut later_epochs = 0;
    for apart in [Apart::Cells, Apart::Circles] {
        let parameters = CampaignParameters {
            transcripts: true,
            ..parameters(FaultKind::Stops, apart)
        };
        run_seeds(&parameters, 0..seeds(), |report| {
            let seed = report.seed;
            assert!(
                report.violations.is_empty(),
                "{seed}: {:?}",
                report.violations
            );
            assert_eq!(report.ending, Ending::Formed, "{seed}");
            let transcript = report.transcript.to_string();
            let invalid = transcript
                .lines()
                .find(|line| line.contains("invalid_start"));
            assert_eq!(invalid, None, "{seed}");
            later_epochs += report.epochs - 1;
        })
        .unwrap();
    }
    assert!(later_epochs >= seeds(), "{later_epochs}");
}

/// Obstacles and walls travel with the target, and each module plans around them. Where a body that failed leaves no path,
/// no module moves, so a run with faults may have no end.
#[test]
fn modules_keep_clear_of_obstacles_and_walls() {
    let text = include_str!("../../launch_scripts/scenarios/two_rooms.yaml");
    let scenario = Scenario::from_yaml(text).unwrap();
    let parameters = |faults| CampaignParameters {
        faults,
        problem: Some(Arc::new(scenario.problem().clone())),
        ..CampaignParameters::default()
    };
    run_all(&parameters(FaultKind::None), 0..seeds() / 3);
    run_seeds(&parameters(FaultKind::Mixed), 0..seeds() / 3, |report| {
        let mut kinds = report.violations.iter().map(|one| one.kind);
        assert!(kinds.all(|kind| kind != ViolationKind::BodiesOverlap));
    })
    .unwrap();
}

/// The last body for which no module could move is reported as removed.
/// Shows B4.
#[test]
fn a_plan_is_made_again_when_the_body_is_gone_for_which_it_was_refused() {
    let text = include_str!("../../launch_scripts/scenarios/two_rooms.yaml");
    let scenario = Scenario::from_yaml(text).unwrap();
    let parameters = CampaignParameters {
        faults: FaultKind::Hostile,
        problem: Some(Arc::new(scenario.problem().clone())),
        ..CampaignParameters::default()
    };
    let report = run_seed(&parameters, 557).unwrap();
    assert_eq!(report.violations, []);
}

/// A module dies in the door between two rooms, where others find no path any more, and is back after a minute.
/// Shows B4.
#[test]
fn modules_form_when_the_one_is_back_whose_body_closed_the_door() {
    let text = include_str!("../../launch_scripts/scenarios/two_rooms.yaml");
    let mut trial = Trial::new(&scenario(text), 3);
    let dies = ModuleId(6);
    trial.until(|cluster| {
        let body = cluster.body(dies);
        body.is_some_and(|body| (body.x.0 - 6_000_000).abs() < 300_000)
    });
    trial.cluster.crash(dies);
    trial.run_for(Duration::from_secs(60));
    let finds_no_path =
        |event: &Event| matches!(event, Event::NotMoving(_) | Event::CannotReach(_));
    assert!(trial.count(finds_no_path) > 0);
    assert!(trial.settled().len() < 10);
    trial.cluster.restart(dies);
    trial.until(|cluster| settled(cluster).len() == 10);
}

/// Twelve modules for ten spots; 11 and 12 stand too close, so one of them stays and is named, and the others form.
/// Shows X13.
#[test]
fn a_module_with_an_invalid_start_stays_and_harms_no_other() {
    let starts = (1..12).map(|id| format!("{{id: {id}, x: {}, y: 5}}", 2 * id));
    let starts: Vec<String> = starts
        .chain(["{id: 12, x: 22.3, y: 5}".to_owned()])
        .collect();
    let text = format!(
        "target: {{map: 'o-o-o-o-o-o-o-o-o-o'}}\nsingletons: [{}]",
        starts.join(", ")
    );
    let scenario = Scenario::from_yaml(&text).unwrap();
    let parameters = CampaignParameters {
        faults: FaultKind::None,
        problem: Some(Arc::new(scenario.problem().clone())),
        transcripts: true,
        ..CampaignParameters::default()
    };
    run_seeds(&parameters, 0..5, |report| {
        assert!(report.violations.is_empty(), "{:?}", report.violations);
        assert_eq!(report.ending, Ending::Formed);
        let transcript = report.transcript.to_string();
        let named = "invalid_start reason=module 11 and module 12 are too close";
        assert!(transcript.contains(named), "{transcript}");
        for spot in 1..=10 {
            let settled = format!("settled spot={spot}");
            assert!(transcript.contains(&settled), "{transcript}");
        }
    })
    .unwrap();
}

/// The cells between the farthest of four modules and the target are more than a plan may search.
/// Shows X13.
#[test]
fn a_module_that_is_too_far_away_for_a_plan_leaves_service_and_the_others_form() {
    let problem = scenario(
        "target: {map: 'o-o-o'}
singletons: [{id: 1, x: 0, y: 6}, {id: 2, x: 2, y: 6}, {id: 3, x: 4, y: 6}, {id: 4, x: 50000, y: 50000}]",
    );
    let mut trial = Trial::new(&problem, 3);
    trial.until(|cluster| settled(cluster).len() == 3);
    let cannot_reach =
        |event: &Event| matches!(event, Event::CannotReach(MotionError::FieldTooLarge(_)));
    assert_eq!(trial.count(cannot_reach), 1);
    assert!(
        settled(&trial.cluster)
            .iter()
            .all(|&(module, _)| module != ModuleId(4))
    );
}

/// The first module of a pair dies on its way, and may be anywhere on the rest of that: also where the second one stands.
/// Shows X13.
#[test]
fn a_module_that_found_no_path_moves_again_when_the_body_is_back() {
    let problem = scenario(
        "target: {map: 'o-o-o-o'}
configurations: [{id: 1, modules: [{id: 1, x: 13, y: 0}, {id: 2, x: 12, y: 0}], edges: [[1, 2]]}]
singletons: [{id: 3, x: 0, y: 9}, {id: 4, x: 2, y: 9}]",
    );
    let parameters = ClusterParameters {
        speed_units_per_s: 0.3,
        ..ClusterParameters::default()
    };
    let mut trial = Trial::with(&problem, parameters, 3);
    let (dies, waits) = (ModuleId(1), ModuleId(2));
    trial.until(|cluster| cluster.is_moving(dies));
    trial.run_for(Duration::from_secs(2));
    trial.cluster.crash(dies);
    trial.run_for(Duration::from_secs(60));
    let left = |event: &Event| matches!(event, Event::InvalidStart(_) | Event::CannotReach(_));
    assert_eq!(trial.count(left), 1);
    trial.cluster.restart(dies);
    trial.until(|cluster| settled(cluster).len() == 4);
    let back = |(module, event): &(ModuleId, Event)| {
        *module == waits && matches!(event, Event::MayMoveAgain)
    };
    assert!(trial.noted.iter().any(back));
    assert_eq!(trial.settled().len(), 4);
}

/// Shows X8.
#[test]
fn modules_that_do_not_wait_for_each_other_meet() {
    let agents = AgentFactory::new(|identity, parameters, now| {
        Agent::new(identity, parameters, now).mutated(Mutation::SkipWaits)
    });
    let parameters = CampaignParameters {
        agents,
        modules_min: 16,
        ..parameters(FaultKind::None, Apart::Circles)
    };
    let mut met = 0;
    run_seeds(&parameters, 0..20, |report| {
        let mut kinds = report.violations.iter().map(|one| one.kind);
        met += u32::from(kinds.any(|kind| kind == ViolationKind::BodiesOverlap));
    })
    .unwrap();
    assert!(met >= 15, "found in {met} of 20 runs");
}

/// A slow process repeats a goal that its drive has reached meanwhile, so that the drive reports the same arrival twice: the
/// second is not one at the next goal.
/// Shows A7.
#[test]
fn an_arrival_counts_for_the_goal_that_was_reached() {
    let problem = scenario(
        "
target: {spots: [{id: 1, x: 4, y: 0}], edges: []}
singletons: [{id: 1, x: 0, y: 0}]
",
    );
    let mut agent = agent(&problem.modules()[0]);
    let target = Message::Target(Arc::new(TargetAnnouncement {
        expected_modules: Some(1),
        ..TargetAnnouncement::new(&problem, 1)
    }));
    let (source, message) = (None, target);
    agent.handle(Duration::ZERO, Input::Message { source, message });
    let mut now = Duration::ZERO;
    let mut goals = Vec::new();
    while goals.len() < 2 {
        assert!(now < Duration::from_secs(30), "{:?}", agent.phase());
        let mut arrived = None;
        while let Some(output) = agent.poll_output() {
            if let Output::Move(goal) = output
                && goals.last() != Some(&goal.pose)
            {
                goals.push(goal.pose);
                arrived = (goals.len() < 2).then_some(goal.pose);
            }
        }
        if let Some(goal) = arrived {
            let pose = goal;
            agent.handle(now, Input::Motion(MotionReport::Arrived { goal, pose }));
        } else {
            now = agent.poll_timeout().max(now + Duration::from_millis(1));
            agent.handle(now, Input::Timeout);
        }
    }
    let ahead = agent.path_ahead();
    let (goal, pose) = (goals[0], goals[0]);
    agent.handle(now, Input::Motion(MotionReport::Arrived { goal, pose }));
    assert_eq!(agent.path_ahead(), ahead);
    let (goal, pose) = (goals[1], goals[1]);
    agent.handle(now, Input::Motion(MotionReport::Arrived { goal, pose }));
    assert_eq!(agent.path_ahead().len(), ahead.len() - 1);
}

/// Three modules are on their way to three spots when a fourth starts, whose body stands between them and the spots.
#[test]
fn a_module_that_starts_in_the_way_of_others_is_led_around() {
    let text = "target: {map: 'o-o-o'}\nsingletons: [{id: 1, x: 0, y: 12}, {id: 2, x: 1, y: 12}, \
                {id: 3, x: 2, y: 12}, {id: 4, x: 1, y: 6}]";
    let parameters = ClusterParameters {
        speed_units_per_s: 0.3,
        ..ClusterParameters::default()
    };
    let late = ModuleId(4);
    let mut trial = Trial::with(&scenario(text), parameters, 3);
    trial.cluster.start_late(late, Duration::from_secs(40));
    let mut nearest = f64::INFINITY;
    trial.until(|cluster| {
        let body = |module| cluster.body(module).unwrap();
        for module in [1, 2, 3].map(ModuleId) {
            nearest = nearest.min(body(module).distance_to(&body(late)).to_units());
        }
        cluster.running().contains(&late) && cluster.has_formed()
    });
    assert!(nearest >= 0.99, "{nearest}");
    let named = |event: &Event| {
        let bodies = vec![late];
        matches!(event, Event::Convened(_, EpochReason::BodiesUnlisted(modules)) if *modules == bodies)
    };
    assert!(trial.count(named) > 0);
}
