//! Runs in which everything is as it must be, whichever messages arrive.

use super::*;

#[test]
fn a_good_run_is_complete() {
    let verdict = good_sequence().verdict();
    assert_eq!(verdict.violations, []);
    assert_eq!(verdict.missing, []);
    assert_eq!(verdict.outcome, Outcome::Complete);
    assert_eq!(verdict.epoch, Some(EPOCH));
    assert_eq!((verdict.filled_spots, verdict.open_spots), (4, Vec::new()));
    assert_eq!(
        verdict.assignments,
        BTreeMap::from([(1, 2), (2, 3), (3, 1), (4, 4)].map(|(m, s)| (ModuleId(m), SpotId(s))))
    );
    assert_eq!(verdict.unassigned, [ModuleId(5)]);
    let counts = verdict.counts;
    assert_eq!((counts.claims, counts.pairs, counts.evictions), (4, 5, 1));
    assert_eq!((counts.epochs, counts.dropped), (1, 0));
    let timings = verdict.timings;
    assert_eq!(timings.roster_known, Some(Duration::from_millis(3)));
    assert_eq!(timings.last_claim, Some(Duration::from_millis(7)));
    assert_eq!(timings.first_moving, Some(Duration::from_millis(19)));
    assert_eq!(timings.completed, Some(Duration::from_secs(1)));
}

/// Shows V3.
#[test]
fn neither_the_order_of_arrival_nor_repetition_matters() {
    let sequence = good_sequence();
    for seed in 0..200 {
        let mut random = Random::from_seed(seed);
        let mut messages = sequence.messages();
        messages.extend(sequence.messages());
        random.shuffle(&mut messages);
        let mut observer = observe(&messages, patient());
        let verdict = observer.verdict(Duration::from_secs(1)).unwrap();
        assert_eq!(verdict.outcome, Outcome::Complete, "seed {seed}");
        assert_eq!(verdict.assignments.len(), 4);
    }
}

#[test]
fn messages_of_modules_outside_the_roster_change_nothing() {
    let mut sequence = good_sequence();
    let stranger = |phase, epoch, spot: u32| {
        let mut state = state(40, u64::from(spot), phase);
        state.epoch = epoch;
        state.digest = epoch.and(Some(Digest(0xbad)));
        state.spot = Some(SpotId(spot));
        state.links = modules(&[1, 2]);
        state
    };
    for (first, phase) in [(1, ModulePhase::Settled), (3, ModulePhase::Moving)] {
        for epoch in [None, Some(EPOCH)] {
            let spot = first + u32::from(epoch.is_some());
            let state = Arc::new(stranger(phase, epoch, spot));
            sequence.further.push(Message::ModuleState(state));
        }
    }
    let mut beat = heartbeat(40, 1, 1);
    beat.digest = Some(Digest(0xbad));
    sequence.further.push(Message::Heartbeat(beat));
    let mut claim = sequence.claims[3].clone();
    claim.claimant = ModuleId(40);
    claim.decision.selections = select(&[(1, 40)]);
    sequence.further.push(Message::Claim(Arc::new(claim)));
    for seed in 0..50 {
        let mut messages = sequence.messages();
        Random::from_seed(seed).shuffle(&mut messages);
        let mut observer = observe(&messages, patient());
        let verdict = observer.verdict(Duration::from_secs(1)).unwrap();
        assert_eq!(verdict.violations, [], "seed {seed}");
        assert_eq!(verdict.outcome, Outcome::Complete, "seed {seed}");
    }
}

#[test]
fn no_verdict_comes_before_the_last_message() {
    let mut messages = good_sequence().messages();
    for seed in 0..50 {
        Random::from_seed(seed).shuffle(&mut messages);
        let mut observer = Observer::new(patient());
        for message in &messages {
            if let Some(verdict) = observer.verdict(Duration::from_secs(1)) {
                assert_eq!(verdict.outcome, Outcome::Complete);
            }
            observer.handle(Duration::from_secs(1), message);
        }
        assert!(observer.verdict(Duration::from_secs(1)).is_some());
        assert_eq!(observer.poll_timeout(), None);
    }
}

/// Shows X5.
#[test]
fn states_that_were_missed_are_not_held_against_the_modules() {
    let mut sequence = good_sequence();
    sequence
        .states
        .retain(|state| matches!(state.phase, ModulePhase::Settled | ModulePhase::Spare));
    assert_eq!(sequence.verdict().outcome, Outcome::Complete);
}

#[test]
fn progress_follows_the_sequence() {
    let sequence = good_sequence();
    let mut observer = Observer::new(patient());
    assert_eq!(observer.progress().stage, FormationStage::WaitingForTarget);
    let mut stages = Vec::new();
    for message in sequence.messages() {
        observer.handle(Duration::ZERO, &message);
        let progress = observer.progress();
        if stages.last() != Some(&progress.stage) {
            stages.push(progress.stage);
        }
    }
    assert_eq!(
        stages,
        [
            FormationStage::Gathering,
            FormationStage::Planning,
            FormationStage::Agreeing,
            FormationStage::Acting,
            FormationStage::Done
        ]
    );
    let mut partly = good_sequence();
    partly
        .states
        .retain(|state| state.module != ModuleId(4) || state.phase != ModulePhase::Settled);
    partly.heartbeats.retain(|one| one.module != ModuleId(2));
    let progress = partly.observe().progress();
    assert_eq!(progress.stage, FormationStage::Agreeing);
    assert_eq!((progress.joined, progress.expected), (5, Some(5)));
    assert_eq!((progress.planned, progress.agreed), (4, 4));
    assert_eq!((progress.settled, progress.to_fill), (3, 4));
    assert_eq!(progress.waiting_for, [ModuleId(2)]);
}

#[test]
fn an_agreement_needs_every_claim_and_every_member() {
    let sequence = good_sequence();
    let mut observer = Observer::new(patient());
    let mut agreed_since = None;
    for message in sequence.messages() {
        observer.handle(Duration::ZERO, &message);
        let is_agreed = observer.agreement().is_some();
        let acts = observer.progress().stage >= FormationStage::Acting;
        assert_eq!(is_agreed, acts);
        if is_agreed && agreed_since.is_none() {
            agreed_since = Some(observer.progress());
        }
    }
    assert_eq!(agreed_since.unwrap().settled, 0, "no module has moved yet");
    let agreement = observer.agreement().unwrap();
    assert_eq!(agreement.assignments, sequence.verdict().assignments);
    assert_eq!(agreement.violations, []);
    let mut silent = good_sequence();
    silent.heartbeats.retain(|one| one.module != ModuleId(2));
    assert_eq!(silent.observe().agreement(), None);
}

/// Shows V1.
#[test]
fn fewer_modules_than_spots_are_partial() {
    let mut sequence = good_sequence();
    sequence
        .members
        .retain(|member| member.module.id != ModuleId(4) && member.module.id != ModuleId(5));
    sequence.states.retain(|state| state.module < ModuleId(4));
    sequence.heartbeats.retain(|one| one.module < ModuleId(4));
    sequence.target.expected_modules = Some(3);
    sequence.claims.remove(1);
    sequence.claims[0].decision.selections = select(&[(1, 3)]);
    sequence.claims[1].turn = 1;
    sequence.claims.truncate(2);
    for heartbeat in &mut sequence.heartbeats {
        heartbeat.applied_turns = 2;
    }
    for state in sequence.acts_of(1) {
        state.agreed_on = marks(&[(2, 11), (3, 10)]);
        state.links.remove(&ModuleId(4));
    }
    let verdict = sequence.verdict();
    assert_eq!(verdict.violations, []);
    assert_eq!(verdict.outcome, Outcome::Partial);
    assert_eq!(verdict.open_spots, [SpotId(4)]);
    assert!(sequence.observe().verdict(Duration::from_secs(1)).is_some());
    // More are expected, so it waits for them a little.
    sequence.target.expected_modules = Some(4);
    assert!(sequence.observe().verdict(Duration::from_secs(1)).is_none());
    assert_eq!(sequence.verdict().outcome, Outcome::Partial);
}

#[test]
fn a_later_epoch_supersedes_an_earlier_one() {
    let mut sequence = good_sequence();
    let later = Epoch {
        number: 2,
        convener: ModuleId(1),
    };
    let mut roster = sequence.roster();
    roster.epoch = later;
    sequence.further = vec![Message::Roster(RosterMessage::Plan(Arc::new(
        roster.clone().into(),
    )))];
    let verdict = sequence.verdict();
    assert_eq!(verdict.outcome, Outcome::Failed);
    assert_eq!(verdict.epoch, Some(later));

    // All stay on their spots in the later epoch.
    let spots = [2, 3, 1, 4];
    for (member, spot) in roster.members.iter_mut().zip(spots) {
        member.module.pin = Some(SpotId(spot));
    }
    sequence.further = vec![Message::Roster(RosterMessage::Plan(Arc::new(
        roster.into(),
    )))];
    sequence.further.push(Message::Claim(Arc::new(SpotClaim {
        epoch: later,
        turn: 0,
        ..sequence.claims[3].clone()
    })));
    for id in 1..=5 {
        sequence.further.push(Message::Heartbeat(Heartbeat {
            epoch: Some(later),
            digest: Some(Digest(3)),
            applied_turns: 1,
            ..heartbeat(id, 40, 30)
        }));
        let last = sequence
            .states
            .iter()
            .rfind(|state| state.module == ModuleId(id));
        sequence
            .further
            .push(Message::ModuleState(Arc::new(ModuleState {
                sequence: 9,
                epoch: Some(later),
                digest: Some(Digest(3)),
                waited_for: Vec::new(),
                agreed_on: Vec::new(),
                ..last.unwrap().clone()
            })));
    }
    let verdict = sequence.verdict();
    assert_eq!(verdict.violations, []);
    assert_eq!(
        (verdict.outcome, verdict.epoch),
        (Outcome::Complete, Some(later))
    );
    // What was wrong in the earlier epoch stays wrong.
    sequence.state(3, 2).digest = Some(Digest(4));
    let verdict = sequence.verdict();
    assert!(matches!(
        verdict.violations[..],
        [Violation::PlansDiffer { epoch: EPOCH, .. }]
    ));
    assert_eq!(verdict.outcome, Outcome::Failed);
}

#[test]
fn a_restarted_module_no_longer_counts_as_settled() {
    let mut sequence = good_sequence();
    let mut restarted = state(2, 1, ModulePhase::Listening);
    restarted.incarnation = Incarnation(90);
    sequence.further = vec![Message::ModuleState(Arc::new(restarted))];
    sequence.assert_missing(&[Missing::Settled {
        module: ModuleId(2),
        spot: SpotId(3),
        phase: None,
    }]);
    // A second process with a living module's identifier changes nothing.
    sequence
        .further
        .push(Message::Heartbeat(heartbeat(2, 13, 10)));
    assert_eq!(sequence.verdict().outcome, Outcome::Complete);
}

/// The first unit's own agreement needs no proof, and a formation of one needs no other's.
#[test]
fn a_lone_module_may_form_a_lone_spot() {
    let mut sequence = good_sequence();
    let raw = RawTarget {
        spots: vec![star().to_raw().spots[1]],
        edges: Vec::new(),
        frame_id: "map".to_owned(),
    };
    sequence.target.target = Some(Arc::new(Target::try_from(raw).unwrap()));
    sequence.target.expected_modules = Some(1);
    sequence.members.truncate(1);
    sequence.claims.truncate(1);
    sequence.claims[0].claimant = ModuleId(1);
    sequence.claims[0].decision.selections = select(&[(2, 1)]);
    sequence.heartbeats.truncate(1);
    sequence.heartbeats[0].applied_turns = 1;
    sequence.states.retain(|state| state.module == ModuleId(1));
    for state in sequence.acts_of(1) {
        state.agreed_on.clear();
        state.links.clear();
    }
    let verdict = sequence.verdict();
    assert_eq!(verdict.violations, []);
    assert_eq!(verdict.outcome, Outcome::Complete);
}
