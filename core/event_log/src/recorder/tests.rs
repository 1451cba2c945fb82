use super::*;
use formation_model::{
    ClosedRoster, Decision, DriveState, MicroUnits, ModulePhase, ModuleRun, PlannerParameters,
    Pose, Roster, SpotId, SpotSelection, TargetAnnouncement, Voters,
};

fn epoch(number: u64) -> Epoch {
    Epoch {
        number,
        convener: ModuleId(1),
    }
}

fn at(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

fn pose(x: i64) -> Pose {
    Pose {
        x: MicroUnits(x),
        ..Pose::default()
    }
}

fn state(module: u32, incarnation: u64, sequence: u64, phase: ModulePhase, x: i64) -> Message {
    let run = ModuleRun {
        module: ModuleId(module),
        incarnation: Incarnation(incarnation),
    };
    Message::ModuleState(Arc::new(ModuleState {
        sequence,
        epoch: Some(epoch(1)),
        phase,
        links: [ModuleId(9)].into(),
        spot: Some(SpotId(3)),
        ..ModuleState::standing(run, pose(x))
    }))
}

fn claim(number: u64, turn: u32, module: u32) -> Message {
    Message::Claim(Arc::new(SpotClaim {
        epoch: epoch(number),
        turn,
        claimant: ModuleId(module),
        incarnation: Incarnation(1),
        decision: Decision {
            selections: vec![SpotSelection {
                spot: SpotId(turn + 1),
                module: ModuleId(module),
            }],
            ..Decision::default()
        },
    }))
}

fn gather(number: u64) -> Message {
    Message::Roster(RosterMessage::Gather {
        epoch: epoch(number),
        target_revision: 1,
        target: formation_model::Digest(0),
    })
}

fn roster(number: u64) -> Message {
    Message::Roster(RosterMessage::Plan(Arc::new(ClosedRoster::from(Roster {
        timing: formation_model::Timing {
            heartbeat: Duration::from_millis(500),
            suspicion: Duration::from_secs(5),
            lease: Duration::from_millis(2_500),
        },
        epoch: epoch(number),
        target: TargetAnnouncement {
            voters: Vec::new(),
            revision: 1,
            name: String::new(),
            target: None,
            parameters: PlannerParameters::default(),
            expected_modules: None,
        },
        members: Vec::new(),
        voters: Voters::default(),
        bodies: Vec::new(),
    }))))
}

/// What a recorder makes of messages that arrive 10 ms after each other.
fn recorded(messages: &[Message]) -> Vec<String> {
    let mut recorder = Recorder::new(POSE_INTERVAL);
    (0..)
        .zip(messages)
        .flat_map(|(index, message)| recorder.record(at(10 * index), message))
        .map(|entry| match entry.event {
            LogEvent::Gathering(epoch) => format!("gathering {}", epoch.number),
            LogEvent::Roster { epoch, .. } => format!("roster {}", epoch.number),
            LogEvent::Claim { epoch, turn, .. } => format!("claim {}.{turn}", epoch.number),
            LogEvent::State(snapshot) => {
                format!("{} is {:?}", snapshot.module, snapshot.phase)
            }
            LogEvent::Pose { module, pose } => format!("{module} at {}", pose.x.0),
        })
        .collect()
}

#[test]
fn claims_come_in_the_order_of_turns_after_their_roster_and_once() {
    assert_eq!(
        recorded(&[
            gather(1),
            claim(1, 1, 5),
            claim(1, 0, 4),
            roster(1),
            roster(1),
            claim(1, 1, 5),
            claim(1, 3, 7),
            claim(1, 2, 6),
        ]),
        [
            "gathering 1",
            "roster 1",
            "claim 1.0",
            "claim 1.1",
            "claim 1.2",
            "claim 1.3"
        ]
    );
}

#[test]
fn late_messages_of_an_older_epoch_are_left_out() {
    assert_eq!(
        recorded(&[
            roster(1),
            claim(1, 0, 4),
            claim(2, 0, 5),
            claim(1, 1, 6),
            gather(1),
            roster(1),
            gather(2),
            roster(2),
        ]),
        ["roster 1", "claim 1.0", "roster 2", "claim 2.0"]
    );
}

#[test]
fn a_state_is_recorded_when_something_changed() {
    use ModulePhase::{Gathered, Moving, Settled, Waiting};
    let mut recorder = Recorder::new(POSE_INTERVAL);
    let mut record = |millis, message: &Message| {
        let mut entries = recorder.record(at(millis), message);
        assert!(entries.len() < 2);
        entries.pop().map(|entry| entry.event)
    };
    let is_state = |event: Option<LogEvent>, phase: ModulePhase| match event {
        Some(LogEvent::State(snapshot)) => snapshot.phase == phase,
        _ => false,
    };
    assert!(is_state(record(0, &state(4, 1, 1, Waiting, 0)), Waiting));
    assert_eq!(
        record(5, &state(4, 1, 2, Waiting, 0)),
        None,
        "nothing changed"
    );
    assert!(is_state(record(10, &state(4, 1, 4, Moving, 0)), Moving));
    assert_eq!(
        record(300, &state(4, 1, 3, Waiting, 0)),
        None,
        "out of date"
    );
    assert_eq!(
        record(310, &state(4, 1, 5, Moving, 7)),
        Some(LogEvent::Pose {
            module: ModuleId(4),
            pose: pose(7)
        })
    );
    assert_eq!(record(320, &state(4, 1, 6, Moving, 8)), None, "too soon");
    assert!(
        is_state(record(330, &state(4, 1, 7, Settled, 9)), Settled),
        "a change of phase is never too soon"
    );
    assert!(
        is_state(record(340, &state(4, 2, 1, Gathered, 9)), Gathered),
        "it restarted"
    );
    assert_eq!(
        record(350, &state(4, 1, 8, Settled, 9)),
        None,
        "the earlier run"
    );
}

#[test]
fn corners_begins_and_stops_are_never_left_out() {
    let mut recorder = Recorder::new(POSE_INTERVAL);
    let mut poses = Vec::new();
    for (sequence, millis, x, drive, steps) in [
        (1, 0, 0, DriveState::Standing, 0),
        (2, 300, 0, DriveState::Moving, 0),
        (3, 310, 3, DriveState::Moving, 0),
        (4, 320, 9, DriveState::Moving, 1),
        (5, 330, 9, DriveState::Standing, 1),
        (6, 340, 9, DriveState::Standing, 1),
    ] {
        let Message::ModuleState(known) = state(4, 1, sequence, ModulePhase::Moving, x) else {
            panic!("it is a state");
        };
        let state = ModuleState {
            drive,
            steps_done: Some(steps),
            ..ModuleState::clone(&known)
        };
        let entries = recorder.record(at(millis), &Message::ModuleState(Arc::new(state)));
        poses.extend(entries.into_iter().filter_map(|entry| match entry.event {
            LogEvent::Pose { pose, .. } => Some((entry.at_ms, pose.x.0)),
            _ => None,
        }));
    }
    assert_eq!(poses, [(300, 0), (320, 9), (330, 9)]);
}

#[test]
fn entries_are_lines_of_json() {
    let mut recorder = Recorder::new(POSE_INTERVAL);
    for message in [
        roster(1),
        claim(1, 0, 4),
        state(4, 1, 1, ModulePhase::WaitingForQuorum, 3),
    ] {
        for entry in recorder.record(at(1_234), &message) {
            let line = serde_json::to_string(&entry).unwrap();
            assert!(line.starts_with("{\"at_ms\":1234,\""), "{line}");
            assert_eq!(serde_json::from_str::<Entry>(&line).unwrap(), entry);
        }
    }
}
