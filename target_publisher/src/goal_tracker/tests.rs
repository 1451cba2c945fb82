//! Goals that end in every way that there is.

use std::sync::Arc;

use formation_model::{
    Epoch, Heartbeat, Incarnation, ModuleId, ModulePhase, Roster, RosterMember, RosterMessage,
    Scenario, Service, TargetAnnouncement, Voters,
};

use super::*;

const SCENARIO: &str = "
name: pair
target: {spots: [{id: 1, x: 5.0, y: 5.0}, {id: 2, x: 6.0, y: 5.0}], edges: [[1, 2]]}
singletons: [{id: 1, x: 3.0, y: 9.5}, {id: 2, x: 0.0, y: 0.0}]
";
const FRESH: u64 = 100;
const EPOCH: Epoch = Epoch {
    number: 1,
    convener: ModuleId(1),
};

fn limits() -> PublisherParameters {
    PublisherParameters {
        verdict_limit: Duration::from_secs(60),
        ..PublisherParameters::default()
    }
}

fn at(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

fn stamp(seconds: i32) -> Time {
    Time::new(seconds, 0)
}

fn pair() -> Result<TargetAnnouncement, String> {
    let scenario = Scenario::from_yaml(SCENARIO).unwrap();
    Ok(TargetAnnouncement {
        name: scenario.name().to_owned(),
        expected_modules: Some(2),
        ..TargetAnnouncement::new(scenario.problem(), 0)
    })
}

/// A tracker that has begun with one goal at second 1, whose result a client waits for.
fn begun() -> (GoalTracker<u32>, GoalId) {
    let mut tracker = GoalTracker::default();
    let goal = GoalId::new_random();
    assert!(tracker.begin(at(1), stamp(1_000), goal, FRESH, pair()));
    tracker.ask(goal, 7);
    assert_eq!(tracker.take_answers(), []);
    (tracker, goal)
}

/// How the goal has ended for the client that waited for it, if it has.
fn ended(tracker: &mut GoalTracker<u32>, now: Duration) -> Option<(GoalStatusEnum, String)> {
    tracker.advance(now, &limits());
    let mut answers = tracker.take_answers();
    assert!(answers.len() <= 1);
    let (client, status, result) = answers.pop()?;
    assert_eq!(client, 7);
    Some((status, result.message))
}

fn beat(tracker: &mut GoalTracker<u32>, now: Duration, module: u32, phase: ModulePhase) {
    let heartbeat = Heartbeat {
        sequence: u64::try_from(now.as_millis()).unwrap(),
        uptime: now,
        phase,
        ..Heartbeat::first(ModuleId(module).run(Incarnation(1)))
    };
    tracker.handle_message(now, &Message::Heartbeat(heartbeat));
}

fn verdict(outcome: u8, epoch: Option<&Epoch>, found: i32) -> Verdict {
    let mut verdict = Verdict {
        outcome,
        epoch: epoch.into(),
        filled_spots: 2,
        spots: 2,
        ..Verdict::default()
    };
    verdict.header.stamp.sec = found;
    verdict
}

/// The modules plan for what is announced.
fn plan(tracker: &mut GoalTracker<u32>, now: Duration) {
    let scenario = Scenario::from_yaml(SCENARIO).unwrap();
    let modules = scenario.problem().modules().iter();
    let roster = Roster {
        timing: formation_model::Timing {
            heartbeat: Duration::from_millis(500),
            suspicion: Duration::from_secs(5),
            lease: Duration::from_millis(2_500),
        },
        epoch: EPOCH,
        target: tracker.status.own().unwrap().as_ref().clone(),
        members: modules
            .map(|module| RosterMember {
                knows: true,
                is_idle: true,
                incarnation: Incarnation(1),
                service: Service::Active,
                module: module.clone(),
            })
            .collect(),
        voters: Voters::default(),
        bodies: Vec::new(),
    };
    let plan = RosterMessage::Plan(Arc::new(roster.into()));
    tracker.handle_message(now, &Message::Roster(plan));
}

#[test]
fn a_verdict_on_its_plan_ends_a_goal_and_one_on_another_does_not() {
    let (mut tracker, _) = begun();
    let complete = verdict(Verdict::OUTCOME_COMPLETE, Some(&EPOCH), 1_002);
    tracker.status.handle_verdict(at(2), complete);
    assert_eq!(
        ended(&mut tracker, at(2)),
        None,
        "no roster shows that epoch"
    );
    plan(&mut tracker, at(3));
    let message = "COMPLETE: 2 of 2 spots are filled".to_owned();
    let succeeded = Some((GoalStatusEnum::Succeeded, message));
    assert_eq!(ended(&mut tracker, at(3)), succeeded);

    // The same again is done as soon as it is asked for.
    let again = GoalId::new_random();
    tracker.begin(at(4), stamp(1_004), again, FRESH, pair());
    tracker.ask(again, 7);
    assert_eq!(ended(&mut tracker, at(4)), succeeded);
}

#[test]
fn failure_counts_if_it_was_found_after_the_goal_began() {
    let (mut tracker, _) = begun();
    let mut failed = verdict(Verdict::OUTCOME_FAILED, None, 999);
    tracker.status.handle_verdict(at(2), failed.clone());
    assert_eq!(ended(&mut tracker, at(2)), None, "of an earlier target");
    failed.header.stamp.sec = 1_003;
    failed.violations = vec!["no roster".to_owned()];
    tracker.status.handle_verdict(at(3), failed);
    let (status, message) = ended(&mut tracker, at(3)).unwrap();
    assert_eq!(status, GoalStatusEnum::Aborted);
    assert!(message.ends_with("no roster"), "{message}");
}

#[test]
fn a_goal_without_a_verdict_ends_when_its_time_is_up() {
    let (mut tracker, _) = begun();
    assert_eq!(tracker.due(&limits()), Some(at(1)), "feedback");
    assert!(tracker.take_feedback(at(1)).is_some());
    assert_eq!(ended(&mut tracker, at(60)), None);
    assert!(tracker.take_feedback(at(60)).is_some());
    assert_eq!(tracker.due(&limits()), Some(at(61)));
    let (status, message) = ended(&mut tracker, at(61)).unwrap();
    assert_eq!(status, GoalStatusEnum::Aborted);
    assert!(message.contains("verdict_limit_s (60 s)"), "{message}");
    assert!(tracker.status.own().unwrap().target.is_some());
}

#[test]
fn feedback_is_repeated_for_clients_that_were_matched_late() {
    let (mut tracker, goal) = begun();
    let first = tracker.take_feedback(at(1)).unwrap();
    assert_eq!(first.0, goal);
    assert_eq!(tracker.take_feedback(at(1)), None);
    let due = tracker.due(&limits()).unwrap();
    assert_eq!(due, at(2));
    assert_eq!(tracker.take_feedback(due), Some(first));
    assert_eq!(tracker.take_feedback(due), None);
}

#[test]
fn a_cancelled_goal_withdraws_its_target_and_ends_when_the_modules_stand() {
    let (mut tracker, goal) = begun();
    beat(&mut tracker, at(2), 1, ModulePhase::Moving);
    beat(&mut tracker, at(2), 2, ModulePhase::Settled);
    let meant = GoalInfo {
        goal_id: goal,
        stamp: Time::ZERO,
    };
    let response = tracker.cancel(at(3), FRESH, &meant);
    assert_eq!(response.goals_canceling.len(), 1);
    assert!(tracker.status.own().unwrap().target.is_none());
    assert_eq!(ended(&mut tracker, at(3)), None, "they do not know yet");
    beat(&mut tracker, at(4), 2, ModulePhase::Listening);
    assert_eq!(ended(&mut tracker, at(4)), None, "one is on its way");
    beat(&mut tracker, at(5), 1, ModulePhase::Listening);
    let (status, message) = ended(&mut tracker, at(5)).unwrap();
    assert_eq!(status, GoalStatusEnum::Canceled);
    assert!(message.ends_with("the 2 live modules stand still"));
}

#[test]
fn who_does_not_say_that_it_stands_is_named() {
    let (mut tracker, _) = begun();
    let all = GoalInfo {
        goal_id: GoalId::ZERO,
        stamp: Time::ZERO,
    };
    tracker.cancel(at(2), FRESH, &all);
    for now in 2..12 {
        beat(&mut tracker, at(now), 1, ModulePhase::Moving);
        assert_eq!(ended(&mut tracker, at(now)), None);
    }
    let (status, message) = ended(&mut tracker, at(12)).unwrap();
    assert_eq!(status, GoalStatusEnum::Canceled);
    assert!(message.contains("standstill_limit_s (10 s)"), "{message}");
    assert!(message.ends_with("stand still: 1"), "{message}");
}

#[test]
fn a_cancelled_goal_does_not_wait_for_modules_that_have_another_target() {
    let (mut tracker, goal) = begun();
    beat(&mut tracker, at(2), 1, ModulePhase::Moving);
    let meant = GoalInfo {
        goal_id: goal,
        stamp: Time::ZERO,
    };
    tracker.cancel(at(3), FRESH, &meant);
    assert_eq!(ended(&mut tracker, at(3)), None, "one is on its way");
    let other = TargetAnnouncement {
        revision: 500,
        ..pair().unwrap()
    };
    tracker.handle_message(at(4), &Message::Target(Arc::new(other)));
    let (status, message) = ended(&mut tracker, at(4)).unwrap();
    assert_eq!(status, GoalStatusEnum::Canceled);
    assert!(message.contains("revision 500"), "{message}");
}

#[test]
fn what_cannot_be_formed_is_rejected_and_leaves_the_goal_on_its_way() {
    let (mut tracker, _) = begun();
    let other = GoalId::new_random();
    let wrong = Err("scenario: there is none".to_owned());
    assert!(!tracker.begin(at(2), stamp(1_002), other, FRESH, wrong));
    tracker.ask(other, 8);
    let answers = tracker.take_answers();
    assert_eq!((answers[0].0, answers[0].1), (8, GoalStatusEnum::Unknown));
    assert_eq!(tracker.status.own().unwrap().revision, FRESH);
    assert_eq!(ended(&mut tracker, at(3)), None);
}

#[test]
fn whatever_replaces_its_target_ends_a_goal() {
    let (mut tracker, _) = begun();
    let newer = GoalId::new_random();
    tracker.begin(at(2), stamp(1_002), newer, FRESH, pair());
    let message = "a newer goal took its place".to_owned();
    let aborted = Some((GoalStatusEnum::Aborted, message));
    assert_eq!(ended(&mut tracker, at(2)), aborted);

    let (mut tracker, _) = begun();
    let other = TargetAnnouncement {
        revision: 500,
        ..pair().unwrap()
    };
    tracker.handle_message(at(2), &Message::Target(Arc::new(other)));
    let (_, message) = ended(&mut tracker, at(2)).unwrap();
    assert!(message.contains("revision 500"), "{message}");

    let (mut tracker, _) = begun();
    tracker.status.withdraw(at(2), FRESH, 0).unwrap();
    let (_, message) = ended(&mut tracker, at(2)).unwrap();
    assert_eq!(message, "revision 101 withdrew the target");
}
