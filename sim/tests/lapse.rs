//! A module that moves halts as soon as the latest heartbeat of another member exceeds the lease, and not with its own next one.

use std::sync::Arc;
use std::time::Duration;

use formation_model::{DriveState, Message, ModuleId, ModuleState, Pose, TargetAnnouncement};
use formation_motion::MotionReport;
use formation_protocol::{Agent, AgentParameters, Input, Output};

use crate::support::{agent, scenario};

const SCENARIO: &str = "
target: {spots: [{id: 1, x: 50.0, y: 0.0}, {id: 2, x: 51.0, y: 0.0}], edges: [[1, 2]]}
singletons: [{id: 4, x: 0.0, y: 0.0}, {id: 9, x: 0.0, y: 3.0}]
";

/// Two modules whose messages take no time, and which never arrive.
struct Pair {
    agents: [Agent; 2],
    now: Duration,
    /// When each sent its latest heartbeat.
    heartbeats: [Duration; 2],
    moving: [bool; 2],
    /// The latest goal of each.
    goals: [Option<Pose>; 2],
    /// The latest state of each.
    states: [Option<ModuleState>; 2],
}

impl Pair {
    fn new() -> Self {
        let problem = scenario(SCENARIO);
        let mut pair = Self {
            agents: [0, 1].map(|index: usize| agent(&problem.modules()[index])),
            now: Duration::ZERO,
            heartbeats: [Duration::ZERO; 2],
            moving: [false; 2],
            goals: [None; 2],
            states: [None, None],
        };
        let target = Arc::new(TargetAnnouncement {
            expected_modules: Some(2),
            voters: vec![ModuleId(4), ModuleId(9)],
            ..TargetAnnouncement::new(&problem, 1)
        });
        for index in 0..2 {
            let target = Message::Target(Arc::clone(&target));
            pair.pass(index, message(target), &[0, 1]);
        }
        pair
    }

    /// Passes an input to one of those that are awake, and what it says to the other, if that is awake.
    fn pass(&mut self, index: usize, input: Input, awake: &[usize]) {
        if !awake.contains(&index) {
            return;
        }
        self.agents[index].handle(self.now, input);
        while let Some(output) = self.agents[index].poll_output() {
            match output {
                Output::Publish(said) => {
                    match &said {
                        Message::Heartbeat(_) => self.heartbeats[index] = self.now,
                        Message::ModuleState(state) => self.states[index] = Some((**state).clone()),
                        _ => {}
                    }
                    self.pass(1 - index, message(said), awake);
                }
                Output::Move(goal) => {
                    self.moving[index] = true;
                    self.goals[index] = Some(goal.pose);
                }
                Output::Halt => {
                    self.moving[index] = false;
                    let pose = self.agents[index].pose();
                    self.agents[index].handle(self.now, Input::Motion(MotionReport::Halted(pose)));
                }
                _ => {}
            }
        }
    }

    fn until(&mut self, awake: &[usize], is_there: impl Fn(&Self) -> bool) {
        while !is_there(self) {
            let due = |&index: &usize| self.agents[index].poll_timeout();
            let due = awake.iter().map(due).min().unwrap();
            self.now = due.max(self.now + Duration::from_micros(1));
            assert!(self.now < Duration::from_secs(60), "nothing happens");
            for &index in awake {
                if self.agents[index].poll_timeout() <= self.now {
                    self.pass(index, Input::Timeout, awake);
                }
            }
        }
    }
}

fn message(message: Message) -> Input {
    let source = None;
    Input::Message { source, message }
}

#[test]
fn a_moving_module_halts_as_soon_as_another_is_silent_for_longer_than_the_lease() {
    let mut pair = Pair::new();
    pair.until(&[0, 1], |pair| pair.moving.contains(&true));
    let mover = pair.moving.iter().position(|&moves| moves).unwrap();
    let silent_since = pair.heartbeats[1 - mover];
    pair.until(&[mover], |pair| !pair.moving[mover]);
    let lapse = silent_since + AgentParameters::default().lease;
    assert!(pair.now > lapse, "agreement held until {lapse:?}");
    let margin = Duration::from_millis(1);
    assert!(pair.now <= lapse + margin, "{:?}, {lapse:?}", pair.now);
}

/// Observers take a module to move straight on from one of its states to the next, so where it waits for agreement between
/// two steps has to be among them.
#[test]
fn a_module_that_ends_a_step_without_agreement_publishes_where_it_stands() {
    let mut pair = Pair::new();
    pair.until(&[0, 1], |pair| pair.moving.contains(&true));
    let mover = pair.moving.iter().position(|&moves| moves).unwrap();
    let goal = pair.goals[mover].unwrap();
    pair.now =
        pair.heartbeats[1 - mover] + AgentParameters::default().lease + Duration::from_millis(1);
    let arrived = MotionReport::Arrived { goal, pose: goal };
    pair.pass(mover, Input::Motion(arrived), &[mover]);
    let state = pair.states[mover].clone().unwrap();
    assert_eq!((state.steps_done, state.pose), (Some(1), goal));
    assert_ne!(state.drive, DriveState::Moving);
}
