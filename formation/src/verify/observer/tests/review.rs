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
    let epoch = Epoch {
        number: 2,
        convener: ModuleId(1),
    };
    let mut sequence = good_sequence();
    let pins = [(1, 2), (2, 3), (3, 1), (4, 4)];
    sequence.members.truncate(4);
    for (member, (_, spot)) in sequence.members.iter_mut().zip(pins) {
        member.module.pin = Some(SpotId(spot));
        let settled = sequence.states.iter().rev();
        let settled = settled
            .clone()
            .find(|state| state.module == member.module.id)
            .unwrap();
        member.module.pose = settled.pose;
        member.module.links = settled.links.clone();
    }
    let mut roster = sequence.roster();
    roster.epoch = epoch;
    observer.handle(
        at(10),
        &Message::Roster(RosterMessage::Plan(Arc::new(roster.into()))),
    );
    assert_eq!(outcome(observer.review(at(10))), None, "not restored yet");
    for (module, spot) in pins {
        let mut beat = heartbeat(module, 200, 200);
        beat.epoch = Some(epoch);
        beat.digest = Some(Digest(2));
        beat.applied_turns = 0;
        observer.handle(at(11), &Message::Heartbeat(beat));
        let mut stays = sequence.state(module, 3).clone();
        stays.sequence = 9;
        stays.epoch = Some(epoch);
        stays.digest = Some(Digest(2));
        stays.unit = Some(ModuleId(module));
        stays.spot = Some(SpotId(spot));
        stays.settled_since = 9;
        stays.waited_for.clear();
        stays.agreed_on.clear();
        observer.handle(at(11), &Message::ModuleState(Arc::new(stays)));
    }
    let restored = observer.review(at(11)).unwrap();
    assert_eq!(restored.violations, []);
    assert_eq!(restored.outcome, Outcome::Complete);
    assert_eq!(restored.epoch, Some(epoch));
    assert_eq!(restored.unassigned, [], "it counts the living only");
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
