//! Bodies that meet, steps that begin too early, and blocks that are torn.

use super::*;

/// One published state: module, milliseconds, x, y in tenths of a unit, the drive, and the steps done.
type Moment = (u32, u64, i64, i64, DriveState, u32);

use DriveState::{Folding, Moving, Standing};

/// The states of modules that move along paths, each with its sequence number.
fn on_paths(moments: &[Moment]) -> Sequence {
    let mut sequence = good_sequence();
    sequence.states.clear();
    let mut sequences: BTreeMap<u32, u64> = BTreeMap::new();
    for &(module, millis, x, y, drive, steps) in moments {
        let number = sequences.entry(module).or_default();
        *number += 1;
        sequence.states.push(ModuleState {
            at: SenderTime(Duration::from_millis(millis)),
            drive,
            pose: Pose {
                x: MicroUnits(x * 100_000),
                y: MicroUnits(y * 100_000),
                theta: MicroUnits::ZERO,
            },
            steps_done: Some(steps),
            ..state(module, *number, ModulePhase::Moving)
        });
    }
    sequence
}

impl Sequence {
    fn dock(mut self, pairs: &[(u32, u32)]) -> Self {
        for state in &mut self.states {
            for &(one, other) in pairs {
                for (own, link) in [(one, other), (other, one)] {
                    if state.module == ModuleId(own) {
                        state.links.insert(ModuleId(link));
                    }
                }
            }
        }
        self
    }

    /// The messages in another order, but for the states of each module.
    fn merged(&self, seed: u64) -> Vec<Message> {
        let mut order: Vec<ModuleId> = self.states.iter().map(|state| state.module).collect();
        Random::from_seed(seed).shuffle(&mut order);
        let mut states = self.states.clone();
        let mut merged = self.messages();
        merged.retain(|message| !matches!(message, Message::ModuleState(_)));
        for module in order {
            let next = states.iter().position(|state| state.module == module);
            let state = states.remove(next.unwrap());
            merged.push(Message::ModuleState(Arc::new(state)));
        }
        merged
    }

    /// The violations of bodies, the same in whatever order the modules' states arrive.
    fn broken(&self) -> Vec<Violation> {
        self.broken_with(&patient())
    }

    fn broken_with(&self, parameters: &ObserverParameters) -> Vec<Violation> {
        let is_of_bodies = |violation: &Violation| {
            matches!(
                violation,
                Violation::BodiesOverlap { .. }
                    | Violation::WaitNotKept { .. }
                    | Violation::BlockTorn { .. }
            )
        };
        let found = |messages: &[Message]| -> Vec<Violation> {
            let mut observer = observe(messages, parameters.clone());
            let due = observer.poll_timeout().unwrap();
            let verdict = observer.verdict(due).unwrap();
            let found = verdict.violations.iter().cloned();
            found.filter(is_of_bodies).collect()
        };
        let violations = found(&self.messages());
        for seed in 0..5 {
            assert_eq!(found(&self.merged(seed)), violations, "in another order");
        }
        violations
    }

    #[track_caller]
    fn assert_broken(&self, expected: &[&str]) {
        let found: Vec<String> = self.broken().iter().map(ToString::to_string).collect();
        assert_eq!(found, expected);
    }
}

/// Shows V5.
#[test]
fn a_module_that_runs_into_another_is_found_whether_that_one_stands_or_moves() {
    let passing = [
        (1, 1_000, 0, 10, Moving, 0),
        (1, 2_000, 40, 10, Standing, 4),
    ];
    let standing = [(2, 100, 20, 14, Standing, 0)];
    let overlap = "module 1 and module 2 overlap by 0.500000 units in epoch 1.1 at 1.4 s";
    let entry = "module 1 began step 1 of its path in epoch 1.1 1 s too early for module 2 at 1 s";
    let all = [&passing[..], &standing].concat();
    on_paths(&all).assert_broken(&[overlap, entry]);
    let later = [(2, 5_000, 20, 14, Standing, 0)];
    let all = [&passing[..], &standing, &later].concat();
    on_paths(&all).assert_broken(&[overlap, entry]);
    let verdict = on_paths(&all).verdict();
    let risk = verdict.collision_risk.map(|risk| risk.to_string());
    assert_eq!(
        risk.as_deref(),
        Some("module 1 and module 2 overlapped in epoch 1.1")
    );
    let crossing = [
        (2, 1_000, 20, -10, Moving, 0),
        (2, 2_000, 20, 30, Standing, 4),
    ];
    let all = [&passing[..], &crossing].concat();
    assert!(matches!(
        on_paths(&all).broken()[..],
        [Violation::BodiesOverlap { depth, .. }, Violation::WaitNotKept { .. }]
            if depth.to_units() > 0.85
    ));
}

#[test]
fn a_module_that_left_in_time_is_not_run_into() {
    let passing = [
        (1, 1_000, 0, 10, Moving, 0),
        (1, 2_000, 40, 10, Standing, 4),
    ];
    let leaving = [
        (2, 100, 20, 10, Standing, 0),
        (2, 500, 20, 10, Moving, 0),
        (2, 1_000, 20, 20, Standing, 1),
    ];
    on_paths(&[&passing[..], &leaving].concat()).assert_broken(&[]);
    // Where a state is missing, nothing is judged; that it is missing is counted.
    let mut gap = on_paths(&[&passing[..], &leaving].concat());
    gap.states
        .retain(|state| state.at.0 != Duration::from_millis(500));
    gap.assert_broken(&[]);
    assert_eq!(gap.verdict().counts.missed_states, 1);
    // A module that is not part of the plan is not judged.
    let mut outsider = on_paths(&[&passing[..], &[(9, 100, 20, 10, Standing, 0)]].concat());
    outsider.assert_broken(&[]);
    outsider.further.clear();
}

/// A module seems to be in the way by its last state. It is if it goes on to send heartbeats without another, or if a later roster lists
/// its body there; otherwise it may have left, and its states are late or lost.
/// Shows V5.
#[test]
fn a_module_that_is_not_seen_to_leave_may_have_left_while_it_is_out_of_sight() {
    let passing = [
        (1, 1_000, 0, 10, Moving, 0),
        (1, 2_000, 40, 10, Standing, 4),
        (2, 100, 20, 10, Standing, 0),
    ];
    let leaving = [(2, 500, 20, 10, Moving, 0), (2, 1_000, 20, 20, Standing, 1)];
    let early = on_paths(&passing);
    let all = on_paths(&[&passing[..], &leaving].concat());
    let found_in = |early: &Sequence, further: &[Message], lives: bool| {
        let is_of_two = |violation: &&Violation| violation.to_string().contains("overlap by");
        let mut observer = observe(&early.messages(), ObserverParameters::default());
        let limit = observer.poll_timeout().unwrap();
        let violations = &observer.review(limit).unwrap().violations;
        assert_eq!(violations.iter().filter(is_of_two).count(), 0, "too early");
        for message in further {
            observer.handle(limit, message);
        }
        let mut now = limit;
        for beat in 13.. {
            now += Duration::from_secs(1);
            if lives {
                observer.handle(now, &Message::Heartbeat(heartbeat(2, beat, 10)));
            }
            observer.review(now);
            if now >= 3 * limit {
                break;
            }
        }
        let violations = &observer.verdict(now).unwrap().violations;
        violations.iter().filter(is_of_two).count()
    };
    let found_after = |further: &[Message], lives: bool| found_in(&early, further, lives);
    let roster_with = |whereabouts: Whereabouts| {
        let mut roster = all.roster();
        roster.epoch.number += 1;
        let left = roster.members.remove(1);
        roster.bodies.push(BodyReport {
            module: left.module.id,
            incarnation: left.incarnation,
            epoch: Some(EPOCH),
            sequence: 1,
            whereabouts,
        });
        let plan = RosterMessage::Plan(Arc::new(roster.into()));
        vec![Message::Roster(plan)]
    };
    let states = all.states.iter().cloned().map(Arc::new);
    let states: Vec<Message> = states.map(Message::ModuleState).collect();
    assert_eq!(found_after(&[], false), 0);
    assert_eq!(found_after(&states, false), 0);
    assert_eq!(found_after(&states, true), 0);
    assert_eq!(found_after(&[], true), 1);
    let way = Whereabouts::OnTheWay(Polyline::line(pose(2, 1), pose(2, 2)));
    assert_eq!(found_after(&roster_with(way), false), 0);
    let halted = Whereabouts::Halted(pose(2, 1));
    assert_eq!(found_after(&roster_with(halted), false), 1);
    // To a verifier that came late its last state came, and no heartbeat.
    let mut unheard = on_paths(&passing);
    unheard.heartbeats.retain(|one| one.module != ModuleId(2));
    assert_eq!(found_in(&unheard, &[], false), 0);
    assert_eq!(found_in(&unheard, &[], true), 1);
}

/// Its drive halted by itself, nobody knows where.
#[test]
fn between_two_states_of_a_process_that_was_stopped_nothing_is_judged() {
    let passing = [
        (1, 1_000, 0, 10, Moving, 0),
        (1, 2_000, 40, 10, Standing, 4),
    ];
    let stopped_until = |millis| [(2, 100, 0, 14, Moving, 0), (2, millis, 40, 14, Standing, 4)];
    let found = |millis| on_paths(&[&passing[..], &stopped_until(millis)].concat()).broken();
    assert!(!found(4_100).is_empty());
    assert_eq!(found(12_100), []);
}

/// Shows V5.
#[test]
fn one_that_follows_too_closely_is_found_although_the_bodies_do_not_touch() {
    let first = [(1, 1_000, 10, 0, Moving, 0), (1, 2_000, 50, 0, Standing, 4)];
    let close = [(2, 1_500, 0, 0, Moving, 2), (2, 1_750, 10, 0, Standing, 3)];
    on_paths(&[&first[..], &close].concat()).assert_broken(&[
        "module 2 began step 3 of its path in epoch 1.1 0.25 s too early for module 1 at 1.5 s",
    ]);
    let in_time = [(2, 1_960, 0, 0, Moving, 2), (2, 2_200, 10, 0, Standing, 3)];
    on_paths(&[&first[..], &in_time].concat()).assert_broken(&[]);
}

/// A clock was set back between two runs of module 2, which has left the way of module 1. Its later run has the lower number, and it is not
/// known where it stands by now: it is not judged until a run with a higher number publishes.
#[test]
fn a_module_whose_later_run_has_a_lower_number_is_not_run_into_where_the_former_run_stood() {
    let former = ModuleRun {
        module: ModuleId(2),
        incarnation: Incarnation(INCARNATION.0 + 1),
    };
    let of_former = |sequence| {
        Message::ModuleState(Arc::new(ModuleState {
            sequence,
            at: SenderTime(Duration::from_millis(100)),
            drive: Standing,
            steps_done: Some(0),
            pose: pose(2, 1),
            ..ModuleState::standing(former, pose(2, 1))
        }))
    };
    let passing = [
        (1, 1_000, 0, 10, Moving, 0),
        (1, 2_000, 40, 10, Standing, 4),
    ];
    let broken = |later: &[Moment], further: &[Message]| {
        let mut messages = on_paths(&[]).messages();
        messages.push(of_former(1));
        messages.push(Message::Heartbeat(Heartbeat::first(former)));
        let states = on_paths(&[later, &passing].concat()).states;
        messages.extend(
            states
                .into_iter()
                .map(|one| Message::ModuleState(Arc::new(one))),
        );
        messages.extend_from_slice(further);
        let mut observer = observe(&messages, patient());
        let due = observer.poll_timeout().unwrap();
        observer.verdict(due).unwrap().violations.clone()
    };
    assert!(!broken(&[], &[]).is_empty(), "it stands in the way");
    let elsewhere = [(2, 50, 90, 90, Standing, 0)];
    assert_eq!(broken(&elsewhere, &[]), []);
    // A late state of an earlier run, and the later one goes on.
    assert!(!broken(&elsewhere, &[of_former(2)]).is_empty());
}

/// Module 3 turns about module 2 in a block with module 1 between them, over places that module 2 leaves meanwhile. Without a state of
/// module 1, the two might be parted or not.
#[test]
fn modules_between_which_states_are_missing_may_be_docked() {
    let moments = [
        (1, 900, 10, 10, Standing, 0),
        (1, 1_000, 10, 10, Moving, 0),
        (1, 1_500, 10, 15, Moving, 1),
        (1, 2_000, 10, 20, Standing, 2),
        (2, 900, 0, 10, Standing, 0),
        (2, 1_000, 0, 10, Folding, 0),
        (2, 2_000, 40, 10, Standing, 2),
        (3, 900, 20, 10, Standing, 0),
        (3, 1_000, 20, 10, Folding, 0),
        (3, 2_000, 20, 14, Standing, 2),
    ];
    let block = || on_paths(&moments).dock(&[(1, 2), (1, 3)]);
    assert_eq!(block().broken(), []);
    let mut gap = block();
    gap.states
        .retain(|state| state.module != ModuleId(1) || state.at.0 != Duration::from_millis(1_500));
    assert_eq!(gap.broken(), []);
    assert!(!on_paths(&moments).dock(&[(1, 2)]).broken().is_empty());
}

fn pair(partner: [(u64, i64, DriveState); 4]) -> Vec<Moment> {
    let mut moments = Vec::new();
    for (steps, (millis, x, drive)) in (0..).zip([
        (1_000, 0, Moving),
        (1_200, 10, Moving),
        (1_400, 20, Moving),
        (1_600, 30, Standing),
    ]) {
        moments.push((1, millis, x, 0, drive, steps));
    }
    for (steps, (millis, x, drive)) in (0..).zip(partner) {
        moments.push((2, millis, x, 10, drive, steps));
    }
    // What was there before the motion.
    moments.extend([(1, 900, 0, 0, Standing, 0), (2, 900, 0, 10, Standing, 0)]);
    moments.sort_by_key(|&(module, millis, ..)| (module, millis));
    moments
}

/// Shows V5.
#[test]
fn docked_modules_keep_their_places_from_step_to_step_unless_they_fold() {
    let rigid = [
        (1_010, 0, Moving),
        (1_210, 10, Moving),
        (1_410, 20, Moving),
        (1_610, 30, Standing),
    ];
    on_paths(&pair(rigid)).dock(&[(1, 2)]).assert_broken(&[]);
    let mut torn = rigid;
    torn[2].1 = 17;
    torn[3].1 = 27;
    on_paths(&pair(torn)).dock(&[(1, 2)]).assert_broken(&[
        "module 1 and module 2 are docked and 0.300000 units off their places to each other after step 2 in epoch 1.1 at 1.41 s",
    ]);
    // Two poses, each off by the position tolerance, are off each other by twice as much.
    let broken_with = |micros| {
        let parameters = ObserverParameters {
            position_tolerance: MicroUnits(micros),
            ..patient()
        };
        on_paths(&pair(torn))
            .dock(&[(1, 2)])
            .broken_with(&parameters)
    };
    assert_eq!(broken_with(151_000), []);
    assert_eq!(broken_with(149_000).len(), 1);
    let mut folding = torn;
    folding[1].2 = Folding;
    on_paths(&pair(folding)).dock(&[(1, 2)]).assert_broken(&[]);
    // While they are docked, they may overlap in a fold.
    (folding[2].1, folding[3].1) = (20, 30);
    let mut over = pair(folding);
    over.iter_mut()
        .filter(|one| one.0 == 2 && one.1 >= 1_410)
        .for_each(|one| one.3 = 2);
    assert!(on_paths(&over).dock(&[(1, 2)]).broken().is_empty());
    assert!(!on_paths(&over).broken().is_empty());
}

/// Shows V5. Halted in mid-step they are off their places, and come back in one direction after the other; halted in a fold, each
/// goes to a cell of its own, which may be farther from its place at the other.
#[test]
fn docked_modules_that_were_halted_off_their_places_are_no_rigid_body() {
    let along = [
        (1_010, 3, Moving),
        (1_210, 13, Moving),
        (1_410, 20, Moving),
        (1_610, 30, Standing),
    ];
    let halted_off = |y: i64| {
        let mut moments = pair(along);
        for moment in moments
            .iter_mut()
            .filter(|one| one.0 == 2 && one.1 <= 1_010)
        {
            (moment.2, moment.3) = (3, y);
        }
        on_paths(&moments).dock(&[(1, 2)])
    };
    halted_off(12).assert_broken(&[]);
    let in_mid_fold = [
        (1, 900, 110, 80, Standing, 0),
        (1, 1_000, 110, 80, Moving, 0),
        (1, 1_200, 110, 80, Standing, 1),
    ];
    let partner = [
        (2, 900, 100, 72, Standing, 0),
        (2, 1_010, 100, 72, Moving, 0),
        (2, 1_210, 100, 70, Standing, 1),
    ];
    on_paths(&[in_mid_fold, partner].concat())
        .dock(&[(1, 2)])
        .assert_broken(&[]);
    let mut torn = halted_off(10);
    for state in &mut torn.states {
        let is_before = state.steps_done == Some(0);
        if state.module == ModuleId(2) && is_before {
            state.pose.x = MicroUnits(50_000);
        }
    }
    assert!(matches!(
        torn.broken()[..],
        [Violation::BlockTorn { step: 1, .. }]
    ));
}

#[test]
fn a_module_that_begins_a_step_before_its_partner_has_done_the_one_before_is_found() {
    let late = [
        (1_010, 0, Moving),
        (1_300, 10, Moving),
        (1_500, 20, Moving),
        (1_700, 30, Standing),
    ];
    on_paths(&pair(late)).dock(&[(1, 2)]).assert_broken(&[
        "module 1 began step 2 of its path in epoch 1.1 0.1 s too early for module 2 at 1.2 s",
    ]);
}

#[test]
fn the_greatest_number_of_steps_is_judged_like_any_other() {
    let through = [
        (1, 1_000, 0, 10, Moving, u32::MAX),
        (1, 2_000, 40, 10, Standing, 0),
        (2, 100, 20, 14, Standing, 0),
    ];
    assert!(!on_paths(&through).broken().is_empty());
    let before = [
        through[0],
        (1, 2_000, 5, 10, Standing, u32::MAX),
        through[2],
    ];
    assert!(on_paths(&before).broken().is_empty());
}

/// Shows X9.
#[test]
fn a_module_that_moves_and_counts_no_steps_breaks_its_promise() {
    let mut sequence = good_sequence();
    sequence.state(3, 2).steps_done = None;
    let module = ModuleId(3);
    sequence.assert_violates(&Violation::MovedWithoutPlan { module });
}

/// Module 5 passes module 4 on its spot, so near that their bodies overlap by 0.2 units by their poses.
fn with_a_doubtful_pass() -> Sequence {
    let pass = [
        (5, 1_000, 83, -20, Moving, 0),
        (5, 5_000, 83, 20, Standing, 4),
    ];
    let mut sequence = good_sequence();
    let mut stands = sequence.state(4, 3).clone();
    stands.sequence = 4;
    stands.at = SenderTime(Duration::from_secs(6));
    sequence.states.push(stands);
    let spare = |state: &ModuleState| state.module == ModuleId(5) && state.sequence == 2;
    sequence.states.retain(|state| !spare(state));
    for mut state in on_paths(&pass).states {
        state.sequence += 1;
        state.phase = ModulePhase::Spare;
        sequence.states.push(state);
    }
    sequence
}

/// Shows V1.
#[test]
fn bodies_that_overlap_by_less_than_the_tolerances_of_their_poses_are_not_judged() {
    let sequence = with_a_doubtful_pass();
    let judge = |position_tolerance| {
        let parameters = ObserverParameters {
            position_tolerance: MicroUnits(position_tolerance),
            ..patient()
        };
        let mut observer = observe(&sequence.messages(), parameters);
        let due = observer.poll_timeout().unwrap();
        observer.verdict(due).unwrap().clone()
    };
    let verdict = judge(50_000);
    assert_eq!(verdict.outcome, Outcome::Failed);
    assert!(verdict.collision_risk.is_some(), "{:?}", verdict.violations);
    let verdict = judge(150_000);
    assert_eq!(verdict.violations, []);
    assert_eq!(verdict.outcome, Outcome::NotJudged);
    let passed = Duration::from_secs(4);
    assert_eq!(verdict.unjudged, BTreeMap::from([(ModuleId(5), passed)]));
    assert_eq!(good_sequence().verdict().unjudged, BTreeMap::new());
}

/// A hand has carried module 1 through module 2.
/// Shows V5.
#[test]
fn the_way_on_which_a_module_was_displaced_is_not_judged() {
    use DriveState::Displaced;
    let carried = [
        (1, 1_000, 0, 10, Standing, 0),
        (1, 1_200, 40, 10, Displaced, 0),
        (1, 4_000, 40, 10, Standing, 0),
        (2, 100, 20, 10, Standing, 0),
        (2, 5_000, 20, 10, Standing, 0),
    ];
    on_paths(&carried).assert_broken(&[]);
    let driven = carried.map(|moment| match moment {
        (1, 1_000, x, y, _, steps) => (1, 1_000, x, y, Moving, steps),
        (1, 1_200, x, y, _, steps) => (1, 1_200, x, y, Standing, steps),
        other => other,
    });
    assert!(!on_paths(&driven).broken().is_empty());
}

/// Modules 1 and 2 move one behind the other, docked, until a hand tears 2 off: 1 says so in a state whose pose is older.
/// Shows V5.
#[test]
fn modules_were_docked_until_the_state_that_says_otherwise_was_published() {
    use DriveState::Displaced;
    let moments = [
        (1, 1_000, 0, 10, Moving, 0),
        (2, 1_000, 10, 10, Moving, 0),
        (1, 1_100, 5, 10, Moving, 0),
        (2, 1_200, 20, 10, Standing, 1),
        (2, 1_200, 20, 30, Displaced, 1),
        (1, 1_201, 10, 10, Standing, 1),
    ];
    let mut torn = on_paths(&moments).dock(&[(1, 2)]);
    let links = |sequence: &Sequence, number: usize| sequence.states[number].links.clone();
    assert_eq!(links(&torn, 2), BTreeSet::from([ModuleId(2)]));
    for number in [2, 4, 5] {
        torn.states[number].links.clear();
    }
    assert_eq!(torn.broken(), []);
    let mut never = on_paths(&moments);
    never.states.truncate(4);
    assert!(!never.broken().is_empty());
}

/// It has not settled until it is back.
/// Shows V5.
#[test]
fn a_settled_module_that_shows_that_it_was_displaced_is_missing() {
    let mut sequence = good_sequence();
    sequence.state(3, 3).drive = DriveState::Displaced;
    let verdict = sequence.verdict();
    assert_eq!(verdict.outcome, Outcome::Failed);
    assert!(verdict.violations.is_empty(), "{:?}", verdict.violations);
    let missing: Vec<String> = verdict.missing.iter().map(ToString::to_string).collect();
    assert!(
        missing.iter().any(|one| one.contains("module 3")),
        "{missing:?}"
    );
}
