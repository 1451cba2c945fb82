//! The received messages, in a form that does not depend on the order of their arrival.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use crate::model::{
    CausalMark, Digest, Epoch, Heartbeat, Incarnation, MODULES_MAX, MicroUnits, ModuleId,
    ModulePhase, ModuleState, PlanningProblem, Pose, Roster, RosterMember, SpotClaim, SpotId,
};
use crate::verify::Violation;

/// How many runs of one module are kept, the latest.
const RUNS_MAX: usize = 8;
/// How many different claims for one turn are kept.
const RIVAL_CLAIMS_MAX: usize = 4;
/// How many runs are kept in one epoch.
const RUNS_IN_EPOCH_MAX: usize = 2 * MODULES_MAX;
/// How many different digests of one member in one epoch are kept.
const RIVAL_DIGESTS_MAX: usize = 4;

/// One run of a module's process.
pub(super) type RunId = (ModuleId, Incarnation);

/// The messages of one run.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// Its state of the highest sequence number.
    pub(super) latest: Option<Arc<ModuleState>>,
    first_received: Duration,
    last_heartbeat: Option<(u64, Duration)>,
}

/// The runs of one module.
#[derive(Clone, Debug, Default)]
pub(super) struct ModuleRecord {
    runs: BTreeMap<Incarnation, Run>,
}

impl ModuleRecord {
    fn run(&mut self, incarnation: Incarnation, now: Duration) -> &mut Run {
        if self.runs.len() >= RUNS_MAX && !self.runs.contains_key(&incarnation) {
            self.runs.pop_first();
        }
        self.runs.entry(incarnation).or_insert(Run {
            latest: None,
            first_received: now,
            last_heartbeat: None,
        })
    }

    pub(super) fn note_state(&mut self, now: Duration, state: &Arc<ModuleState>) {
        let run = self.run(state.incarnation, now);
        if run
            .latest
            .as_ref()
            .is_none_or(|latest| latest.sequence < state.sequence)
        {
            run.latest = Some(Arc::clone(state));
        }
    }

    pub(super) fn note_heartbeat(&mut self, now: Duration, heartbeat: &Heartbeat) {
        let run = self.run(heartbeat.incarnation, now);
        if run
            .last_heartbeat
            .is_none_or(|(sequence, _)| sequence < heartbeat.sequence)
        {
            run.last_heartbeat = Some((heartbeat.sequence, now));
        }
    }

    /// When the latest heartbeat of a run arrived.
    pub(super) fn heartbeat_of(&self, incarnation: Incarnation) -> Option<Duration> {
        let (_, received) = self.runs.get(&incarnation)?.last_heartbeat?;
        Some(received)
    }

    /// The latest state of the member's run, unless a later run has taken the module over.
    ///
    /// A second process with the identifier of a living module is refused, so the member's run still stands while
    /// its heartbeats outlast the later run's first message.
    pub(super) fn state_of(&self, incarnation: Incarnation) -> Option<&Arc<ModuleState>> {
        let run = self.runs.get(&incarnation)?;
        let later = self.runs.range(incarnation..).nth(1);
        let stands = later.is_none_or(|(_, later)| {
            run.last_heartbeat
                .is_some_and(|(_, received)| received > later.first_received)
        });
        run.latest.as_ref().filter(|_| stands)
    }
}

/// What one run did in one epoch: all that its states say, whichever of them arrived.
#[derive(Clone, Debug, Default)]
pub(super) struct Act {
    /// Whether it was MOVING or SETTLED.
    pub(super) moved: bool,
    /// When a state first showed that.
    pub(super) moved_at: Option<Duration>,
    /// The digests on which it moved; one, if all is well.
    pub(super) digests: Vec<Option<Digest>>,
    /// The highest sequence number at which it was MOVING or SETTLED, and the unit and the spot that it named there.
    pub(super) named: Option<(u64, Option<ModuleId>, Option<SpotId>)>,
    /// The highest sequence number at which it is known not to have been settled yet.
    pub(super) unsettled_until: Option<u64>,
    /// The settled states that it waited for; the lowest sequence number for each module.
    pub(super) waited_for: BTreeMap<ModuleId, u64>,
    /// The heartbeats on which it moved; the lowest sequence number for each module.
    pub(super) agreed_on: BTreeMap<ModuleId, u64>,
    /// The poses that it reported before it was allowed to move.
    pub(super) frozen_at: Vec<Pose>,
}

/// How many poses are kept of a module that must stand still.
const FROZEN_POSES_MAX: usize = 8;

impl Act {
    fn note(&mut self, now: Duration, state: &ModuleState) {
        match state.phase {
            ModulePhase::Moving | ModulePhase::Settled => {
                self.moved = true;
                self.moved_at.get_or_insert(now);
                if !self.digests.contains(&state.digest) && self.digests.len() < RIVAL_DIGESTS_MAX {
                    self.digests.push(state.digest);
                }
                self.named = self
                    .named
                    .max(Some((state.sequence, state.unit, state.spot)));
                merge_lowest(&mut self.waited_for, &state.waited_for);
                merge_lowest(&mut self.agreed_on, &state.agreed_on);
            }
            ModulePhase::Planning | ModulePhase::Agreeing | ModulePhase::Waiting => {
                if !self.frozen_at.contains(&state.pose) && self.frozen_at.len() < FROZEN_POSES_MAX
                {
                    self.frozen_at.push(state.pose);
                }
            }
            ModulePhase::Listening
            | ModulePhase::Gathered
            | ModulePhase::Spare
            | ModulePhase::WaitingForQuorum => {}
        }
        // These come before SETTLED in an epoch, never after it.
        let is_before_settling = match state.phase {
            ModulePhase::Gathered
            | ModulePhase::Planning
            | ModulePhase::Agreeing
            | ModulePhase::Waiting
            | ModulePhase::Moving
            | ModulePhase::Spare => true,
            ModulePhase::Settled | ModulePhase::Listening | ModulePhase::WaitingForQuorum => false,
        };
        if is_before_settling {
            self.unsettled_until = self.unsettled_until.max(Some(state.sequence));
        }
        // A reader may have missed the states just before; the module reports when it settled.
        let before = state.settled_since.checked_sub(1);
        self.unsettled_until = self.unsettled_until.max(before);
    }

    /// The greatest distance of these poses from the one that the roster froze.
    pub(super) fn farthest_from(&self, frozen: &Pose) -> MicroUnits {
        self.frozen_at
            .iter()
            .map(|pose| pose.distance_to(frozen))
            .max()
            .unwrap_or_default()
    }
}

fn merge_lowest(marks: &mut BTreeMap<ModuleId, u64>, new: &[CausalMark]) {
    for mark in new {
        let lowest = marks.entry(mark.module).or_insert(mark.sequence);
        *lowest = mark.sequence.min(*lowest);
    }
}

/// A claim and when it arrived.
#[derive(Clone, Debug)]
pub(super) struct ReceivedClaim {
    pub(super) claim: Arc<SpotClaim>,
    pub(super) received: Duration,
}

/// A roster, when it arrived, and the planning input that it carries.
#[derive(Clone, Debug)]
pub(super) struct ReceivedRoster {
    pub(super) roster: Arc<Roster>,
    pub(super) problem: Option<PlanningProblem>,
    pub(super) received: Duration,
}

/// An epoch whose roster arrived and can be planned for.
#[derive(Clone, Copy)]
pub(super) struct PlannedEpoch<'a> {
    pub(super) epoch: Epoch,
    pub(super) record: &'a EpochRecord,
    pub(super) roster: &'a Roster,
    pub(super) problem: &'a PlanningProblem,
    /// When the roster arrived.
    pub(super) received: Duration,
}

impl<'a> PlannedEpoch<'a> {
    pub(super) fn members(self) -> &'a [RosterMember] {
        &self.roster.members
    }

    /// What a member did, in the run that the roster names.
    pub(super) fn act_of(self, member: &RosterMember) -> Option<&'a Act> {
        let run = (member.module.id, member.incarnation);
        self.record.acts.get(&run)
    }
}

/// A whole plan, as one run's heartbeats showed it.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShownPlan {
    /// The sequence number of the first heartbeat that showed it.
    pub(super) since: u64,
    /// How many turns led to it.
    pub(super) turns: u32,
}

/// The messages of one epoch.
#[derive(Clone, Debug, Default)]
pub(super) struct EpochRecord {
    pub(super) roster: Option<ReceivedRoster>,
    /// The claims of each turn: one, if all is well.
    pub(super) claims: BTreeMap<u32, Vec<ReceivedClaim>>,
    pub(super) acts: BTreeMap<RunId, Act>,
    /// The plans that each run showed: one, if all is well.
    pub(super) shown: BTreeMap<RunId, BTreeMap<Digest, ShownPlan>>,
    /// What was wrong with messages as they came.
    pub(super) violations: Vec<Violation>,
}

impl EpochRecord {
    /// The epoch, if its roster arrived and can be planned for.
    pub(super) fn planned(&self, epoch: Epoch) -> Option<PlannedEpoch<'_>> {
        let known = self.roster.as_ref()?;
        Some(PlannedEpoch {
            epoch,
            record: self,
            roster: &known.roster,
            problem: known.problem.as_ref()?,
            received: known.received,
        })
    }

    pub(super) fn note_roster(&mut self, now: Duration, roster: &Arc<Roster>) {
        let epoch = roster.epoch;
        match &self.roster {
            Some(known) if known.roster == *roster => {}
            Some(_) => {
                let violation = Violation::RostersDiffer { epoch };
                if !self.violations.contains(&violation) {
                    self.violations.push(violation);
                }
            }
            None => {
                let problem = roster.problem().unwrap_or_else(|error| {
                    self.violations.push(Violation::RosterInvalid {
                        epoch,
                        reason: error.to_string(),
                    });
                    None
                });
                self.roster = Some(ReceivedRoster {
                    roster: Arc::clone(roster),
                    problem,
                    received: now,
                });
            }
        }
    }

    /// Keeps a claim; false when there are too many different ones for its turn.
    pub(super) fn note_claim(&mut self, now: Duration, claim: &Arc<SpotClaim>) -> bool {
        let rivals = self.claims.entry(claim.turn).or_default();
        if rivals.iter().any(|known| known.claim == *claim) {
            return true;
        }
        let has_room = rivals.len() < RIVAL_CLAIMS_MAX;
        if has_room {
            rivals.push(ReceivedClaim {
                claim: Arc::clone(claim),
                received: now,
            });
        }
        has_room
    }

    /// Keeps what a state says; false when there are too many runs.
    pub(super) fn note_state(&mut self, now: Duration, state: &ModuleState) -> bool {
        let run = (state.module, state.incarnation);
        let has_room = self.acts.len() < RUNS_IN_EPOCH_MAX || self.acts.contains_key(&run);
        if has_room {
            self.acts.entry(run).or_default().note(now, state);
        }
        has_room
    }

    /// Keeps what a heartbeat says; false when there are too many runs.
    pub(super) fn note_heartbeat(&mut self, heartbeat: &Heartbeat) -> bool {
        let Some(digest) = heartbeat.digest else {
            return true;
        };
        let run = (heartbeat.module, heartbeat.incarnation);
        if self.shown.len() >= RUNS_IN_EPOCH_MAX && !self.shown.contains_key(&run) {
            return false;
        }
        let shown = self.shown.entry(run).or_default();
        if shown.len() < RIVAL_DIGESTS_MAX || shown.contains_key(&digest) {
            let plan = shown.entry(digest).or_insert(ShownPlan {
                since: heartbeat.digest_since,
                turns: heartbeat.applied_turns,
            });
            plan.since = plan.since.min(heartbeat.digest_since);
            plan.turns = plan.turns.max(heartbeat.applied_turns);
        }
        true
    }
}

/// All received messages, by epoch.
#[derive(Clone, Debug, Default)]
pub(super) struct Epochs {
    records: BTreeMap<Epoch, EpochRecord>,
}

/// How many epochs are kept.
const EPOCHS_MAX: usize = 64;

impl Epochs {
    /// Where there are too many to add this epoch, takes out the lowest without a roster, or else the lowest.
    pub(super) fn make_room_for(&mut self, epoch: Epoch) -> Option<(Epoch, EpochRecord)> {
        if self.records.len() < EPOCHS_MAX || self.records.contains_key(&epoch) {
            return None;
        }
        let idle = self
            .records
            .iter()
            .find(|(_, record)| record.roster.is_none())
            .map(|(&epoch, _)| epoch);
        match idle {
            Some(idle) => self.records.remove(&idle).map(|record| (idle, record)),
            None => self.records.pop_first(),
        }
    }

    /// The record of an epoch, a new one if need be.
    pub(super) fn record(&mut self, epoch: Epoch) -> &mut EpochRecord {
        self.records.entry(epoch).or_default()
    }

    /// The epochs whose rosters arrived, ascending.
    pub(super) fn with_roster(&self) -> impl DoubleEndedIterator<Item = (Epoch, &EpochRecord)> {
        self.records
            .iter()
            .filter(|(_, record)| record.roster.is_some())
            .map(|(&epoch, record)| (epoch, record))
    }
}
