//! Two runs of one module's process, from the view of the later run.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation::model::{
    Heartbeat, Incarnation, Message, ModuleId, ModulePhase, Scenario, Stop, TargetAnnouncement,
};
use formation::protocol::{Agent, AgentParameters, Identity, Input, Output, SourceId};

const SCENARIO: &str = "
target: {spots: [{id: 1, x: 5.0, y: 5.0}], edges: []}
singletons: [{id: 4, x: 1.0, y: 2.0}]
";

fn at(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

/// The later run of module 4 at time `now`, alone with a target.
fn successor(now: Duration) -> Agent {
    let scenario = Scenario::from_yaml(SCENARIO).unwrap();
    let problem = scenario.problem();
    let module = &problem.modules()[0];
    let identity = Identity {
        store: None,
        module: module.id,
        incarnation: Incarnation(2),
        pose: module.pose,
        links: BTreeSet::new(),
        configuration: None,
        leader: None,
    };
    let mut agent = Agent::new(identity, AgentParameters::default(), Duration::ZERO);
    let target = Message::Target(Arc::new(TargetAnnouncement {
        expected_modules: Some(1),
        ..TargetAnnouncement::new(problem, 1)
    }));
    handle(&mut agent, Duration::ZERO, target);
    let mut time = Duration::ZERO;
    while time < now {
        time = agent.poll_timeout().max(time + Duration::from_millis(1));
        agent.handle(time.min(now), Input::Timeout);
        while agent.poll_output().is_some() {}
    }
    agent
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
    Message::Heartbeat(Heartbeat {
        store: None,
        module: ModuleId(4),
        incarnation: Incarnation(1),
        sequence: 100,
        uptime: at(500),
        epoch: None,
        digest: None,
        digest_since: 0,
        applied_turns: 0,
        steps_done: 0,
        phase: ModulePhase::Listening,
        stop: Stop::default(),
    })
}

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
