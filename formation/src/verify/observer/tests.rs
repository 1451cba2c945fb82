//! Hand-made message sequences: the good case in any order, and each violation.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use super::*;
use crate::generate::random::Random;
use crate::geometry::Pose;
use crate::id::{Digest, Incarnation};
use crate::message::{
    CausalMark, Decision, EvictionRecord, Heartbeat, ModuleState, Roster, RosterMember, SpotClaim,
    SpotSelection,
};
use crate::parameters::PlannerParameters;
use crate::problem::PlanningModule;
use crate::target::{RawSpot, RawTarget, Target};

const EPOCH: Epoch = Epoch {
    number: 1,
    convener: ModuleId(1),
};
const RUN: Incarnation = Incarnation(77);
const PLAN: Digest = Digest(0xfeed);

/// A formation of four modules on a star: spot 2 in the middle, 1, 3 and 4 around it.
///
/// Module 3 takes spot 4 first; module 4 evicts it to spot 1; the block of modules 1 and 2 takes spots 2 and 3 and moves
/// first, on the agreement of all; then modules 3 and 4 move, one after the other. Module 5 is left over.
struct Run {
    target: TargetAnnouncement,
    members: Vec<RosterMember>,
    claims: Vec<SpotClaim>,
    states: Vec<ModuleState>,
    heartbeats: Vec<Heartbeat>,
    further: Vec<Message>,
}

fn pose(x: i64, y: i64) -> Pose {
    Pose {
        x: MicroUnits(x * 1_000_000),
        y: MicroUnits(y * 1_000_000),
        theta: MicroUnits::ZERO,
    }
}

fn modules(ids: &[u32]) -> BTreeSet<ModuleId> {
    ids.iter().copied().map(ModuleId).collect()
}

fn marks(pairs: &[(u32, u64)]) -> Vec<CausalMark> {
    pairs
        .iter()
        .map(|&(module, sequence)| CausalMark {
            module: ModuleId(module),
            sequence,
        })
        .collect()
}

fn select(pairs: &[(u32, u32)]) -> Vec<SpotSelection> {
    pairs
        .iter()
        .map(|&(spot, module)| SpotSelection {
            spot: SpotId(spot),
            module: ModuleId(module),
        })
        .collect()
}

fn state(module: u32, sequence: u64, phase: ModulePhase) -> ModuleState {
    ModuleState {
        module: ModuleId(module),
        incarnation: RUN,
        sequence,
        epoch: Some(EPOCH),
        digest: Some(PLAN),
        phase,
        pose: pose(0, i64::from(module)),
        links: BTreeSet::new(),
        configuration: None,
        leader: None,
        spot: None,
        unit: None,
        settled_since: 0,
        waited_for: Vec::new(),
        agreed_on: Vec::new(),
        quorum_bases: Vec::new(),
    }
}

fn star() -> Arc<Target> {
    let places = [(1, 10, 1), (2, 10, 0), (3, 11, 0), (4, 9, 0)];
    let raw = RawTarget {
        frame_id: "map".to_owned(),
        spots: places
            .iter()
            .map(|&(id, x, y)| RawSpot {
                id,
                x: f64::from(x),
                y: f64::from(y),
                theta: 0.0,
            })
            .collect(),
        edges: vec![[1, 2], [3, 2], [4, 2]],
    };
    Arc::new(Target::try_from(raw).unwrap())
}

fn good_run() -> Run {
    let target = TargetAnnouncement {
        revision: 1,
        name: "star".to_owned(),
        target: Some(star()),
        parameters: PlannerParameters::default(),
        expected_modules: Some(5),
    };
    let links = |id| match id {
        1 => modules(&[2]),
        2 => modules(&[1]),
        _ => BTreeSet::new(),
    };
    let members = (1..=5)
        .map(|id| RosterMember {
            incarnation: RUN,
            module: PlanningModule {
                id: ModuleId(id),
                pose: pose(0, i64::from(id)),
                links: links(id),
                configuration: None,
                leader: None,
                pin: None,
            },
        })
        .collect();
    let claim = |turn, claimant, decision| SpotClaim {
        epoch: EPOCH,
        turn,
        claimant: ModuleId(claimant),
        incarnation: RUN,
        decision,
    };
    let claims = vec![
        claim(
            0,
            3,
            Decision {
                selections: select(&[(4, 3)]),
                ..Decision::default()
            },
        ),
        claim(
            1,
            4,
            Decision {
                selections: select(&[(1, 3), (4, 4)]),
                evictions: vec![EvictionRecord {
                    evicted: ModuleId(3),
                    by: ModuleId(4),
                    from: SpotId(4),
                    to: Some(SpotId(1)),
                }],
                ..Decision::default()
            },
        ),
        claim(
            2,
            1,
            Decision {
                selections: select(&[(2, 1), (3, 2)]),
                ..Decision::default()
            },
        ),
        claim(3, 5, Decision::default()),
    ];
    Run {
        target,
        members,
        claims,
        states: good_states(),
        heartbeats: (1..=5).map(|id| heartbeat(id, 12, 10)).collect(),
        further: Vec::new(),
    }
}

fn heartbeat(module: u32, sequence: u64, digest_since: u64) -> Heartbeat {
    Heartbeat {
        module: ModuleId(module),
        incarnation: RUN,
        sequence,
        uptime: Duration::from_secs(1),
        epoch: Some(EPOCH),
        digest: Some(PLAN),
        digest_since,
        applied_turns: 4,
        phase: ModulePhase::Agreeing,
    }
}

fn good_states() -> Vec<ModuleState> {
    let mut states: Vec<ModuleState> = (1..=5)
        .map(|id| state(id, 1, ModulePhase::Planning))
        .collect();
    states.push(state(5, 2, ModulePhase::Spare));
    let agreement = marks(&[(2, 11), (3, 10), (4, 12), (5, 10)]);
    let before_3 = marks(&[(1, 3), (2, 3)]);
    let before_4 = marks(&[(1, 4), (2, 3), (3, 3)]);
    let acts = [
        (1, 1, 2, pose(10, 0), modules(&[2, 3, 4]), Vec::new()),
        (2, 1, 3, pose(11, 0), modules(&[1]), Vec::new()),
        (3, 3, 1, pose(10, 1), modules(&[1]), before_3),
        (4, 4, 4, pose(9, 0), modules(&[1]), before_4),
    ];
    for (module, unit, spot, place, links, waited_for) in acts {
        for (sequence, phase) in [(2, ModulePhase::Moving), (3, ModulePhase::Settled)] {
            let mut state = state(module, sequence, phase);
            state.unit = Some(ModuleId(unit));
            state.spot = Some(SpotId(spot));
            state.waited_for.clone_from(&waited_for);
            if module == 1 {
                state.agreed_on.clone_from(&agreement);
            }
            if phase == ModulePhase::Settled {
                state.pose = place;
                state.links.clone_from(&links);
            }
            states.push(state);
        }
    }
    states
}

impl Run {
    fn state(&mut self, module: u32, sequence: u64) -> &mut ModuleState {
        self.states
            .iter_mut()
            .find(|state| state.module == ModuleId(module) && state.sequence == sequence)
            .unwrap()
    }

    fn acts_of(&mut self, module: u32) -> impl Iterator<Item = &mut ModuleState> {
        self.states.iter_mut().filter(move |state| {
            state.module == ModuleId(module)
                && matches!(state.phase, ModulePhase::Moving | ModulePhase::Settled)
        })
    }

    fn roster(&self) -> Roster {
        Roster {
            epoch: EPOCH,
            target: self.target.clone(),
            members: self.members.clone(),
            quorum_bases: Vec::new(),
        }
    }

    fn messages(&self) -> Vec<Message> {
        let mut messages = vec![
            Message::Target(Arc::new(self.target.clone())),
            Message::Roster(RosterMessage::Gather {
                epoch: EPOCH,
                target_revision: 1,
            }),
            Message::Roster(RosterMessage::Plan(Arc::new(self.roster()))),
        ];
        let claims = self.claims.iter().cloned().map(Arc::new);
        messages.extend(claims.map(Message::Claim));
        messages.extend(self.heartbeats.iter().copied().map(Message::Heartbeat));
        let states = self.states.iter().cloned().map(Arc::new);
        messages.extend(states.map(Message::ModuleState));
        messages.extend(self.further.iter().cloned());
        messages
    }

    fn observe(&self) -> Observer {
        observe(&self.messages(), ObserverParameters::default())
    }

    /// The verdict once every wait is over.
    fn verdict(&self) -> Verdict {
        let mut observer = self.observe();
        if let Some(verdict) = observer.verdict(Duration::from_secs(1)) {
            return verdict.clone();
        }
        let due = observer.poll_timeout().unwrap();
        observer.verdict(due).unwrap().clone()
    }

    #[track_caller]
    fn assert_violates(&self, expected: &Violation) {
        let verdict = self.verdict();
        assert_eq!(verdict.outcome, Outcome::Failed);
        assert!(
            verdict.violations.contains(expected),
            "expected {expected:?} among {:?}",
            verdict.violations
        );
        let mut messages = self.messages();
        Random::from_seed(5).shuffle(&mut messages);
        let mut observer = observe(&messages, ObserverParameters::default());
        observer.verdict(Duration::from_secs(1));
        let due = observer.poll_timeout().unwrap();
        let violations = &observer.verdict(due).unwrap().violations;
        assert_eq!(violations, &verdict.violations, "in another order");
    }

    #[track_caller]
    fn assert_missing(&self, expected: &[Missing]) {
        let verdict = self.verdict();
        assert_eq!(verdict.outcome, Outcome::Failed);
        assert_eq!(verdict.missing, expected);
        assert_eq!(verdict.violations, []);
    }
}

fn observe(messages: &[Message], parameters: ObserverParameters) -> Observer {
    let mut observer = Observer::new(parameters);
    for (number, message) in (1..).zip(messages) {
        observer.handle(Duration::from_millis(number), message);
    }
    observer
}

#[test]
fn a_good_run_is_complete() {
    let verdict = good_run().verdict();
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

#[test]
fn neither_the_order_of_arrival_nor_repetition_matters() {
    let run = good_run();
    for seed in 0..200 {
        let mut random = Random::from_seed(seed);
        let mut messages = run.messages();
        messages.extend(run.messages());
        random.shuffle(&mut messages);
        let mut observer = observe(&messages, ObserverParameters::default());
        let verdict = observer.verdict(Duration::from_secs(1)).unwrap();
        assert_eq!(verdict.outcome, Outcome::Complete, "seed {seed}");
        assert_eq!(verdict.assignments.len(), 4);
    }
}

#[test]
fn no_verdict_comes_before_the_last_message() {
    let mut messages = good_run().messages();
    for seed in 0..50 {
        Random::from_seed(seed).shuffle(&mut messages);
        let mut observer = Observer::new(ObserverParameters::default());
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

#[test]
fn states_that_were_missed_are_not_held_against_the_modules() {
    let mut run = good_run();
    run.states
        .retain(|state| matches!(state.phase, ModulePhase::Settled | ModulePhase::Spare));
    assert_eq!(run.verdict().outcome, Outcome::Complete);
}

#[test]
fn progress_follows_the_run() {
    let run = good_run();
    let mut observer = Observer::new(ObserverParameters::default());
    assert_eq!(observer.progress().stage, Stage::WaitingForTarget);
    let mut stages = Vec::new();
    for message in run.messages() {
        observer.handle(Duration::ZERO, &message);
        let progress = observer.progress();
        if stages.last() != Some(&progress.stage) {
            stages.push(progress.stage);
        }
    }
    assert_eq!(
        stages,
        [
            Stage::Gathering,
            Stage::Planning,
            Stage::Agreeing,
            Stage::Acting,
            Stage::Done
        ]
    );
    let mut partly = good_run();
    partly
        .states
        .retain(|state| state.module != ModuleId(4) || state.phase != ModulePhase::Settled);
    partly.heartbeats.retain(|one| one.module != ModuleId(2));
    let progress = partly.observe().progress();
    assert_eq!(progress.stage, Stage::Agreeing);
    assert_eq!((progress.joined, progress.expected), (5, Some(5)));
    assert_eq!((progress.planned, progress.agreed), (4, 4));
    assert_eq!((progress.settled, progress.to_fill), (3, 4));
    assert_eq!(progress.waiting_for, [ModuleId(2)]);
}

#[test]
fn fewer_modules_than_spots_are_partial() {
    let mut run = good_run();
    run.members
        .retain(|member| member.module.id != ModuleId(4) && member.module.id != ModuleId(5));
    run.states.retain(|state| state.module < ModuleId(4));
    run.heartbeats.retain(|one| one.module < ModuleId(4));
    run.target.expected_modules = Some(3);
    run.claims.remove(1);
    run.claims[0].decision.selections = select(&[(1, 3)]);
    run.claims[1].turn = 1;
    run.claims.truncate(2);
    for heartbeat in &mut run.heartbeats {
        heartbeat.applied_turns = 2;
    }
    for state in run.acts_of(1) {
        state.agreed_on = marks(&[(2, 11), (3, 10)]);
        state.links.remove(&ModuleId(4));
    }
    let verdict = run.verdict();
    assert_eq!(verdict.violations, []);
    assert_eq!(verdict.outcome, Outcome::Partial);
    assert_eq!(verdict.open_spots, [SpotId(4)]);
    assert!(run.observe().verdict(Duration::from_secs(1)).is_some());
    // More are expected, so it waits for them a little.
    run.target.expected_modules = Some(4);
    assert!(run.observe().verdict(Duration::from_secs(1)).is_none());
    assert_eq!(run.verdict().outcome, Outcome::Partial);
}

#[test]
fn a_later_epoch_supersedes_an_earlier_one() {
    let mut run = good_run();
    let later = Epoch {
        number: 2,
        convener: ModuleId(1),
    };
    let mut roster = run.roster();
    roster.epoch = later;
    run.further = vec![Message::Roster(RosterMessage::Plan(Arc::new(
        roster.clone(),
    )))];
    let verdict = run.verdict();
    assert_eq!(verdict.outcome, Outcome::Failed);
    assert_eq!(verdict.epoch, Some(later));

    // All stay on their spots in the later epoch.
    let spots = [2, 3, 1, 4];
    for (member, spot) in roster.members.iter_mut().zip(spots) {
        member.module.pin = Some(SpotId(spot));
    }
    run.further = vec![Message::Roster(RosterMessage::Plan(Arc::new(roster)))];
    run.further.push(Message::Claim(Arc::new(SpotClaim {
        epoch: later,
        turn: 0,
        ..run.claims[3].clone()
    })));
    for id in 1..=5 {
        run.further.push(Message::Heartbeat(Heartbeat {
            epoch: Some(later),
            digest: Some(Digest(3)),
            applied_turns: 1,
            ..heartbeat(id, 40, 30)
        }));
        let last = run
            .states
            .iter()
            .rfind(|state| state.module == ModuleId(id));
        run.further.push(Message::ModuleState(Arc::new(ModuleState {
            sequence: 9,
            epoch: Some(later),
            digest: Some(Digest(3)),
            waited_for: Vec::new(),
            agreed_on: Vec::new(),
            ..last.unwrap().clone()
        })));
    }
    let verdict = run.verdict();
    assert_eq!(verdict.violations, []);
    assert_eq!(
        (verdict.outcome, verdict.epoch),
        (Outcome::Complete, Some(later))
    );
    // What was wrong in the earlier epoch stays wrong.
    run.state(3, 2).digest = Some(Digest(4));
    let verdict = run.verdict();
    assert!(matches!(
        verdict.violations[..],
        [Violation::PlansDiffer { epoch: EPOCH, .. }]
    ));
    assert_eq!(verdict.outcome, Outcome::Failed);
}

#[test]
fn a_restarted_module_no_longer_counts_as_settled() {
    let mut run = good_run();
    let mut restarted = state(2, 1, ModulePhase::Listening);
    restarted.incarnation = Incarnation(90);
    run.further = vec![Message::ModuleState(Arc::new(restarted))];
    run.assert_missing(&[Missing::Settled {
        module: ModuleId(2),
        spot: SpotId(3),
        phase: None,
    }]);
    // A second process with a living module's identifier changes nothing.
    run.further.push(Message::Heartbeat(heartbeat(2, 13, 10)));
    assert_eq!(run.verdict().outcome, Outcome::Complete);
}

mod at_the_time_limit {
    use super::*;

    #[test]
    fn silence_is_named() {
        let mut observer = observe(
            &[],
            ObserverParameters {
                expected: modules(&[4, 7]),
                ..ObserverParameters::default()
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
                "module 4 was never heard",
                "module 7 was never heard",
                "0 of 2 modules were heard",
                "no target was announced"
            ]
        );
    }

    #[test]
    fn a_missing_roster_is_named() {
        let mut run = good_run();
        run.target.revision = 2;
        let announced = Message::Target(Arc::new(run.target.clone()));
        run.target.revision = 1;
        run.further = vec![announced];
        run.assert_missing(&[Missing::Roster { revision: 2 }]);
        let mut withdrawn = run.target.clone();
        withdrawn.revision = 3;
        withdrawn.target = None;
        run.further.push(Message::Target(Arc::new(withdrawn)));
        run.assert_missing(&[Missing::WithdrawnTarget]);
    }

    #[test]
    fn a_missing_claim_is_named() {
        let mut run = good_run();
        run.claims.remove(3);
        run.assert_missing(&[Missing::Claim {
            epoch: EPOCH,
            turn: 3,
        }]);
    }

    #[test]
    fn a_module_that_is_still_on_its_way_is_named() {
        let mut run = good_run();
        run.states
            .retain(|state| state.module != ModuleId(4) || state.phase != ModulePhase::Settled);
        run.assert_missing(&[Missing::Settled {
            module: ModuleId(4),
            spot: SpotId(4),
            phase: Some(ModulePhase::Moving),
        }]);
        let verdict = run.verdict();
        assert_eq!(verdict.open_spots, [SpotId(4)]);
        assert_eq!(
            verdict.missing[0].to_string(),
            "module 4 has not settled on spot 4; it is MOVING"
        );
    }

    #[test]
    fn a_module_that_never_agreed_is_named() {
        let mut run = good_run();
        run.heartbeats.retain(|one| one.module != ModuleId(3));
        run.assert_missing(&[Missing::Agreement {
            epoch: EPOCH,
            module: ModuleId(3),
            phase: Some(ModulePhase::Settled),
        }]);
    }

    #[test]
    fn a_spare_that_says_nothing_is_named() {
        let mut run = good_run();
        run.states.retain(|state| state.phase != ModulePhase::Spare);
        run.assert_missing(&[Missing::Spare {
            module: ModuleId(5),
            phase: Some(ModulePhase::Planning),
        }]);
    }
}

mod violations {
    use super::*;

    #[test]
    fn of_claims() {
        let mut run = good_run();
        run.claims[1].decision.selections = select(&[(2, 3), (4, 4)]);
        run.assert_violates(&Violation::WrongEviction {
            turn: 1,
            module: ModuleId(3),
            spot: SpotId(1),
        });

        let mut run = good_run();
        run.claims[1].decision.evictions.clear();
        run.claims[1].decision.selections = select(&[(4, 4)]);
        run.assert_violates(&Violation::SpotTaken {
            turn: 1,
            spot: SpotId(4),
            module: ModuleId(4),
            holder: ModuleId(3),
        });

        let mut run = good_run();
        run.claims[1].decision.evictions.clear();
        run.assert_violates(&Violation::MovedWithoutEviction {
            turn: 1,
            module: ModuleId(3),
            spot: SpotId(4),
        });

        let mut run = good_run();
        run.claims[3].decision = Decision {
            selections: select(&[(3, 5)]),
            evictions: vec![EvictionRecord {
                evicted: ModuleId(2),
                by: ModuleId(5),
                from: SpotId(3),
                to: None,
            }],
            detached: Vec::new(),
        };
        run.assert_violates(&Violation::MemberEvicted {
            turn: 3,
            module: ModuleId(2),
            spot: SpotId(3),
        });

        let mut run = good_run();
        run.claims[3].decision.selections = select(&[(9, 5)]);
        run.assert_violates(&Violation::UnknownSpot { spot: SpotId(9) });
        run.claims[3].decision.selections = select(&[(1, 9)]);
        run.assert_violates(&Violation::UnknownModule {
            module: ModuleId(9),
        });

        let mut run = good_run();
        run.claims[2].decision.selections = select(&[(1, 1), (2, 1), (3, 2)]);
        run.assert_violates(&Violation::TwoSpots {
            turn: 2,
            module: ModuleId(1),
        });

        let mut run = good_run();
        run.claims[3].decision.detached = vec![ModuleId(2)];
        run.assert_violates(&Violation::DetachedTooLate {
            turn: 3,
            module: ModuleId(2),
            spot: SpotId(3),
        });

        let mut run = good_run();
        run.target.parameters.d_max = Some(0);
        run.assert_violates(&Violation::ChainTooLong {
            turn: 1,
            evictions: 1,
            limit: 0,
        });
    }

    #[test]
    fn of_rival_claims() {
        let mut run = good_run();
        let mut rival = run.claims[0].clone();
        rival.decision.selections = select(&[(1, 3)]);
        // The eviction of turn 1 contradicts it, but that comes later: nobody can tell which one was applied.
        run.claims.push(rival.clone());
        run.assert_violates(&Violation::ClaimsDiffer {
            epoch: EPOCH,
            turn: 0,
        });
        // A stranger's claim counts for nothing.
        run.claims[4].claimant = ModuleId(40);
        assert_eq!(run.verdict().outcome, Outcome::Complete);
        run.claims[4] = rival;
        run.claims[4].incarnation = Incarnation(1);
        assert_eq!(run.verdict().outcome, Outcome::Complete);
        // Nor does one that contradicts the spots held.
        run.claims[4] = run.claims[3].clone();
        run.claims[4].decision.selections = select(&[(2, 5)]);
        assert_eq!(run.verdict().outcome, Outcome::Complete);
    }

    #[test]
    fn of_rosters() {
        let mut run = good_run();
        let mut other = run.roster();
        other.members.pop();
        run.further = vec![Message::Roster(RosterMessage::Plan(Arc::new(other)))];
        let verdict = run.verdict();
        assert_eq!(
            verdict.violations,
            [Violation::RostersDiffer { epoch: EPOCH }]
        );

        let mut run = good_run();
        run.members[0].module.pin = Some(SpotId(99));
        let verdict = run.verdict();
        assert!(matches!(
            verdict.violations[..],
            [Violation::RosterInvalid { .. }]
        ));

        let run = good_run();
        let mut announced = run.target.clone();
        let mut raw = star().to_raw();
        raw.spots[0].x = 3.0;
        announced.target = Some(Arc::new(Target::try_from(raw).unwrap()));
        // The announcement of the same revision that comes first stands.
        let mut messages = vec![Message::Target(Arc::new(announced))];
        messages.extend(run.messages());
        let mut observer = observe(&messages, ObserverParameters::default());
        observer.verdict(Duration::from_secs(1));
        let verdict = observer.verdict(Duration::from_secs(9)).unwrap();
        assert_eq!(
            verdict.violations,
            [Violation::TargetDiffers { epoch: EPOCH }]
        );
    }

    #[test]
    fn of_moving_without_a_plan() {
        let mut run = good_run();
        run.state(3, 2).digest = None;
        run.assert_violates(&Violation::MovedWithoutPlan {
            module: ModuleId(3),
        });
        let mut run = good_run();
        run.state(3, 2).epoch = None;
        run.assert_violates(&Violation::MovedWithoutPlan {
            module: ModuleId(3),
        });
        let mut run = good_run();
        run.state(3, 2).digest = Some(Digest(4));
        run.assert_violates(&Violation::PlansDiffer {
            epoch: EPOCH,
            first: ModuleId(1),
            first_digest: PLAN,
            second: ModuleId(3),
            second_digest: Digest(4),
        });
    }

    #[test]
    fn of_moving_before_agreement() {
        let mut run = good_run();
        run.state(5, 1).pose = pose(1, 5);
        run.assert_violates(&Violation::MovedEarly {
            epoch: EPOCH,
            module: ModuleId(5),
            distance: MicroUnits::ONE,
        });

        let mut run = good_run();
        run.heartbeats[3] = heartbeat(4, 14, 13);
        run.assert_violates(&Violation::MovedBeforeAgreement {
            epoch: EPOCH,
            module: ModuleId(1),
            member: ModuleId(4),
            sequence: 12,
            agreed_since: 13,
        });

        let mut run = good_run();
        for state in run.acts_of(1) {
            state.agreed_on.retain(|mark| mark.module != ModuleId(3));
        }
        for module in [1, 3, 4] {
            run.assert_violates(&Violation::AgreementNotShown {
                epoch: EPOCH,
                module: ModuleId(module),
                member: ModuleId(if module == 1 { 3 } else { 1 }),
            });
        }

        // Module 4 moves for itself, without waiting for anybody's agreement.
        let mut run = good_run();
        for state in run.acts_of(4) {
            state.waited_for.clear();
        }
        run.assert_violates(&Violation::AgreementNotShown {
            epoch: EPOCH,
            module: ModuleId(4),
            member: ModuleId(1),
        });
    }

    #[test]
    fn of_the_order() {
        // Module 3 had not settled at its state 2.
        let mut run = good_run();
        for state in run.acts_of(4) {
            state.waited_for = marks(&[(1, 4), (2, 3), (3, 2)]);
        }
        run.assert_violates(&Violation::WaitedForUnsettled {
            epoch: EPOCH,
            module: ModuleId(4),
            other: ModuleId(3),
            sequence: 2,
        });

        // Spot 4 is filled after spot 1 alone, which is not beside it: module 3 moves first, on the agreement of all.
        let mut run = good_run();
        let agreement = run.state(1, 2).agreed_on.clone();
        for state in run.acts_of(3) {
            state.waited_for.clear();
            state.agreed_on.clone_from(&agreement);
            state.agreed_on.extend(marks(&[(1, 10)]));
        }
        for state in run.acts_of(4) {
            state.waited_for = marks(&[(3, 3)]);
        }
        for state in run.acts_of(1) {
            state.waited_for = marks(&[(3, 3), (4, 3)]);
        }
        run.assert_violates(&Violation::NoPlacedNeighbour {
            module: ModuleId(4),
            spot: SpotId(4),
        });
        assert_eq!(run.verdict().violations.len(), 1);

        let mut run = good_run();
        for state in run.acts_of(3) {
            state.waited_for = marks(&[(1, 3), (4, 3)]);
        }
        run.assert_violates(&Violation::CircularWait {
            epoch: EPOCH,
            module: ModuleId(3),
        });
    }

    #[test]
    fn a_neighbour_that_others_waited_for_counts() {
        let mut run = good_run();
        for state in run.acts_of(4) {
            state.waited_for = marks(&[(3, 3)]);
        }
        assert_eq!(run.verdict().outcome, Outcome::Complete);
    }

    #[test]
    fn of_units() {
        let mut run = good_run();
        for state in run.acts_of(2) {
            state.unit = None;
            state.waited_for = marks(&[(1, 3)]);
        }
        run.assert_violates(&Violation::WrongUnit { lead: ModuleId(1) });
        run.assert_violates(&Violation::WrongUnit { lead: ModuleId(2) });
        let mut run = good_run();
        for state in run.acts_of(4) {
            state.unit = Some(ModuleId(3));
        }
        run.assert_violates(&Violation::WrongUnit { lead: ModuleId(3) });
    }

    #[test]
    fn of_the_end_state() {
        let mut run = good_run();
        run.state(3, 3).spot = Some(SpotId(4));
        run.assert_violates(&Violation::WrongSpot {
            module: ModuleId(3),
            held: Some(SpotId(4)),
            claimed: Some(SpotId(1)),
        });
        run.assert_violates(&Violation::TwoHolders {
            spot: SpotId(4),
            first: ModuleId(3),
            second: ModuleId(4),
        });
        run.assert_violates(&Violation::WrongCount {
            filled: 3,
            expected: 4,
        });

        let mut run = good_run();
        run.state(3, 3).pose.x = MicroUnits(10_040_000);
        run.state(3, 3).pose.theta = MicroUnits(6_283_185 - 40_000);
        assert_eq!(run.verdict().outcome, Outcome::Complete);
        run.state(3, 3).pose.x = MicroUnits(10_060_000);
        run.assert_violates(&Violation::PoseOff {
            module: ModuleId(3),
            spot: SpotId(1),
            distance: MicroUnits(60_000),
            turn: MicroUnits(40_000),
        });
        run.state(3, 3).pose.x = MicroUnits(10_000_000);
        run.state(3, 3).pose.theta = MicroUnits(-3_141_592);
        run.assert_violates(&Violation::PoseOff {
            module: ModuleId(3),
            spot: SpotId(1),
            distance: MicroUnits::ZERO,
            turn: MicroUnits(3_141_592),
        });

        let mut run = good_run();
        run.state(4, 3).links.clear();
        run.assert_violates(&Violation::LinkMissing {
            module: ModuleId(4),
            other: ModuleId(1),
        });
        let mut run = good_run();
        run.state(4, 3).links.insert(ModuleId(3));
        run.assert_violates(&Violation::LinkTooMany {
            module: ModuleId(4),
            other: ModuleId(3),
        });
        let mut run = good_run();
        run.state(5, 2).links.insert(ModuleId(3));
        run.assert_violates(&Violation::LinkTooMany {
            module: ModuleId(5),
            other: ModuleId(3),
        });
    }

    #[test]
    fn of_an_end_state_that_heals_in_time_are_forgotten() {
        let mut run = good_run();
        let healed = run.state(4, 3).clone();
        run.state(4, 3).links.clear();
        let mut observer = run.observe();
        assert_eq!(observer.verdict(Duration::from_secs(1)), None);
        assert_eq!(observer.poll_timeout(), Some(Duration::from_secs(4)));
        let healed = ModuleState {
            sequence: 4,
            ..healed
        };
        let message = Message::ModuleState(Arc::new(healed));
        observer.handle(Duration::from_secs(2), &message);
        let verdict = observer.verdict(Duration::from_secs(2)).unwrap();
        assert_eq!(verdict.outcome, Outcome::Complete);
    }
}

/// The first unit's own agreement needs no proof, and a formation of one needs no other's.
#[test]
fn a_lone_module_may_form_a_lone_spot() {
    let mut run = good_run();
    let raw = RawTarget {
        spots: vec![star().to_raw().spots[1]],
        edges: Vec::new(),
        frame_id: "map".to_owned(),
    };
    run.target.target = Some(Arc::new(Target::try_from(raw).unwrap()));
    run.target.expected_modules = Some(1);
    run.members.truncate(1);
    run.claims.truncate(1);
    run.claims[0].claimant = ModuleId(1);
    run.claims[0].decision.selections = select(&[(2, 1)]);
    run.heartbeats.truncate(1);
    run.heartbeats[0].applied_turns = 1;
    run.states.retain(|state| state.module == ModuleId(1));
    for state in run.acts_of(1) {
        state.agreed_on.clear();
        state.links.clear();
    }
    let verdict = run.verdict();
    assert_eq!(verdict.violations, []);
    assert_eq!(verdict.outcome, Outcome::Complete);
}
