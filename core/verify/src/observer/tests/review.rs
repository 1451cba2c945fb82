//! A verdict that is looked at again: formations break, and recover.

use super::*;

const SILENCE: Duration = Duration::from_secs(5);

fn at(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

/// The heartbeats that follow those of the good sequence, one of each of these modules.
fn beat(observer: &mut Observer, now: Duration, modules: impl IntoIterator<Item = u32>) {
    for module in modules {
        let sequence = 100 + now.as_secs();
        let heartbeat = heartbeat(module, sequence, 10);
        observer.handle(now, &Message::Heartbeat(heartbeat));
    }
}

fn outcome(verdict: Option<&Verdict>) -> Option<Outcome> {
    verdict.map(|verdict| verdict.outcome)
}

/// Shows V2.
#[test]
fn a_formation_is_not_done_while_a_member_is_silent() {
    let mut observer = observe(&good_sequence().messages(), ObserverParameters::default());
    beat(&mut observer, at(20), [1, 2, 4, 5]);
    assert_eq!(observer.verdict(at(20)), None);
    beat(&mut observer, at(21), [3]);
    assert_eq!(
        outcome(observer.verdict(at(21))),
        Some(Outcome::Complete),
        "its heartbeats arrive again"
    );
}

#[test]
fn the_end_of_the_time_names_who_is_silent() {
    let parameters = ObserverParameters {
        time_limit: at(30),
        ..ObserverParameters::default()
    };
    let mut observer = observe(&good_sequence().messages(), parameters);
    beat(&mut observer, at(30), [1, 2, 4, 5]);
    let verdict = observer.verdict(at(31)).unwrap();
    assert_eq!(verdict.outcome, Outcome::Failed);
    assert_eq!(
        verdict.missing,
        [Missing::Silent {
            module: ModuleId(3),
            silence: SILENCE
        }]
    );
    assert_eq!(
        verdict.missing[0].to_string(),
        "module 3 has been silent for more than 5 s"
    );
}

/// Module 4 is stopped before it follows a link, goes on, and is cut off with the others at once.
#[test]
fn members_that_are_not_heard_may_be_mending_what_is_broken() {
    let mut sequence = good_sequence();
    sequence.state(4, 3).links.clear();
    for stays_in_reach in [false, true] {
        let mut observer = observe(&sequence.messages(), ObserverParameters::default());
        for now in 1..=4 {
            beat(&mut observer, at(now), [1, 2, 3, 5]);
            assert_eq!(outcome(observer.review(at(now))), None);
        }
        for now in 5..=12 {
            if now == 5 || stays_in_reach {
                beat(&mut observer, at(now), 1..=5);
            }
            let is_reported = stays_in_reach && now == 10;
            let failed = is_reported.then_some(Outcome::Failed);
            assert_eq!(outcome(observer.review(at(now))), failed, "{now} s");
        }
    }
}

#[test]
fn what_is_broken_is_reported_although_members_are_seldom_heard() {
    let mut sequence = good_sequence();
    sequence.state(4, 3).links.clear();
    let mut observer = observe(&sequence.messages(), ObserverParameters::default());
    let mut verdicts = Vec::new();
    for now in 1..=30 {
        if now % 4 == 0 {
            beat(&mut observer, at(now), 1..=5);
        }
        let verdict = outcome(observer.review(at(now)));
        verdicts.extend(verdict.map(|verdict| (now, verdict)));
    }
    assert_eq!(verdicts, [(25, Outcome::Failed)]);
}

/// A stranger that moves to and fro over a settled module takes no part in the plan.
#[test]
fn no_stranger_keeps_a_verdict_back_for_longer_than_the_grace() {
    let mut observer = observe(&good_sequence().messages(), ObserverParameters::default());
    let mut verdicts = Vec::new();
    for now in 1..=9 {
        let x = if now % 2 == 0 { 8 } else { 12 };
        let passing = ModuleState {
            at: SenderTime(at(now)),
            drive: DriveState::Moving,
            pose: pose(x, 1),
            steps_done: Some(0),
            ..state(9, now, ModulePhase::Moving)
        };
        observer.handle(at(now), &Message::ModuleState(Arc::new(passing)));
        beat(&mut observer, at(now), 1..=5);
        if now >= 3 {
            let verdict = outcome(observer.review(at(now)));
            verdicts.extend(verdict.map(|verdict| (now, verdict)));
        }
    }
    assert_eq!(verdicts, [(6, Outcome::Complete)]);
}

/// The states with which the spare makes way for module 3 are late, and nothing else is missing.
#[test]
fn who_seems_to_stand_in_the_way_may_have_left_by_a_state_that_is_late() {
    let on_its_way = |sequence: &mut Sequence, module, number, millis, drive, place| {
        let state = sequence.state(module, number);
        (state.at, state.drive) = (SenderTime(Duration::from_millis(millis)), drive);
        state.pose = place;
    };
    for makes_way in [true, false] {
        let mut sequence = good_sequence();
        sequence.members[4].module.pose = pose(5, 1);
        on_its_way(&mut sequence, 3, 2, 1_000, DriveState::Moving, pose(0, 1));
        on_its_way(
            &mut sequence,
            3,
            3,
            2_000,
            DriveState::Standing,
            pose(10, 1),
        );
        for (number, millis) in [(1, 100), (2, 200)] {
            on_its_way(
                &mut sequence,
                5,
                number,
                millis,
                DriveState::Standing,
                pose(5, 1),
            );
        }
        let mut observer = observe(&sequence.messages(), ObserverParameters::default());
        assert_eq!(outcome(observer.review(at(1))), None);
        assert_eq!(observer.poll_timeout(), Some(at(4)), "{makes_way}");
        for (sequence, millis, drive, y) in [
            (3, 300, DriveState::Moving, 1),
            (4, 900, DriveState::Standing, 4),
        ] {
            let late = ModuleState {
                at: SenderTime(Duration::from_millis(millis)),
                drive,
                pose: pose(5, y),
                steps_done: Some(u32::from(y > 1)),
                ..state(5, sequence, ModulePhase::Spare)
            };
            if makes_way {
                observer.handle(at(2), &Message::ModuleState(Arc::new(late)));
            }
        }
        let mut verdicts = Vec::new();
        for now in 2..=12 {
            beat(&mut observer, at(now), 1..=5);
            let verdict = outcome(observer.review(at(now)));
            verdicts.extend(verdict.map(|verdict| (now, verdict)));
        }
        let expected = match makes_way {
            true => (2, Outcome::Complete),
            false => (10, Outcome::Failed),
        };
        assert_eq!(verdicts, [expected]);
    }
}

/// Nobody moves on without a module to which the target gives a spot.
#[test]
fn the_end_of_the_time_names_whose_allocation_waits() {
    let given = |modules: &[u32]| {
        let pairs = modules.iter().zip(1..);
        let raw = RawGiven {
            allocation: pairs
                .map(|(&module, spot)| RawGivenSpot { module, spot })
                .collect(),
            detached: Vec::new(),
        };
        Arc::new(Target::clone(&star()).with_given(&raw).unwrap())
    };
    let sentences = |modules: &[u32]| -> Vec<String> {
        let mut sequence = good_sequence();
        sequence.target.target = Some(given(modules));
        let parameters = ObserverParameters {
            time_limit: at(30),
            ..ObserverParameters::default()
        };
        let mut observer = observe(&sequence.messages(), parameters);
        beat(&mut observer, at(30), [1, 2, 4, 5]);
        let verdict = observer.verdict(at(31)).unwrap();
        verdict.missing.iter().map(ToString::to_string).collect()
    };
    let reason = "the target gives module 3 a spot, so the others wait for another target";
    assert!(sentences(&[1, 2, 3, 4]).contains(&reason.to_owned()));
    let others = sentences(&[1, 2, 5, 4]);
    assert!(!others.contains(&reason.to_owned()), "{others:?}");
}

#[test]
fn a_death_breaks_the_verdict_and_a_new_plan_restores_it() {
    let mut observer = observe(&good_sequence().messages(), ObserverParameters::default());
    assert_eq!(outcome(observer.review(at(1))), Some(Outcome::Complete));
    assert_eq!(outcome(observer.review(at(2))), None, "nothing changed");
    // The spare falls silent: who stands where is as it was, but the plan counted on it.
    for now in 2..9 {
        beat(&mut observer, at(now), 1..=4);
    }
    assert_eq!(
        outcome(observer.review(at(8))),
        None,
        "its heartbeat may be late"
    );
    let broken = observer.review(at(9)).unwrap();
    assert_eq!(broken.outcome, Outcome::Failed);
    assert_eq!(broken.missing.len(), 1);
    assert_eq!(outcome(observer.review(at(10))), None, "reported once");

    // The others make a new plan without it, in which all stay where they are.
    observer.handle(at(10), &second_roster());
    assert_eq!(outcome(observer.review(at(10))), None, "not restored yet");
    for message in second_acts() {
        observer.handle(at(11), &message);
    }
    let restored = observer.review(at(11)).unwrap();
    assert_eq!(restored.violations, []);
    assert_eq!(restored.outcome, Outcome::Complete);
    assert_eq!(restored.epoch, Some(SECOND));
    assert_eq!(restored.unassigned, [], "it counts the living only");
}

/// An epoch after the good sequence, without module 5: all stay where they have settled.
const SECOND: Epoch = Epoch {
    number: 2,
    convener: ModuleId(1),
};

/// The modules of the second epoch and their spots.
const PINS: [(u32, u32); 4] = [(1, 2), (2, 3), (3, 1), (4, 4)];

fn second_roster() -> Message {
    let mut sequence = good_sequence();
    sequence.members.truncate(4);
    for (member, (_, spot)) in sequence.members.iter_mut().zip(PINS) {
        member.module.pin = Some(SpotId(spot));
        let mut states = sequence.states.iter().rev();
        let settled = states
            .find(|state| state.module == member.module.id)
            .unwrap();
        member.module.pose = settled.pose;
        member.module.links = settled.links.clone();
    }
    let mut roster = sequence.roster();
    roster.epoch = SECOND;
    Message::Roster(RosterMessage::Plan(Arc::new(roster.into())))
}

/// What the modules of the second epoch publish when they have settled in it.
fn second_acts() -> Vec<Message> {
    let mut sequence = good_sequence();
    let mut messages = Vec::new();
    for (module, spot) in PINS {
        let mut beat = heartbeat(module, 200, 200);
        beat.epoch = Some(SECOND);
        beat.digest = Some(Digest(2));
        beat.applied_turns = 0;
        messages.push(Message::Heartbeat(beat));
        let mut stays = sequence.state(module, 3).clone();
        stays.sequence = 9;
        stays.epoch = Some(SECOND);
        stays.digest = Some(Digest(2));
        stays.unit = Some(ModuleId(module));
        stays.spot = Some(SpotId(spot));
        stays.settled_since = 9;
        stays.waited_for.clear();
        stays.agreed_on.clear();
        messages.push(Message::ModuleState(Arc::new(stays)));
    }
    messages
}

#[test]
fn while_a_new_plan_is_under_way_the_verdict_before_it_holds_up_to_the_time_limit() {
    let parameters = ObserverParameters {
        time_limit: at(60),
        ..patient()
    };
    let mut observer = observe(&good_sequence().messages(), parameters);
    assert_eq!(outcome(observer.review(at(1))), Some(Outcome::Complete));
    // Longer after the announcement than the time limit.
    observer.handle(at(100), &second_roster());
    for now in [100, 102, 159] {
        assert_eq!(outcome(observer.review(at(now))), None, "at {now} s");
    }
    let mut late = observer.clone();
    let late = late.review(at(160)).unwrap();
    assert_eq!(late.outcome, Outcome::Failed);
    assert_eq!(late.epoch, Some(SECOND));
    assert!(late.missing.contains(&Missing::Agreement {
        epoch: SECOND,
        module: ModuleId(1),
        phase: Some(ModulePhase::Settled)
    }));
    assert_eq!(late.filled_spots, 4, "all stand where they settled");
    for message in second_acts() {
        observer.handle(at(159), &message);
    }
    let restored = observer.review(at(160)).unwrap();
    assert_eq!(
        (restored.outcome, restored.epoch),
        (Outcome::Complete, Some(SECOND))
    );
}

#[test]
fn without_a_target_there_is_nothing_to_review() {
    let mut observer = Observer::new(patient());
    for now in [0, 60, 121, 1_000] {
        assert_eq!(outcome(observer.review(at(now))), None, "at {now} s");
    }
    for (number, message) in (1_001_000..).zip(good_sequence().messages()) {
        observer.handle(Duration::from_millis(number), &message);
    }
    let formed = outcome(observer.review(at(1_002)));
    assert_eq!(formed, Some(Outcome::Complete));
    observer.handle(at(1_003), &announced(2, |target| target.target = None));
    for now in [1_003, 1_200, 2_000] {
        assert_eq!(outcome(observer.review(at(now))), None, "at {now} s");
    }
    // Without reviews, the time counts from the start.
    let mut once = Observer::new(patient());
    let verdict = once.verdict(at(120)).unwrap();
    assert_eq!(verdict.missing, [Missing::Target]);
}

/// Module 1 moved before it published that it moves. That is of no account for the next target.
#[test]
fn what_was_reported_of_one_formation_is_no_violation_of_the_next() {
    let mut sequence = good_sequence();
    sequence.state(1, 1).pose = pose(0, 3);
    let mut observer = sequence.observe();
    for now in [1, 120] {
        assert_eq!(observer.review(at(now)), None, "it has a grace");
    }
    let early = observer.review(at(121)).unwrap().clone();
    assert!(matches!(
        early.violations[..],
        [Violation::MovedEarly { .. }]
    ));
    let again = announced(2, |target| target.parameters.keep_all_spots = true);
    observer.handle(at(130), &again);
    assert_eq!(observer.review(at(130)), None);
    let late = observer.review(at(250)).unwrap();
    assert_eq!(late.missing, [Missing::Roster { revision: 2 }]);
    assert_eq!(late.violations, []);
}

/// No message proves that the modules agreed before module 1 moved. That holds against the epoch, and ends with it.
/// Shows V3.
#[test]
fn a_lack_of_proof_ends_with_its_epoch() {
    let mut sequence = good_sequence();
    for state in sequence.acts_of(1) {
        state.agreed_on.clear();
    }
    let mut observer = sequence.observe();
    observer.review(at(1));
    let verdict = observer.review(at(121)).unwrap();
    assert!(!verdict.violations.is_empty());
    assert_eq!(verdict.counts.unproven, 0);
    observer.handle(at(122), &second_roster());
    for message in second_acts() {
        observer.handle(at(122), &message);
    }
    let next = observer.review(at(123)).unwrap();
    assert_eq!(
        (next.outcome, &next.violations),
        (Outcome::Complete, &Vec::new())
    );
    assert!(next.counts.unproven > 0);
}

/// A recording of an earlier formation of the same modules is played next to them, up to a later epoch than theirs.
#[test]
fn rosters_of_earlier_runs_are_of_no_account() {
    let mut earlier = good_sequence().roster();
    for member in &mut earlier.members {
        member.incarnation.0 -= 1;
    }
    earlier.members.pop();
    let replayed = |number, earlier: &Roster| {
        let mut roster = earlier.clone();
        roster.epoch.number = number;
        Message::Roster(RosterMessage::Plan(Arc::new(roster.into())))
    };
    for first in [true, false] {
        let mut messages = good_sequence().messages();
        for number in [1, 7] {
            let position = if first { 0 } else { messages.len() };
            messages.insert(position, replayed(number, &earlier));
        }
        let mut observer = observe(&messages, patient());
        let verdict = observer.review(at(1)).unwrap();
        assert_eq!(
            (verdict.outcome, verdict.epoch, &verdict.violations),
            (Outcome::Complete, Some(EPOCH), &Vec::new())
        );
    }
}

/// Agents refuse a later run beside a live one, so a stranger that invents it ends no epoch.
#[test]
fn a_later_run_beside_a_live_one_makes_no_epoch_a_past_one() {
    let mut observer = observe(&good_sequence().messages(), patient());
    let mut invented = heartbeat(1, 1, 10);
    invented.incarnation.0 += 100;
    invented.epoch = Some(Epoch { number: 0, ..EPOCH });
    observer.handle(at(1), &Message::Heartbeat(invented));
    beat(&mut observer, at(2), 1..=5);
    let verdict = observer.review(at(2)).unwrap();
    assert_eq!(
        (verdict.outcome, verdict.epoch),
        (Outcome::Complete, Some(EPOCH))
    );
}

/// The target publisher has ended; the roster carries the target.
#[test]
fn a_roster_is_judged_without_an_announcement() {
    let mut messages = good_sequence().messages();
    messages.retain(|message| !matches!(message, Message::Target(_)));
    let mut observer = observe(&messages, patient());
    let verdict = observer.review(at(1)).unwrap();
    assert_eq!(verdict.outcome, Outcome::Complete);
}

/// All restart and forget the epoch, and the clock of the convener is set back meanwhile: its later run has a lower number.
#[test]
fn a_roster_of_a_run_that_began_after_the_end_of_another_counts() {
    let mut former = good_sequence().roster();
    former.members[0].incarnation.0 += 1;
    former.members.pop();
    let mut ended = heartbeat(1, 90, 10);
    ended.incarnation.0 += 1;
    let mut observer = Observer::new(patient());
    observer.handle(at(0), &Message::Heartbeat(ended));
    let former = RosterMessage::Plan(Arc::new(former.into()));
    observer.handle(at(0), &Message::Roster(former));
    let mut messages = good_sequence().messages();
    messages.sort_by_key(|message| !matches!(message, Message::Heartbeat(_)));
    for message in messages {
        observer.handle(at(10), &message);
    }
    let verdict = observer.review(at(10)).unwrap();
    assert_eq!(
        (verdict.outcome, &verdict.violations),
        (Outcome::Complete, &Vec::new())
    );
}

/// The good sequence's target under another revision, and what it asks for instead, if anything.
fn announced(revision: u64, change: impl FnOnce(&mut TargetAnnouncement)) -> Message {
    let mut target = good_sequence().target;
    target.revision = revision;
    change(&mut target);
    Message::Target(Arc::new(target))
}

#[test]
fn a_target_that_is_announced_again_changes_nothing_unless_it_was_withdrawn() {
    let mut observer = observe(&good_sequence().messages(), patient());
    assert_eq!(outcome(observer.review(at(1))), Some(Outcome::Complete));
    assert_eq!(observer.current_epoch(), Some(EPOCH));
    observer.handle(at(2), &announced(2, |_| ()));
    assert_eq!(observer.current_epoch(), Some(EPOCH));
    assert_eq!(observer.progress().stage, FormationStage::Done);
    assert_eq!(outcome(observer.review(at(5))), None, "as it was");

    observer.handle(at(6), &announced(3, |target| target.target = None));
    assert_eq!(observer.progress().stage, FormationStage::WaitingForTarget);
    observer.handle(at(7), &announced(4, |_| ()));
    assert_eq!(observer.progress().stage, FormationStage::Gathering);
    assert_eq!(
        observer.current_epoch(),
        None,
        "agents plan again after that"
    );
}

/// A formation that was cut off from the publisher while the target was withdrawn and announced again never hears of the
/// withdrawal, and goes on by the roster that it has.
#[test]
fn a_formation_that_missed_the_withdrawal_of_its_target_counts_once_all_have_shown_that_they_stay()
{
    let parameters = ObserverParameters {
        silence: at(5),
        ..patient()
    };
    let mut observer = observe(&good_sequence().messages(), parameters);
    observer.handle(at(1), &announced(3, |_| ()));
    observer.handle(at(1), &announced(4, |target| target.target = None));
    observer.handle(at(2), &announced(5, |_| ()));
    beat(&mut observer, at(7), 1..=5);
    assert_eq!(
        observer.current_epoch(),
        None,
        "it may be on its way to them"
    );
    beat(&mut observer, at(8), 1..=4);
    assert_eq!(
        observer.current_epoch(),
        None,
        "one may not have heard of it"
    );
    beat(&mut observer, at(8), 5..=5);
    assert_eq!(observer.current_epoch(), Some(EPOCH));
    assert_eq!(outcome(observer.review(at(8))), Some(Outcome::Complete));
}

#[test]
fn a_withdrawal_below_the_latest_revision_changes_nothing() {
    let mut observer = observe(&good_sequence().messages(), patient());
    observer.handle(at(1), &announced(3, |_| ()));
    observer.handle(at(1), &announced(2, |target| target.target = None));
    assert_eq!(observer.current_epoch(), Some(EPOCH));
    assert_eq!(outcome(observer.review(at(2))), Some(Outcome::Complete));
}

#[test]
fn a_new_target_takes_the_verdict_away_and_has_the_whole_time_limit() {
    let parameters = ObserverParameters {
        time_limit: at(60),
        ..patient()
    };
    let mut observer = observe(&good_sequence().messages(), parameters);
    assert_eq!(outcome(observer.review(at(1))), Some(Outcome::Complete));
    let other = announced(2, |target| target.parameters.keep_all_spots = true);
    observer.handle(at(100), &other);
    for now in [101, 120, 159] {
        assert_eq!(outcome(observer.review(at(now))), None);
    }
    assert_eq!(observer.poll_timeout(), Some(at(160)));
    let late = observer.review(at(160)).unwrap();
    assert_eq!(late.outcome, Outcome::Failed);
    assert_eq!(late.missing, [Missing::Roster { revision: 2 }]);
    assert_eq!(late.epoch, None, "the old plan is not judged again");
}

#[test]
fn a_target_has_the_whole_time_limit_though_nothing_was_judged_before_it() {
    let parameters = ObserverParameters {
        time_limit: at(60),
        ..patient()
    };
    let mut observer = Observer::new(parameters);
    assert_eq!(outcome(observer.review(at(50))), None);
    observer.handle(at(50), &announced(1, |_| ()));
    assert_eq!(outcome(observer.review(at(109))), None);
    observer.handle(at(109), &announced(2, |_| ()));
    assert_eq!(observer.poll_timeout(), Some(at(110)), "as it was");
    let other = announced(3, |target| target.parameters.keep_all_spots = true);
    observer.handle(at(109), &other);
    assert_eq!(outcome(observer.review(at(168))), None);
    assert_eq!(outcome(observer.review(at(169))), Some(Outcome::Failed));
}
