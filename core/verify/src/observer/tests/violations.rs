//! Each violation is found, in any order of arrival.

use super::*;

#[test]
fn of_claims() {
    let mut sequence = good_sequence();
    sequence.claims[1].decision.selections = select(&[(2, 3), (4, 4)]);
    sequence.assert_violates(&Violation::WrongEviction {
        turn: 1,
        module: ModuleId(3),
        spot: SpotId(1),
    });

    let mut sequence = good_sequence();
    sequence.claims[1].decision.evictions.clear();
    sequence.claims[1].decision.selections = select(&[(4, 4)]);
    sequence.assert_violates(&Violation::SpotTaken {
        turn: 1,
        spot: SpotId(4),
        module: ModuleId(4),
        holder: ModuleId(3),
    });

    let mut sequence = good_sequence();
    sequence.claims[1].decision.evictions.clear();
    sequence.assert_violates(&Violation::MovedWithoutEviction {
        turn: 1,
        module: ModuleId(3),
        spot: SpotId(4),
    });

    let mut sequence = good_sequence();
    sequence.claims[3].decision = Decision {
        selections: select(&[(3, 5)]),
        evictions: vec![EvictionRecord {
            evicted: ModuleId(2),
            by: ModuleId(5),
            from: SpotId(3),
            to: None,
        }],
        ..Decision::default()
    };
    sequence.assert_violates(&Violation::MemberEvicted {
        turn: 3,
        module: ModuleId(2),
        spot: SpotId(3),
    });

    let mut sequence = good_sequence();
    sequence.claims[3].decision.selections = select(&[(9, 5)]);
    sequence.assert_violates(&Violation::UnknownSpot { spot: SpotId(9) });
    sequence.claims[3].decision.selections = select(&[(1, 9)]);
    sequence.assert_violates(&Violation::UnknownModule {
        module: ModuleId(9),
    });

    let mut sequence = good_sequence();
    sequence.claims[2].decision.selections = select(&[(1, 1), (2, 1), (3, 2)]);
    sequence.assert_violates(&Violation::TwoSpots {
        turn: 2,
        module: ModuleId(1),
    });

    let mut sequence = good_sequence();
    sequence.claims[3].decision.detached = vec![ModuleId(2)];
    sequence.assert_violates(&Violation::DetachedTooLate {
        turn: 3,
        module: ModuleId(2),
        spot: SpotId(3),
    });

    let mut sequence = good_sequence();
    sequence.target.parameters.d_max = Some(0);
    sequence.assert_violates(&Violation::ChainTooLong {
        turn: 1,
        evictions: 1,
        limit: 0,
    });
}

#[test]
fn of_rival_claims() {
    let mut sequence = good_sequence();
    let mut rival = sequence.claims[0].clone();
    rival.decision.selections = select(&[(1, 3)]);
    // The eviction of turn 1 contradicts it, but that comes later: an observer cannot know which one was applied.
    sequence.claims.push(rival.clone());
    sequence.assert_violates(&Violation::ClaimsDiffer {
        epoch: EPOCH,
        turn: 0,
    });
    // A stranger's claim counts for nothing.
    sequence.claims[4].claimant = ModuleId(40);
    assert_eq!(sequence.verdict().outcome, Outcome::Complete);
    sequence.claims[4] = rival;
    sequence.claims[4].incarnation = Incarnation(1);
    assert_eq!(sequence.verdict().outcome, Outcome::Complete);
    // Nor does one that contradicts the spots held.
    sequence.claims[4] = sequence.claims[3].clone();
    sequence.claims[4].decision.selections = select(&[(2, 5)]);
    assert_eq!(sequence.verdict().outcome, Outcome::Complete);
}

#[test]
fn of_rosters() {
    let mut sequence = good_sequence();
    let mut other = sequence.roster();
    other.members.pop();
    sequence.further = vec![Message::Roster(RosterMessage::Plan(Arc::new(other.into())))];
    let verdict = sequence.verdict();
    assert_eq!(
        verdict.violations,
        [Violation::RostersDiffer { epoch: EPOCH }]
    );

    let mut sequence = good_sequence();
    sequence.members[0].module.pin = Some(SpotId(99));
    let verdict = sequence.verdict();
    assert!(matches!(
        verdict.violations[..],
        [Violation::RosterInvalid { .. }]
    ));

    let sequence = good_sequence();
    let mut announced = sequence.target.clone();
    let mut raw = star().to_raw();
    raw.spots[0].x = 3.0;
    announced.target = Some(Arc::new(Target::try_from(raw).unwrap()));
    // The announcement of the same revision that comes first stands.
    let mut messages = vec![Message::Target(Arc::new(announced))];
    messages.extend(sequence.messages());
    let mut observer = observe(&messages, patient());
    observer.verdict(Duration::from_secs(1));
    let due = observer.poll_timeout().unwrap();
    let verdict = observer.verdict(due).unwrap();
    assert_eq!(
        verdict.violations,
        [Violation::TargetDiffers { epoch: EPOCH }]
    );
}

#[test]
fn of_moving_without_a_plan() {
    let mut sequence = good_sequence();
    sequence.state(3, 2).digest = None;
    sequence.assert_violates(&Violation::MovedWithoutPlan {
        module: ModuleId(3),
    });
    let mut sequence = good_sequence();
    sequence.state(3, 2).epoch = None;
    sequence.assert_violates(&Violation::MovedWithoutPlan {
        module: ModuleId(3),
    });
    let mut sequence = good_sequence();
    sequence.state(3, 2).digest = Some(Digest(4));
    sequence.assert_violates(&Violation::PlansDiffer {
        epoch: EPOCH,
        first: ModuleId(1),
        first_digest: PLAN,
        second: ModuleId(3),
        second_digest: Digest(4),
    });
}

/// Shows X5.
#[test]
fn of_moving_before_agreement() {
    let mut sequence = good_sequence();
    sequence.state(5, 1).pose = pose(1, 5);
    sequence.assert_violates(&Violation::MovedEarly {
        epoch: EPOCH,
        module: ModuleId(5),
        distance: MicroUnits::ONE,
    });

    let mut sequence = good_sequence();
    sequence.heartbeats[3] = heartbeat(4, 14, 13);
    sequence.assert_violates(&Violation::MovedBeforeAgreement {
        epoch: EPOCH,
        module: ModuleId(1),
        member: ModuleId(4),
        sequence: 12,
        agreed_since: 13,
    });

    let mut sequence = good_sequence();
    for state in sequence.acts_of(1) {
        state.agreed_on.retain(|mark| mark.module != ModuleId(3));
    }
    for module in [1, 3, 4] {
        sequence.assert_violates(&Violation::AgreementNotShown {
            epoch: EPOCH,
            module: ModuleId(module),
            member: ModuleId(if module == 1 { 3 } else { 1 }),
        });
    }

    // One proof is enough. The unit that has it, 1 and 2 here, may end before it publishes that it moves.
    let mut sequence = good_sequence();
    for state in &mut sequence.states {
        state.agreed_on.clear();
        state.waited_for.clear();
    }
    let shows_none = |verdict: &Verdict| {
        let mut violations = verdict.violations.iter();
        violations.any(|one| matches!(one, Violation::AgreementNotShown { .. }))
    };
    assert!(shows_none(&sequence.verdict()));
    // A claim that did not arrive may have given a spot to a module that has the proof.
    let last = sequence.claims.pop();
    assert!(!shows_none(&sequence.verdict()));
    sequence.claims.extend(last);
    let first_unit = [ModuleId(1), ModuleId(2)];
    let is_later = |state: &ModuleState| !first_unit.contains(&state.module);
    sequence.states.retain(is_later);
    assert!(!shows_none(&sequence.verdict()));
}

#[test]
fn of_the_order() {
    // Module 3 had not settled at its state 2.
    let mut sequence = good_sequence();
    for state in sequence.acts_of(4) {
        state.waited_for = marks(&[(1, 4), (2, 3), (3, 2)]);
    }
    sequence.assert_violates(&Violation::WaitedForUnsettled {
        epoch: EPOCH,
        module: ModuleId(4),
        other: ModuleId(3),
        sequence: 2,
    });

    // Spot 4 is filled after spot 1 alone, which is not adjacent: module 3 moves first, on the agreement of all.
    let mut sequence = good_sequence();
    let agreement = sequence.state(1, 2).agreed_on.clone();
    for state in sequence.acts_of(3) {
        state.waited_for.clear();
        state.agreed_on.clone_from(&agreement);
        state.agreed_on.extend(marks(&[(1, 10)]));
    }
    for state in sequence.acts_of(4) {
        state.waited_for = marks(&[(3, 3)]);
    }
    for state in sequence.acts_of(1) {
        state.waited_for = marks(&[(3, 3), (4, 3)]);
    }
    sequence.assert_violates(&Violation::NoPlacedNeighbour {
        module: ModuleId(4),
        spot: SpotId(4),
    });
    assert_eq!(sequence.verdict().violations.len(), 1);

    let mut sequence = good_sequence();
    for state in sequence.acts_of(3) {
        state.waited_for = marks(&[(1, 3), (4, 3)]);
    }
    sequence.assert_violates(&Violation::CircularWait {
        epoch: EPOCH,
        module: ModuleId(3),
    });
}

#[test]
fn a_neighbour_that_others_waited_for_counts() {
    let mut sequence = good_sequence();
    for state in sequence.acts_of(4) {
        state.waited_for = marks(&[(3, 3)]);
    }
    assert_eq!(sequence.verdict().outcome, Outcome::Complete);
}

#[test]
fn of_units() {
    let mut sequence = good_sequence();
    for state in sequence.acts_of(4) {
        state.unit = Some(ModuleId(3));
    }
    sequence.assert_violates(&Violation::WrongUnit { lead: ModuleId(3) });
}

/// Shows V1.
#[test]
fn of_the_end_state() {
    let mut sequence = good_sequence();
    sequence.state(3, 3).spot = Some(SpotId(4));
    sequence.assert_violates(&Violation::WrongSpot {
        module: ModuleId(3),
        held: Some(SpotId(4)),
        claimed: Some(SpotId(1)),
    });
    sequence.assert_violates(&Violation::TwoHolders {
        spot: SpotId(4),
        first: ModuleId(3),
        second: ModuleId(4),
    });
    sequence.assert_violates(&Violation::WrongCount {
        filled: 3,
        expected: 4,
    });

    let mut sequence = good_sequence();
    sequence.state(3, 3).pose.x = MicroUnits(10_040_000);
    sequence.state(3, 3).pose.theta = MicroUnits(6_283_185 - 40_000);
    assert_eq!(sequence.verdict().outcome, Outcome::Complete);
    sequence.state(3, 3).pose.x = MicroUnits(10_060_000);
    sequence.assert_violates(&Violation::PoseOff {
        module: ModuleId(3),
        spot: SpotId(1),
        distance: MicroUnits(60_000),
        turn: MicroUnits(40_000),
    });
    sequence.state(3, 3).pose.x = MicroUnits(10_000_000);
    sequence.state(3, 3).pose.theta = MicroUnits(-3_141_592);
    sequence.assert_violates(&Violation::PoseOff {
        module: ModuleId(3),
        spot: SpotId(1),
        distance: MicroUnits::ZERO,
        turn: MicroUnits(3_141_592),
    });

    let mut sequence = good_sequence();
    sequence.state(4, 3).links.clear();
    sequence.assert_violates(&Violation::LinkMissing {
        module: ModuleId(4),
        other: ModuleId(1),
    });
    let mut sequence = good_sequence();
    sequence.state(4, 3).links.insert(ModuleId(3));
    sequence.assert_violates(&Violation::LinkTooMany {
        module: ModuleId(4),
        other: ModuleId(3),
    });
    let mut sequence = good_sequence();
    sequence.state(5, 2).links.insert(ModuleId(3));
    sequence.assert_violates(&Violation::LinkTooMany {
        module: ModuleId(5),
        other: ModuleId(3),
    });
}

/// Shows B6, V4.
#[test]
fn of_two_modules_on_one_spot() {
    // Module 9 takes no part in this roster, lives, and stands where module 3 has settled.
    let mut sequence = good_sequence();
    let mut other = state(9, 1, ModulePhase::Settled);
    other.epoch = Some(Epoch { number: 0, ..EPOCH });
    other.pose = pose(10, 1);
    sequence.further = vec![
        Message::Heartbeat(heartbeat(9, 1, 1)),
        Message::ModuleState(Arc::new(other.clone())),
    ];
    sequence.assert_violates(&Violation::TwoBodies {
        spot: SpotId(1),
        first: ModuleId(3),
        second: ModuleId(9),
    });
    other.pose.x = MicroUnits(10_500_000);
    sequence.further[1] = Message::ModuleState(Arc::new(other.clone()));
    assert_eq!(sequence.verdict().outcome, Outcome::Complete);

    // Nor does a module of another session stand there.
    other.pose = pose(10, 1);
    sequence.further = vec![Message::OtherSessionState(Arc::new(other))];
    sequence.assert_violates(&Violation::TwoBodies {
        spot: SpotId(1),
        first: ModuleId(3),
        second: ModuleId(9),
    });

    // A member without a spot does not stand on one either.
    let mut sequence = good_sequence();
    let mut spare = state(5, 3, ModulePhase::Spare);
    spare.pose = pose(11, 0);
    sequence.states.push(spare);
    sequence.assert_violates(&Violation::TwoBodies {
        spot: SpotId(3),
        first: ModuleId(2),
        second: ModuleId(5),
    });
}

/// The clock of module 5 was set back between two runs. The former one, of a higher number, stood where module 3 has settled.
/// Shows V4.
#[test]
fn of_a_module_on_a_spot_that_only_a_former_run_of_a_higher_number_stood_on_are_none() {
    let mut former = state(5, 1, ModulePhase::Settled);
    former.incarnation.0 += 1;
    former.epoch = None;
    former.phase = ModulePhase::Listening;
    former.pose = pose(10, 1);
    let mut ended = heartbeat(5, 1, 1);
    ended.incarnation.0 += 1;
    ended.epoch = None;
    ended.digest = None;
    let mut messages = vec![
        Message::Heartbeat(ended),
        Message::ModuleState(Arc::new(former)),
    ];
    messages.extend(good_sequence().messages());
    let mut observer = observe(&messages, patient());
    let verdict = observer.review(Duration::from_secs(1)).unwrap();
    assert_eq!(
        (verdict.outcome, &verdict.violations),
        (Outcome::Complete, &Vec::new())
    );
}

/// Module 9 died, and its last state that arrived shows it where module 3 has settled. By the roster it was on its way elsewhere.
/// Shows V4.
#[test]
fn of_a_dead_module_on_a_spot_are_none_if_it_was_on_its_way() {
    let place = pose(10, 1);
    let mut other = state(9, 1, ModulePhase::Moving);
    other.epoch = Some(Epoch { number: 0, ..EPOCH });
    other.pose = place;
    let way = Polyline::line(pose(20, 1), pose(30, 1));
    let violations = |whereabouts: Option<Whereabouts>| {
        let mut sequence = good_sequence();
        sequence.further = vec![Message::ModuleState(Arc::new(other.clone()))];
        let mut roster = sequence.roster();
        roster.bodies = Vec::from_iter(whereabouts.map(|whereabouts| BodyReport {
            module: other.module,
            incarnation: other.incarnation,
            epoch: other.epoch,
            sequence: other.sequence,
            whereabouts,
        }));
        let listed = Message::Roster(RosterMessage::Plan(Arc::new(roster.into())));
        let mut messages = sequence.messages();
        messages.retain(|message| !matches!(message, Message::Roster(_)));
        messages.push(listed);
        let mut observer = observe(&messages, patient());
        observer.verdict(Duration::from_secs(1));
        let due = observer.poll_timeout().unwrap_or_default();
        observer.verdict(due).unwrap().violations.clone()
    };
    let stands = Violation::TwoBodies {
        spot: SpotId(1),
        first: ModuleId(3),
        second: ModuleId(9),
    };
    assert_eq!(violations(None), [stands]);
    assert_eq!(violations(Some(Whereabouts::OnTheWay(way))), []);
}

/// The removal of a body took effect in an earlier roster. All who know of it have restarted since, and the roster does not list it.
/// Shows V4.
#[test]
fn of_a_dead_module_on_a_spot_are_none_if_an_earlier_roster_listed_its_removal() {
    let earlier = Epoch { number: 0, ..EPOCH };
    let mut other = state(9, 1, ModulePhase::Settled);
    other.epoch = Some(earlier);
    other.pose = pose(10, 1);
    let violations = |whereabouts: Whereabouts| {
        let mut sequence = good_sequence();
        let mut roster = sequence.roster();
        roster.epoch = earlier;
        roster.bodies.push(BodyReport {
            module: other.module,
            incarnation: other.incarnation,
            epoch: Some(earlier),
            sequence: 0,
            whereabouts,
        });
        sequence.further = vec![
            Message::ModuleState(Arc::new(other.clone())),
            Message::Roster(RosterMessage::Plan(Arc::new(roster.into()))),
        ];
        sequence.verdict().violations
    };
    assert_eq!(violations(Whereabouts::Removed), []);
    let stands = Violation::TwoBodies {
        spot: SpotId(1),
        first: ModuleId(3),
        second: ModuleId(9),
    };
    assert_eq!(violations(Whereabouts::Seen(other.pose)), [stands]);
}

#[test]
fn of_an_end_state_that_heals_in_time_are_forgotten() {
    let mut sequence = good_sequence();
    let healed = sequence.state(4, 3).clone();
    sequence.state(4, 3).links.clear();
    let mut observer = observe(&sequence.messages(), ObserverParameters::default());
    assert_eq!(observer.verdict(Duration::from_secs(1)), None);
    // A second after the end of the silence that a member is granted.
    assert_eq!(observer.poll_timeout(), Some(Duration::from_secs(7)));
    let healed = ModuleState {
        sequence: 4,
        ..healed
    };
    let message = Message::ModuleState(Arc::new(healed));
    observer.handle(Duration::from_secs(2), &message);
    let verdict = observer.verdict(Duration::from_secs(2)).unwrap();
    assert_eq!(verdict.outcome, Outcome::Complete);
}

/// A row of five spots, whose last one a pinned module holds, and the first one as well if `first_is_held`. A block comes to the third and
/// the second spot, those of its modules 1 and 2 have settled that `settled` names, and module 5 moves to the fourth spot.
fn row_with_a_block(first_is_held: bool, settled: &[u32]) -> Sequence {
    let mut sequence = good_sequence();
    let spot = |id: u32| RawSpot {
        id,
        x: f64::from(id),
        y: 9.0,
        theta: 0.0,
    };
    let row = RawTarget {
        frame_id: "map".to_owned(),
        spots: (1..=5).map(spot).collect(),
        edges: vec![[1, 2], [2, 3], [3, 4], [4, 5]],
    };
    sequence.target.target = Some(Arc::new(Target::try_from(row).unwrap()));
    let mut hold = |module: usize, spot: u32| {
        let module = &mut sequence.members[module - 1].module;
        (module.pose, module.pin) = (pose(i64::from(spot), 9), Some(SpotId(spot)));
    };
    hold(4, 5);
    if first_is_held {
        hold(3, 1);
    }
    let [mut block, mut single, ..] = <[SpotClaim; 4]>::try_from(sequence.claims).unwrap();
    let takes = |pairs: &[(u32, u32)]| Decision {
        selections: select(pairs),
        ..Decision::default()
    };
    (block.claimant, block.decision) = (ModuleId(1), takes(&[(2, 2), (3, 1)]));
    (single.claimant, single.decision) = (ModuleId(5), takes(&[(4, 5)]));
    sequence.claims = vec![block, single];
    for heartbeat in &mut sequence.heartbeats {
        heartbeat.applied_turns = 2;
    }
    let agreed_on = marks(&[(2, 11), (3, 10), (4, 12), (5, 10)]);
    let acts = |module: u32, unit: u32, spot: u32, phase| ModuleState {
        spot: Some(SpotId(spot)),
        unit: Some(ModuleId(unit)),
        steps_done: Some(1),
        agreed_on: agreed_on.clone(),
        ..state(module, 3, phase)
    };
    let settled = settled.iter().map(|&module| ModuleState {
        pose: pose(i64::from(4 - module), 9),
        ..acts(module, 1, 4 - module, ModulePhase::Settled)
    });
    sequence.states = settled.collect();
    let moves = acts(5, 5, 4, ModulePhase::Moving);
    sequence.states.push(moves);
    sequence
}

/// What a block has to dock to may be adjacent to the spot of the module that died on its way.
#[test]
fn a_block_is_judged_by_the_order_once_all_of_it_have_settled() {
    let of_order = |sequence: &Sequence| -> Vec<Violation> {
        let violations = sequence.verdict().violations.into_iter();
        violations
            .filter(|one| matches!(one, Violation::NoPlacedNeighbour { .. }))
            .collect()
    };
    assert_eq!(of_order(&row_with_a_block(true, &[1])), []);
    assert_eq!(of_order(&row_with_a_block(true, &[1, 2])), []);
    let too_early = Violation::NoPlacedNeighbour {
        module: ModuleId(1),
        spot: SpotId(3),
    };
    let mut apart = row_with_a_block(false, &[1, 2]);
    assert_eq!(of_order(&apart), [too_early]);
    // Without that claim, nobody knows of which modules the block is.
    apart.claims.remove(0);
    assert_eq!(of_order(&apart), []);
}
