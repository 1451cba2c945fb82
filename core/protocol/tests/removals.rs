//! Reports that a body was taken away, at one agent.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::time::Duration;

use formation_model::{Heartbeat, Incarnation, Message, ModuleId, ModuleRun, Pose, Removal};
use formation_protocol::{Agent, AgentParameters, Event, Identity, Input, Output, Refusal};

const OTHER: ModuleRun = ModuleRun {
    module: ModuleId(2),
    incarnation: Incarnation(7),
};

fn agent() -> Agent {
    let identity = Identity::single(ModuleId(1).run(Incarnation(5)), Pose::default());
    Agent::new(identity, AgentParameters::default(), Duration::ZERO)
}

/// Handles a message at this second, and returns the events.
fn handle(agent: &mut Agent, second: u64, message: Message) -> Vec<Event> {
    let source = None;
    agent.handle(
        Duration::from_secs(second),
        Input::Message { source, message },
    );
    let outputs = std::iter::from_fn(|| agent.poll_output());
    let events = outputs.filter_map(|output| match output {
        Output::Event(event) => Some(event),
        _ => None,
    });
    events.collect()
}

/// A heartbeat of the other module, sent at this second.
fn heartbeat(sent_at: u64) -> Message {
    Message::Heartbeat(Heartbeat {
        sequence: sent_at,
        uptime: Duration::from_secs(sent_at),
        ..Heartbeat::first(OTHER)
    })
}

/// Shows B5.
#[test]
fn a_report_is_dropped_at_the_first_heartbeat_that_was_sent_after_it() {
    let mut agent = agent();
    for second in [1, 2] {
        handle(&mut agent, second, heartbeat(second));
    }
    let proposed = Event::RemovalProposed(OTHER.module);
    let refuted = Event::RemovalRefuted(OTHER.module);
    let report = || Message::Removal(Removal::of_body(OTHER));
    assert_eq!(handle(&mut agent, 5, report()), [proposed]);
    assert_eq!(handle(&mut agent, 6, report()), [], "a report repeats");
    // They lay in a buffer, or were on their way.
    assert_eq!(handle(&mut agent, 7, heartbeat(4)), []);
    assert_eq!(handle(&mut agent, 7, heartbeat(5)), []);
    assert_eq!(handle(&mut agent, 8, heartbeat(8)), [refuted]);
    // Repetitions are no news.
    assert_eq!(handle(&mut agent, 9, report()), []);
    assert_eq!(handle(&mut agent, 10, heartbeat(10)), []);
}

/// Shows B5.
#[test]
fn a_report_of_an_unknown_run_is_counted_and_has_no_effect() {
    let mut agent = agent();
    handle(&mut agent, 1, heartbeat(1));
    let other = OTHER.module;
    let own = agent.run();
    let runs = [6, 8, u64::MAX].map(|run| other.run(Incarnation(run)));
    let strangers = (3..10_000).map(|module| ModuleId(module).run(Incarnation(7)));
    for run in runs.into_iter().chain(strangers).chain([own]) {
        assert_eq!(
            handle(&mut agent, 2, Message::Removal(Removal::of_body(run))),
            []
        );
    }
    let refused = agent.refusals().of(Refusal::RemovalOfUnknownRun);
    assert_eq!(refused, 3 + 9_997 + 1);
}
