//! Hand-made message sequences: the good case in any order, what is missing at the time limit, and each violation.

mod bodies;
mod good_sequences;
mod review;
mod time_limit;
mod violations;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use super::*;
use crate::{Missing, Violation};
use formation_generate::Random;
use formation_model::{
    BodyReport, CausalMark, Decision, Digest, DriveState, Epoch, EvictionRecord, FormationStage,
    Heartbeat, Incarnation, Message, MicroUnits, ModuleId, ModulePhase, ModuleRun, ModuleState,
    PlannerParameters, PlanningModule, Polyline, Pose, RawGiven, RawGivenSpot, RawSpot, RawTarget,
    Roster, RosterMember, RosterMessage, SenderTime, Service, SpotClaim, SpotId, SpotSelection,
    Stop, Target, TargetAnnouncement, Voters, Whereabouts,
};

const EPOCH: Epoch = Epoch {
    number: 1,
    convener: ModuleId(1),
};
const INCARNATION: Incarnation = Incarnation(77);
const PLAN: Digest = Digest(0xfeed);

/// A formation of four modules on a star: spot 2 in the middle, 1, 3 and 4 around it.
///
/// Module 3 takes spot 4 first; module 4 evicts it to spot 1; the block of modules 1 and 2 takes spots 2 and 3 and moves
/// first, on the agreement of all; then modules 3 and 4 move, one after the other. Module 5 is left over.
struct Sequence {
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
    let run = ModuleRun {
        module: ModuleId(module),
        incarnation: INCARNATION,
    };
    ModuleState {
        sequence,
        epoch: Some(EPOCH),
        digest: Some(PLAN),
        phase,
        ..ModuleState::standing(run, pose(0, i64::from(module)))
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

fn good_sequence() -> Sequence {
    let target = TargetAnnouncement {
        voters: Vec::new(),
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
            knows: true,
            is_idle: true,
            incarnation: INCARNATION,
            service: Service::Active,
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
    Sequence {
        target,
        members,
        claims: good_claims(),
        states: good_states(),
        heartbeats: (1..=5).map(|id| heartbeat(id, 12, 10)).collect(),
        further: Vec::new(),
    }
}

fn good_claims() -> Vec<SpotClaim> {
    let claim = |turn, claimant, decision| SpotClaim {
        epoch: EPOCH,
        turn,
        claimant: ModuleId(claimant),
        incarnation: INCARNATION,
        decision,
    };
    vec![
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
    ]
}

fn heartbeat(module: u32, sequence: u64, digest_since: u64) -> Heartbeat {
    Heartbeat {
        sequence,
        uptime: Duration::from_secs(1),
        epoch: Some(EPOCH),
        digest: Some(PLAN),
        digest_since,
        applied_turns: 4,
        phase: ModulePhase::Agreeing,
        ..Heartbeat::first(ModuleId(module).run(INCARNATION))
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
            state.steps_done = Some(u32::from(phase == ModulePhase::Settled));
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

impl Sequence {
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
            timing: formation_model::Timing {
                heartbeat: Duration::from_millis(500),
                suspicion: Duration::from_secs(5),
                lease: Duration::from_millis(2_500),
            },
            epoch: EPOCH,
            target: self.target.clone(),
            members: self.members.clone(),
            voters: Voters::default(),
            bodies: Vec::new(),
        }
    }

    fn messages(&self) -> Vec<Message> {
        let mut messages = vec![
            Message::Target(Arc::new(self.target.clone())),
            Message::Roster(RosterMessage::Gather {
                epoch: EPOCH,
                target_revision: 1,
                target: Digest(0),
            }),
            Message::Roster(RosterMessage::Plan(Arc::new(self.roster().into()))),
        ];
        let claims = self.claims.iter().cloned().map(Arc::new);
        messages.extend(claims.map(Message::Claim));
        messages.extend(self.heartbeats.iter().cloned().map(Message::Heartbeat));
        let states = self.states.iter().cloned().map(Arc::new);
        messages.extend(states.map(Message::ModuleState));
        messages.extend(self.further.iter().cloned());
        messages
    }

    fn observe(&self) -> Observer {
        observe(&self.messages(), patient())
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
        let mut observer = observe(&messages, patient());
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

/// Does not count members as silent: the hand-made messages all come in the first instant.
fn patient() -> ObserverParameters {
    ObserverParameters {
        silence: Duration::MAX,
        ..ObserverParameters::default()
    }
}

fn observe(messages: &[Message], parameters: ObserverParameters) -> Observer {
    let mut observer = Observer::new(parameters);
    for (number, message) in (1..).zip(messages) {
        observer.handle(Duration::from_millis(number), message);
    }
    observer
}
