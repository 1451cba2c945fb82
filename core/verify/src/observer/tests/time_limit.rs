//! What is named when the time is over.

use super::*;

#[test]
fn silence_is_named() {
    let mut observer = observe(
        &[],
        ObserverParameters {
            expected: modules(&[4, 7]),
            ..patient()
        },
    );
    assert_eq!(observer.verdict(Duration::from_secs(119)), None);
    let due = observer.poll_timeout().unwrap();
    assert_eq!(due, Duration::from_secs(120));
    let verdict = observer.verdict(due).unwrap();
    assert_eq!(verdict.outcome, Outcome::Failed);
    let sentences: Vec<String> = verdict.missing.iter().map(ToString::to_string).collect();
    assert_eq!(
        sentences,
        [
            "module 4 has not joined",
            "module 7 has not joined",
            "0 of 2 modules have joined",
            "no target was announced"
        ]
    );
}

#[test]
fn a_missing_roster_is_named() {
    let mut sequence = good_sequence();
    let mut other = sequence.target.clone();
    other.revision = 2;
    other.parameters.keep_all_spots = true;
    sequence.further = vec![Message::Target(Arc::new(other))];
    sequence.assert_missing(&[Missing::Roster { revision: 2 }]);
    let mut withdrawn = sequence.target.clone();
    withdrawn.revision = 3;
    withdrawn.target = None;
    sequence.further.push(Message::Target(Arc::new(withdrawn)));
    sequence.assert_missing(&[Missing::WithdrawnTarget]);
}

#[test]
fn a_missing_claim_is_named() {
    let mut sequence = good_sequence();
    sequence.claims.remove(3);
    sequence.assert_missing(&[Missing::Claim {
        epoch: EPOCH,
        turn: 3,
    }]);
}

fn with_module_4_on_its_way() -> Sequence {
    let mut sequence = good_sequence();
    sequence
        .states
        .retain(|state| state.module != ModuleId(4) || state.phase != ModulePhase::Settled);
    sequence
}

#[test]
fn a_module_that_is_still_on_its_way_is_named() {
    let sequence = with_module_4_on_its_way();
    sequence.assert_missing(&[Missing::Settled {
        module: ModuleId(4),
        spot: SpotId(4),
        phase: Some(ModulePhase::Moving),
    }]);
    let verdict = sequence.verdict();
    assert_eq!(verdict.open_spots, [SpotId(4)]);
    assert_eq!(
        verdict.missing[0].to_string(),
        "module 4 has not settled on spot 4; it is MOVING"
    );
}

#[test]
fn a_module_that_never_agreed_is_named() {
    let mut sequence = good_sequence();
    sequence.heartbeats.retain(|one| one.module != ModuleId(3));
    sequence.assert_missing(&[Missing::Agreement {
        epoch: EPOCH,
        module: ModuleId(3),
        phase: Some(ModulePhase::Settled),
    }]);
}

#[test]
fn a_spare_that_says_nothing_is_named() {
    let mut sequence = good_sequence();
    sequence
        .states
        .retain(|state| state.phase != ModulePhase::Spare);
    sequence.assert_missing(&[Missing::Spare {
        module: ModuleId(5),
        phase: Some(ModulePhase::Planning),
    }]);
}

/// The members stand still from second 100 on. The limit of 120 s counts from then, and from the command to resume.
#[test]
fn a_stop_has_a_time_limit_of_its_own() {
    let sequence = with_module_4_on_its_way();
    let command = |revision, stopped| {
        Message::Heartbeat(Heartbeat {
            stop: Stop { revision, stopped },
            ..heartbeat(4, 100 + revision, 1)
        })
    };
    let at = Duration::from_secs;
    let mut stopped = sequence.observe();
    stopped.handle(at(100), &command(1, true));
    assert_eq!(stopped.verdict(at(100)), None);
    assert_eq!(stopped.verdict(at(219)), None);
    let mut resumed = stopped.clone();
    resumed.handle(at(219), &command(2, false));
    assert_eq!(resumed.verdict(at(219)), None);
    let end = |observer: &mut Observer, seconds| {
        let missing = &observer.verdict(at(seconds)).unwrap().missing;
        missing.contains(&Missing::Resumption)
    };
    assert!(end(&mut stopped, 220));
    assert_eq!(resumed.verdict(at(338)), None);
    assert!(!end(&mut resumed, 339));
}
