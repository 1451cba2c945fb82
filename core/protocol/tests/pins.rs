//! The spot that a settled module keeps, as its states show it.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    Epoch, Heartbeat, Incarnation, Message, ModuleId, ModulePhase, ModuleRun, Pose, RosterMessage,
    Scenario, Service, SpotId, Stop, TargetAnnouncement, Voters, digest,
};
use formation_protocol::{Agent, AgentParameters, DurableState, Identity, Input, Output};

const CONVENER: ModuleRun = ModuleRun {
    module: ModuleId(1),
    incarnation: Incarnation(7),
};

const EPOCH: Epoch = Epoch {
    number: 3,
    convener: ModuleId(1),
};

/// A target whose second spot is at this place.
fn target(revision: u64, x: u32) -> Arc<TargetAnnouncement> {
    let scenario = format!(
        "target: {{spots: [{{id: 1, x: {}, y: 5}}, {{id: 2, x: {x}, y: 5}}], edges: [[1, 2]]}}
singletons: [{{id: 1, x: 1, y: 1}}, {{id: 2, x: 1, y: 3}}]",
        x - 1
    );
    let scenario = Scenario::from_yaml(&scenario).unwrap();
    Arc::new(TargetAnnouncement::new(scenario.problem(), revision))
}

/// Module 2, which has settled on the second spot of a target in an earlier epoch.
fn settled_for(target: &TargetAnnouncement) -> Agent {
    let pose = Pose::from_units(6.0, 5.0, 0.0).unwrap();
    let run = ModuleId(2).run(Incarnation(5));
    let agent = Agent::new(
        Identity::single(run, pose),
        AgentParameters::default(),
        Duration::ZERO,
    );
    agent.restored(Some(DurableState {
        entered: None,
        highest: None,
        knows: true,
        voters: Voters::default(),
        service: Service::Active,
        settled_on: Some((SpotId(2), digest::of_target(target))),
        pose,
        links: BTreeSet::new(),
        bodies: [].into(),
        stop: Stop::default(),
    }))
}

/// The convener has not heard of the second target, in which the spot is elsewhere.
/// Shows P1.
#[test]
fn a_spot_is_kept_for_its_target_whatever_other_target_is_known() {
    let (first, second) = (target(1, 6), target(2, 16));
    let mut agent = settled_for(&first);
    let gather = RosterMessage::Gather {
        epoch: EPOCH,
        target_revision: 1,
        target: digest::of_target(&first),
    };
    let heartbeat = |sequence: u64| {
        Message::Heartbeat(Heartbeat {
            sequence,
            uptime: Duration::from_millis(500) * u32::try_from(sequence).unwrap(),
            epoch: Some(EPOCH),
            phase: ModulePhase::Gathered,
            ..Heartbeat::first(CONVENER)
        })
    };
    let messages = [
        Message::Target(first),
        Message::Target(second),
        heartbeat(1),
        Message::Roster(gather),
        heartbeat(2),
    ];
    let mut frozen = None;
    for (half, message) in (1_u32..).zip(messages) {
        let (now, source) = (Duration::from_millis(500) * half, None);
        agent.handle(now, Input::Message { source, message });
        agent.handle(now, Input::Timeout);
        while let Some(output) = agent.poll_output() {
            match output {
                Output::Publish(Message::ModuleState(state))
                    if state.phase == ModulePhase::Gathered =>
                {
                    frozen = Some(state);
                }
                _ => {}
            }
        }
    }
    let frozen = frozen.unwrap();
    assert_eq!((frozen.epoch, frozen.spot), (Some(EPOCH), Some(SpotId(2))));
}
