//! Two runs of one module's process, from the view of the later run.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    BodyReport, Heartbeat, Incarnation, Message, ModuleId, ModulePhase, ModuleState, Pose,
    STAMP_AHEAD_MAX, Scenario, SourceId, TargetAnnouncement, Whereabouts,
};
use formation_protocol::{Agent, AgentParameters, Identity, Input, Output, Replica};

const SCENARIO: &str = "
target: {spots: [{id: 1, x: 5.0, y: 5.0}], edges: []}
singletons: [{id: 4, x: 1.0, y: 2.0}]
";

fn at(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

/// The later run of module 4 at time `now`, alone with a target.
fn successor(now: Duration) -> Agent {
    run_with(false, 1, now)
}

/// The same among this number of modules, with a store or without.
fn run_with(has_store: bool, expected: u32, now: Duration) -> Agent {
    let mut agent = run(has_store);
    handle(&mut agent, Duration::ZERO, target_for(expected));
    let mut time = Duration::ZERO;
    while time < now {
        time = agent.poll_timeout().max(time + Duration::from_millis(1));
        agent.handle(time.min(now), Input::Timeout);
        while let Some(output) = agent.poll_output() {
            if let Output::Persist { number, .. } = output {
                agent.handle(time.min(now), Input::Persisted(number));
            }
        }
    }
    agent
}

fn target_for(expected: u32) -> Message {
    let scenario = Scenario::from_yaml(SCENARIO).unwrap();
    Message::Target(Arc::new(TargetAnnouncement {
        expected_modules: Some(expected),
        ..TargetAnnouncement::new(scenario.problem(), 1)
    }))
}

fn run(has_store: bool) -> Agent {
    let scenario = Scenario::from_yaml(SCENARIO).unwrap();
    let problem = scenario.problem();
    let module = &problem.modules()[0];
    let identity = Identity {
        has_store,
        is_first_run: true,
        ..Identity::single(module.id.run(Incarnation(2)), module.pose)
    };
    Agent::new(identity, AgentParameters::default(), Duration::ZERO)
}

/// The incarnations in the heartbeats of an agent between these seconds, in which its store writes or does not.
fn incarnations(agent: &mut Agent, begin: u64, end: u64, writes: bool) -> BTreeSet<u64> {
    let mut shown = BTreeSet::new();
    let mut time = at(begin);
    while time < at(end) {
        agent.handle(time, Input::Timeout);
        while let Some(output) = agent.poll_output() {
            match output {
                Output::Publish(Message::Heartbeat(heartbeat)) => {
                    shown.insert(heartbeat.incarnation.0);
                }
                Output::Persist { .. } if !writes => {}
                Output::Persist { number, .. } => agent.handle(time, Input::Persisted(number)),
                _ => {}
            }
        }
        time += Duration::from_millis(500);
    }
    shown
}

/// A state in which module 5 reports the body of a run of module 4.
fn report_on_run(incarnation: u64) -> Message {
    let pose = Pose::from_units(1.0, 2.0, 0.0).unwrap();
    let report = BodyReport {
        module: ModuleId(4),
        incarnation: Incarnation(incarnation),
        epoch: None,
        sequence: 1,
        whereabouts: Whereabouts::Seen(pose),
    };
    let module = ModuleId(5).run(Incarnation(1));
    Message::ModuleState(Arc::new(ModuleState {
        sequence: 1,
        bodies: vec![report],
        ..ModuleState::standing(module, Pose::default())
    }))
}

fn handle(agent: &mut Agent, now: Duration, message: Message) -> Vec<String> {
    let source = Some(SourceId(7));
    agent.handle(now, Input::Message { source, message });
    let mut events = Vec::new();
    while let Some(output) = agent.poll_output() {
        if let Output::Event(event) = output {
            events.push(event.to_string());
        }
    }
    events
}

fn heartbeat_of_the_earlier_run() -> Message {
    heartbeat_of(1)
}

fn heartbeat_of(incarnation: u64) -> Message {
    Message::Heartbeat(heartbeat(incarnation))
}

fn heartbeat(incarnation: u64) -> Heartbeat {
    Heartbeat {
        sequence: 100,
        uptime: at(500),
        ..Heartbeat::first(ModuleId(4).run(Incarnation(incarnation)))
    }
}

/// Shows M4.
#[test]
fn a_later_run_yields_to_an_earlier_one_that_still_sends_heartbeats() {
    let mut agent = successor(at(1));
    assert!(agent.epoch().is_some(), "alone it has opened an epoch");
    let events = handle(&mut agent, at(1), heartbeat_of_the_earlier_run());
    assert!(
        events
            .iter()
            .any(|line| line.contains("a second process runs as module 4"))
    );
    assert_eq!(agent.phase(), ModulePhase::Listening);
}

/// Shows M4.
#[test]
fn an_earlier_run_that_resumes_does_not_replace_its_successor() {
    let mut agent = successor(at(6));
    let phase = agent.phase();
    assert_ne!(phase, ModulePhase::Listening);
    let events = handle(&mut agent, at(6), heartbeat_of_the_earlier_run());
    assert!(
        events
            .iter()
            .any(|line| line.contains("a second process runs as module 4"))
    );
    assert_eq!(agent.phase(), phase);
}

/// Shows M7.
#[test]
fn a_run_goes_on_above_a_later_one_that_is_silent() {
    for has_store in [false, true] {
        let mut agent = run_with(has_store, 2, at(6));
        handle(&mut agent, at(6), report_on_run(9));
        agent.handle(at(6), Input::Persisted(u64::MAX));
        let before = incarnations(&mut agent, 6, 11, true);
        assert_eq!(before, [2].into(), "it stands back for suspicion_s");
        if has_store {
            let unwritten = incarnations(&mut agent, 11, 14, false);
            assert_eq!(
                unwritten,
                [2].into(),
                "the store does not hold the number yet"
            );
            agent.handle(at(14), Input::Persisted(u64::MAX));
        }
        let after = incarnations(&mut agent, 14, 16, true);
        assert_eq!(after.len(), 1, "{after:?}");
        assert!(after.into_iter().all(|incarnation| incarnation > 9));
    }
}

#[test]
fn a_run_that_holds_a_plan_leaves_it_for_a_later_number() {
    let mut agent = successor(at(20));
    assert!(agent.digest().is_some(), "it holds a plan for itself");
    handle(&mut agent, at(20), report_on_run(9));
    assert_eq!(agent.digest(), None);
    let shown = incarnations(&mut agent, 20, 30, true);
    assert!(shown.iter().max() > Some(&9), "{shown:?}");
}

#[test]
fn a_run_stays_below_a_later_one_as_long_as_that_sends() {
    let mut agent = run_with(false, 2, at(6));
    handle(&mut agent, at(6), report_on_run(9));
    for second in 6..60 {
        handle(&mut agent, at(second), heartbeat_of(9));
        let shown = incarnations(&mut agent, second, second + 1, true);
        assert!(shown.iter().all(|&shown| shown == 2), "{shown:?}");
    }
}

/// Each learned of the other while that did not send: the later one goes on.
#[test]
fn two_processes_of_one_module_do_not_stand_back_for_each_other_for_good() {
    let mut agent = run(false);
    handle(&mut agent, at(0), report_on_run(9));
    handle(&mut agent, at(0), target_for(1));
    incarnations(&mut agent, 0, 7, true);
    assert!(agent.run().incarnation > Incarnation(9));
    for second in 7..30 {
        handle(&mut agent, at(second), heartbeat_of(9));
        incarnations(&mut agent, second, second + 1, true);
    }
    assert_ne!(agent.phase(), ModulePhase::Listening);
}

/// A number that a store or a former run has raised does not raise what counts as plausible.
#[test]
fn what_is_plausible_follows_the_clock_and_not_the_number_of_the_run() {
    let mut agent = run(false).started_at(0);
    let mut by_its_number = run(false);
    let ahead = Message::Heartbeat(Heartbeat {
        module: ModuleId(5),
        incarnation: Incarnation(STAMP_AHEAD_MAX + 1),
        ..heartbeat(1)
    });
    for (agent, refused) in [(&mut agent, 1), (&mut by_its_number, 0)] {
        handle(agent, at(0), ahead.clone());
        assert_eq!(agent.refusals().total(), refused);
    }
}

/// A heartbeat of module 5 from a participant.
fn beat_of_fifth(incarnation: u64, sequence: u64, source: SourceId) -> Input {
    let message = Message::Heartbeat(Heartbeat {
        sequence,
        uptime: Duration::from_millis(500 * sequence),
        ..Heartbeat::first(ModuleId(5).run(Incarnation(incarnation)))
    });
    Input::Message {
        source: Some(source),
        message,
    }
}

/// Shows M9.
#[test]
fn who_has_left_is_silent_at_once_and_its_next_run_is_let_in() {
    let mut replica = Replica::default();
    replica.add(at(0), run(false));
    let (first, second) = (SourceId(1), SourceId(2));
    let is_live = |replica: &Replica| replica.living().contains_key(&ModuleId(5));
    replica.with(0, |agent| agent.handle(at(1), beat_of_fifth(10, 1, first)));
    replica.with(0, |agent| agent.handle(at(1), beat_of_fifth(20, 1, second)));
    assert!(replica.agents()[0].refusals().total() == 1 && is_live(&replica));
    replica.with(0, |agent| agent.handle(at(1), Input::Departed(second)));
    assert!(is_live(&replica), "another one has left");
    replica.with(0, |agent| agent.handle(at(1), Input::Departed(first)));
    assert!(!is_live(&replica));
    replica.with(0, |agent| agent.handle(at(1), beat_of_fifth(20, 2, second)));
    assert!(replica.agents()[0].refusals().total() == 1 && is_live(&replica));
    replica.with(0, |agent| agent.handle(at(1), beat_of_fifth(10, 2, first)));
    assert_eq!(
        replica.agents()[0].refusals().total(),
        2,
        "the former run is over"
    );
}

/// Shows M9.
#[test]
fn who_was_said_to_have_left_and_sends_is_live() {
    let mut replica = Replica::default();
    replica.add(at(0), run(false));
    let source = SourceId(1);
    let is_live = |replica: &Replica| replica.living().contains_key(&ModuleId(5));
    replica.with(0, |agent| agent.handle(at(1), beat_of_fifth(10, 1, source)));
    replica.with(0, |agent| agent.handle(at(2), Input::Departed(source)));
    assert!(!is_live(&replica));
    // Sent before it left, and received afterwards.
    replica.with(0, |agent| agent.handle(at(2), beat_of_fifth(10, 2, source)));
    assert!(!is_live(&replica));
    replica.with(0, |agent| agent.handle(at(3), beat_of_fifth(10, 5, source)));
    assert!(is_live(&replica));
    replica.with(0, |agent| {
        agent.handle(at(3), beat_of_fifth(20, 1, SourceId(2)));
    });
    assert_eq!(
        replica.agents()[0].refusals().total(),
        1,
        "it is refused until the first is silent"
    );
}
