//! A robot that stands still is measured again and again, each time a little off.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use formation::model::{
    Incarnation, Message, ModuleId, ModulePhase, Pose, RosterMessage, Scenario, TargetAnnouncement,
};
use formation::protocol::{
    Agent, AgentParameters, Event, Identity, Input, MotionReport, Output, SourceId,
};

const PAIR: &str = "
target: {spots: [{id: 1, x: 5.0, y: 5.0}, {id: 2, x: 6.0, y: 5.0}], edges: [[1, 2]]}
singletons: [{id: 1, x: 3.0, y: 9.0}, {id: 2, x: 0.0, y: 0.0}]
";

/// Module 2 measures another pose while the roster is on its way to it, within the least time between two published poses.
#[test]
fn a_pose_that_is_measured_again_is_no_contradiction_of_a_roster() {
    let problem = Scenario::from_yaml(PAIR).unwrap().problem().clone();
    let mut agents: Vec<Agent> = problem
        .modules()
        .iter()
        .map(|module| {
            let identity = Identity {
                store: None,
                module: module.id,
                incarnation: Incarnation(1),
                pose: module.pose,
                links: BTreeSet::new(),
                configuration: None,
                leader: None,
            };
            Agent::new(identity, AgentParameters::default(), Duration::ZERO)
        })
        .collect();
    let mut now = Duration::ZERO;
    let target = Message::Target(Arc::new(TargetAnnouncement::new(&problem, 1)));
    let mut under_way: VecDeque<(usize, Option<SourceId>, Message)> = (0..2)
        .map(|to| (to, Some(SourceId(9)), target.clone()))
        .collect();
    let mut measured = 0;
    while agents
        .iter()
        .any(|agent| agent.phase() != ModulePhase::Settled)
    {
        assert!(now < Duration::from_secs(60), "{:?}", agents[1].phase());
        for (index, agent) in agents.iter_mut().enumerate() {
            while let Some(output) = agent.poll_output() {
                let report = match output {
                    Output::Publish(message) => {
                        let source = Some(SourceId(index as u128));
                        under_way.push_back((1 - index, source, message));
                        continue;
                    }
                    Output::Event(event) => {
                        assert!(!matches!(event, Event::Refused { .. }), "{event:?}");
                        continue;
                    }
                    Output::Move(goal) => MotionReport::Arrived {
                        goal: goal.pose,
                        pose: goal.pose,
                    },
                    Output::Halt => MotionReport::Halted(agent.pose()),
                    Output::Dock(other) => MotionReport::Docked(other),
                    Output::Undock(other) => MotionReport::Undocked(other),
                    _ => continue,
                };
                agent.handle(now, Input::Motion(report));
            }
        }
        if let Some((to, source, message)) = under_way.pop_front() {
            let is_roster = matches!(&message, Message::Roster(RosterMessage::Plan(_)));
            if is_roster && to == 1 {
                let pose = Pose::from_units(0.0, 0.03, 0.0).unwrap();
                agents[to].handle(now, Input::Motion(MotionReport::Pose(pose)));
                measured += 1;
            }
            agents[to].handle_messages(now, [(source, message)]);
        } else {
            let due = agents.iter().map(|agent| agent.poll_timeout()).min();
            now = due.unwrap().max(now + Duration::from_millis(1));
            for agent in &mut agents {
                agent.handle(now, Input::Timeout);
            }
        }
    }
    assert_eq!(measured, 1, "one roster");
    assert_eq!(
        agents[1].epoch().map(|epoch| epoch.convener),
        Some(ModuleId(1))
    );
}
