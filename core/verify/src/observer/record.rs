//! Records of modules, their runs and epochs, in a form that does not depend on the order of messages.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use crate::Violation;
use formation_model::{
    BodyReport, CausalMark, ClosedRoster, Digest, Epoch, Heartbeat, Incarnation, MODULES_MAX,
    MicroUnits, ModuleId, ModulePhase, ModuleRun, ModuleState, PlanningProblem, Pose, RosterMember,
    SpotClaim, SpotId, Stop, TURNS_MAX, Whereabouts,
};

/// The greatest number of runs of one module that are kept, the latest ones.
const RUNS_MAX: usize = 8;
/// The greatest number of different claims for one turn that are kept.
const RIVAL_CLAIMS_MAX: usize = 4;
/// The greatest number of spots, evictions and modules in all claims that are kept of one epoch.
const CLAIM_ENTRIES_MAX: usize = 1 << 18;
/// The greatest number of runs that are kept in one epoch.
const RUNS_IN_EPOCH_MAX: usize = 2 * MODULES_MAX;
/// The greatest number of different digests of one member in one epoch that are kept.
const RIVAL_DIGESTS_MAX: usize = 4;
/// The greatest number of poses that are kept of a module that must not move.
const FROZEN_POSES_MAX: usize = 8;

/// The messages of one run of a module's process.
#[derive(Clone, Debug)]
pub(super) struct RunRecord {
    /// The state of the highest sequence number.
    latest: Option<Arc<ModuleState>>,
    first_received: Duration,
    /// The highest sequence number of a heartbeat, and when it was received.
    pub(super) last_heartbeat: Option<(u64, Duration)>,
    /// The command to stop or to resume that this heartbeat showed.
    pub(super) stop: Stop,
    /// The epoch that this heartbeat showed.
    epoch: Option<Epoch>,
    /// Whether a state MOVING or SETTLED named no epoch.
    pub(super) moved_outside_epochs: bool,
}

impl RunRecord {
    /// Whether its latest heartbeat was received after this time, and shows this epoch.
    pub(super) fn shows_since(&self, epoch: Epoch, time: Duration) -> bool {
        let last = self.last_heartbeat.map(|(_, received)| received);
        self.epoch == Some(epoch) && last > Some(time)
    }
}

/// The runs of one module.
#[derive(Clone, Debug, Default)]
pub(super) struct ModuleRecord {
    runs: BTreeMap<Incarnation, RunRecord>,
}

impl ModuleRecord {
    fn run(&mut self, incarnation: Incarnation, now: Duration) -> &mut RunRecord {
        if self.runs.len() >= RUNS_MAX && !self.runs.contains_key(&incarnation) {
            self.runs.pop_first();
        }
        self.runs.entry(incarnation).or_insert(RunRecord {
            latest: None,
            first_received: now,
            last_heartbeat: None,
            stop: Stop::default(),
            epoch: None,
            moved_outside_epochs: false,
        })
    }

    pub(super) fn handle_state(&mut self, now: Duration, state: &Arc<ModuleState>) {
        let run = self.run(state.incarnation, now);
        let moves = matches!(state.phase, ModulePhase::Moving | ModulePhase::Settled);
        run.moved_outside_epochs |= moves && state.epoch.is_none();
        let known = run.latest.as_ref();
        if known.is_none_or(|known| known.sequence < state.sequence) {
            run.latest = Some(Arc::clone(state));
        }
    }

    pub(super) fn handle_heartbeat(&mut self, now: Duration, heartbeat: &Heartbeat) {
        let run = self.run(heartbeat.incarnation, now);
        let last = run.last_heartbeat;
        if last.is_none_or(|(sequence, _)| sequence < heartbeat.sequence) {
            run.last_heartbeat = Some((heartbeat.sequence, now));
            run.stop = heartbeat.stop;
            run.epoch = heartbeat.epoch;
        }
    }

    pub(super) fn run_of(&self, incarnation: Incarnation) -> Option<&RunRecord> {
        self.runs.get(&incarnation)
    }

    /// Whether a run is a thing of the past in an epoch: a later run takes part in an earlier epoch. A recording that is played
    /// next to a formation shows that, and modules that have all forgotten their epochs.
    fn is_past(&self, incarnation: Incarnation, epoch: Epoch) -> bool {
        let mut runs = self.runs.iter();
        runs.any(|(&other, run)| {
            run.epoch.is_some_and(|shown| shown < epoch)
                && self.compare_runs(other, incarnation).is_gt()
                && !self.outlasts(incarnation, run)
        })
    }

    /// Whether a run was there before another began, and has gone on since. Agents refuse the other one, whatever its number.
    fn outlasts(&self, incarnation: Incarnation, other: &RunRecord) -> bool {
        self.runs.get(&incarnation).is_some_and(|run| {
            let last = run.last_heartbeat.map(|(_, received)| received);
            run.first_received < other.first_received && last > Some(other.first_received)
        })
    }

    /// Which of two runs is the later one: that of the higher number, unless its last heartbeat came before the first message of the
    /// other one, as where a clock was set back in between.
    pub(super) fn compare_runs(&self, one: Incarnation, other: Incarnation) -> Ordering {
        let by_number = one.cmp(&other);
        let (higher, lower) = (one.max(other), one.min(other));
        let (Some(higher), Some(lower)) = (self.runs.get(&higher), self.runs.get(&lower)) else {
            return by_number;
        };
        let last = higher.last_heartbeat.map(|(_, received)| received);
        match last.is_some_and(|last| last < lower.first_received) {
            true => by_number.reverse(),
            false => by_number,
        }
    }

    /// The latest state of the newest run that published one, and when its latest heartbeat was received.
    pub(super) fn body(&self) -> Option<(&ModuleState, Option<Duration>)> {
        let shown = self.runs.values().filter_map(|run| {
            let last = run.last_heartbeat.map(|(_, received)| received);
            Some((&**run.latest.as_ref()?, last))
        });
        shown.max_by(|(one, _), (other, _)| self.compare_runs(one.incarnation, other.incarnation))
    }

    /// The latest state of a member's run, unless a later run has replaced it.
    ///
    /// Agents refuse a second process with the identifier of a living module. So the member's run still counts while its
    /// heartbeats continue after the later run's first message.
    pub(super) fn state_of(&self, incarnation: Incarnation) -> Option<&Arc<ModuleState>> {
        let run = self.runs.get(&incarnation)?;
        let later = self.runs.range(incarnation..).nth(1);
        let counts = later.is_none_or(|(_, later)| {
            run.last_heartbeat
                .is_some_and(|(_, received)| received > later.first_received)
        });
        run.latest.as_ref().filter(|_| counts)
    }
}

/// The acts of one run in one epoch, as far as its received states show them.
#[derive(Clone, Debug, Default)]
pub(super) struct Act {
    /// When a state MOVING or SETTLED was first received.
    pub(super) moved_received: Option<Duration>,
    /// The digests of its states MOVING and SETTLED; correct agents have one.
    pub(super) digests: Vec<Option<Digest>>,
    /// The highest sequence number of a state MOVING or SETTLED, with its unit and spot.
    pub(super) named: Option<(u64, Option<ModuleId>, Option<SpotId>)>,
    /// Whether it has published that it settled.
    pub(super) settled: bool,
    /// The highest sequence number of a state before SETTLED.
    pub(super) unsettled_until: Option<u64>,
    /// The settled states for which it waited: the lowest sequence number of each module.
    pub(super) waited_for: BTreeMap<ModuleId, u64>,
    /// The heartbeats that showed it agreement: the lowest sequence number of each module.
    pub(super) agreed_on: BTreeMap<ModuleId, u64>,
    /// The poses of its states before it was allowed to move.
    frozen_at: Vec<Pose>,
}

impl Act {
    /// Keeps the content of a state. Returns false if its proofs are of too many modules.
    fn handle(&mut self, now: Duration, state: &ModuleState) -> bool {
        let mut fits = true;
        self.settled |= state.phase == ModulePhase::Settled;
        match state.phase {
            ModulePhase::Moving | ModulePhase::Settled => {
                self.moved_received.get_or_insert(now);
                // Who counts no steps follows no plan.
                let digest = state.digest.filter(|_| state.steps_done.is_some());
                if !self.digests.contains(&digest) && self.digests.len() < RIVAL_DIGESTS_MAX {
                    self.digests.push(digest);
                }
                let named = Some((state.sequence, state.unit, state.spot));
                self.named = self.named.max(named);
                fits &= merge_lowest(&mut self.waited_for, &state.waited_for);
                fits &= merge_lowest(&mut self.agreed_on, &state.agreed_on);
            }
            ModulePhase::Planning | ModulePhase::Agreeing | ModulePhase::Waiting
                if !state.drive.is_off_way()
                    && !self.frozen_at.contains(&state.pose)
                    && self.frozen_at.len() < FROZEN_POSES_MAX =>
            {
                self.frozen_at.push(state.pose);
            }
            _ => {}
        }
        // The other phases come before SETTLED in an epoch, never after it.
        let can_follow_settled = matches!(
            state.phase,
            ModulePhase::Settled | ModulePhase::Listening | ModulePhase::WaitingForQuorum
        );
        if !can_follow_settled {
            self.unsettled_until = self.unsettled_until.max(Some(state.sequence));
        }
        // The states just before SETTLED can be missed, so the module publishes when it settled.
        let before = state.settled_since.checked_sub(1);
        self.unsettled_until = self.unsettled_until.max(before);
        fits
    }

    /// The greatest distance from the pose in the roster before it was allowed to move.
    pub(super) fn farthest_from(&self, frozen: &Pose) -> MicroUnits {
        let distances = self.frozen_at.iter().map(|pose| pose.distance_to(frozen));
        distances.max().unwrap_or_default()
    }
}

/// The entry of a key, added if need be; `None` if the map has `max` other entries.
pub(super) fn entry_within<K: Ord, V: Default>(
    map: &mut BTreeMap<K, V>,
    key: K,
    max: usize,
) -> Option<&mut V> {
    (map.len() < max || map.contains_key(&key)).then(|| map.entry(key).or_default())
}

/// Keeps the lowest mark of each module. Returns false if they are of too many modules.
fn merge_lowest(marks: &mut BTreeMap<ModuleId, u64>, new: &[CausalMark]) -> bool {
    let mut fit = true;
    for mark in new {
        if marks.len() >= MODULES_MAX && !marks.contains_key(&mark.module) {
            fit = false;
            continue;
        }
        let lowest = marks.entry(mark.module).or_insert(mark.sequence);
        *lowest = mark.sequence.min(*lowest);
    }
    fit
}

/// A claim and when it was received.
#[derive(Clone, Debug)]
pub(super) struct ReceivedClaim {
    pub(super) claim: Arc<SpotClaim>,
    pub(super) received: Duration,
}

/// A roster, its planning input, and when it was received.
#[derive(Clone, Debug)]
pub(super) struct ReceivedRoster {
    pub(super) roster: Arc<ClosedRoster>,
    problem: Option<Arc<PlanningProblem>>,
    pub(super) received: Duration,
}

/// A plan that the heartbeats of one run show.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShownPlan {
    /// The sequence number of the first heartbeat that showed it.
    pub(super) since: u64,
    /// The number of its turns.
    pub(super) turns: u32,
}

fn run_of_convener(roster: &ClosedRoster) -> Option<Incarnation> {
    let convener = RosterMember::find(&roster.members, roster.epoch.convener)?;
    Some(convener.incarnation)
}

/// The messages of one epoch.
#[derive(Clone, Debug, Default)]
pub(super) struct EpochRecord {
    pub(super) roster: Option<ReceivedRoster>,
    /// The different claims of each turn; correct agents make one.
    pub(super) claims: BTreeMap<u32, Vec<ReceivedClaim>>,
    /// The number of spots, evictions and modules in these claims.
    claim_entries: usize,
    acts: BTreeMap<ModuleRun, Act>,
    /// The plans that each run has shown; correct agents show one.
    shown: BTreeMap<ModuleRun, BTreeMap<Digest, ShownPlan>>,
    /// The violations that rosters show by themselves.
    pub(super) violations: Vec<Violation>,
}

/// An epoch with a roster that can be planned for.
#[derive(Clone, Copy)]
pub(super) struct PlannedEpoch<'a> {
    pub(super) epoch: Epoch,
    pub(super) record: &'a EpochRecord,
    pub(super) roster: &'a ReceivedRoster,
    pub(super) problem: &'a PlanningProblem,
}

impl<'a> PlannedEpoch<'a> {
    /// Whether the convener's run is a thing of the past.
    pub(super) fn is_past(self, modules: &BTreeMap<ModuleId, ModuleRecord>) -> bool {
        let run = run_of_convener(&self.roster.roster);
        let convener = modules.get(&self.epoch.convener).zip(run);
        convener.is_some_and(|(convener, run)| convener.is_past(run, self.epoch))
    }

    pub(super) fn members(&self) -> &'a [RosterMember] {
        &self.roster.roster.members
    }

    /// Whether the plan is made around the body of a module where it was by its states: it is a member, or an absent module whose
    /// body the roster lists there. Where the roster lists it elsewhere, states of it did not arrive.
    pub(super) fn knows_body(&self, module: ModuleId, was_at: &dyn Fn(Pose) -> bool) -> bool {
        let roster = &self.roster.roster;
        let mut bodies = roster.bodies.iter();
        let width = self.problem.target().surroundings().body_width();
        // A single module on its way is not where another one is measured.
        let may_be_at = |body: &BodyReport, pose: Pose| {
            let mut members = roster.members.iter();
            !matches!(body.whereabouts, Whereabouts::OnTheWay(_))
                || members.all(|member| member.module.pose.distance_to(&pose) >= width)
        };
        RosterMember::find(&roster.members, module).is_some()
            || bodies.any(|body| {
                let mut poses = body.whereabouts.poses().iter();
                body.module == module && poses.any(|&pose| was_at(pose) && may_be_at(body, pose))
            })
    }

    /// The acts of a member, in the run that the roster names.
    pub(super) fn act_of(&self, member: &RosterMember) -> Option<&'a Act> {
        self.record.acts.get(&member.run())
    }

    /// The plans that a member has shown, in the run that the roster names.
    pub(super) fn shown_by(
        &self,
        member: &RosterMember,
    ) -> Option<&'a BTreeMap<Digest, ShownPlan>> {
        self.record.shown.get(&member.run())
    }
}

impl EpochRecord {
    /// The epoch with its roster; `None` without a roster that can be planned for.
    pub(super) fn planned(&self, epoch: Epoch) -> Option<PlannedEpoch<'_>> {
        let roster = self.roster.as_ref()?;
        Some(PlannedEpoch {
            epoch,
            record: self,
            roster,
            problem: roster.problem.as_deref()?,
        })
    }

    /// Keeps a roster. `convener` is the record of the convener, if there is one.
    pub(super) fn handle_roster(
        &mut self,
        now: Duration,
        roster: &Arc<ClosedRoster>,
        convener: Option<&ModuleRecord>,
    ) {
        let epoch = roster.epoch;
        let order = self.roster.as_ref().map(|known| {
            let runs = [&known.roster, roster].map(|roster| run_of_convener(roster));
            match (convener, runs) {
                (Some(convener), [Some(known), Some(new)]) => convener.compare_runs(known, new),
                (_, [known, new]) => known.cmp(&new),
            }
        });
        match &self.roster {
            Some(known) if known.roster == *roster => {}
            // A later run of the convener opens an epoch again that all have forgotten.
            Some(_) if order == Some(Ordering::Greater) => {}
            Some(_) if order == Some(Ordering::Equal) => {
                let violation = Violation::RostersDiffer { epoch };
                if !self.violations.contains(&violation) {
                    self.violations.push(violation);
                }
            }
            _ => {
                self.violations.clear();
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

    /// Keeps a claim. Returns false if there are too many different ones for its turn, or too many at all.
    pub(super) fn handle_claim(&mut self, now: Duration, claim: &Arc<SpotClaim>) -> bool {
        let rivals = self.claims.get(&claim.turn).map_or(&[][..], Vec::as_slice);
        if rivals.iter().any(|known| known.claim == *claim) {
            return true;
        }
        let entries = self.claim_entries + claim.decision.entry_count();
        let has_room = claim.turn < TURNS_MAX
            && rivals.len() < RIVAL_CLAIMS_MAX
            && entries <= CLAIM_ENTRIES_MAX;
        if has_room {
            self.claim_entries = entries;
            let rivals = self.claims.entry(claim.turn).or_default();
            rivals.push(ReceivedClaim {
                claim: Arc::clone(claim),
                received: now,
            });
        }
        has_room
    }

    /// Keeps the content of a state. Returns false if there are too many runs, or too many proofs of one.
    pub(super) fn handle_state(&mut self, now: Duration, state: &ModuleState) -> bool {
        let run = state.module.run(state.incarnation);
        let act = entry_within(&mut self.acts, run, RUNS_IN_EPOCH_MAX);
        act.is_some_and(|act| act.handle(now, state))
    }

    /// Keeps the content of a heartbeat. Returns false if there are too many runs.
    pub(super) fn handle_heartbeat(&mut self, heartbeat: &Heartbeat) -> bool {
        let Some(digest) = heartbeat.digest else {
            return true;
        };
        let run = heartbeat.module.run(heartbeat.incarnation);
        let Some(shown) = entry_within(&mut self.shown, run, RUNS_IN_EPOCH_MAX) else {
            return false;
        };
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

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::Decision;

    #[test]
    fn claims_of_one_epoch_take_no_more_room_than_there_is() {
        let mut record = EpochRecord::default();
        let mut keeps = |turn, entries| {
            let claim = SpotClaim {
                epoch: Epoch {
                    number: 1,
                    convener: ModuleId(1),
                },
                turn,
                claimant: ModuleId(1),
                incarnation: Incarnation(1),
                decision: Decision {
                    detached: vec![ModuleId(1); entries],
                    ..Decision::default()
                },
            };
            record.handle_claim(Duration::ZERO, &Arc::new(claim))
        };
        assert!(!keeps(TURNS_MAX, 1) && !keeps(u32::MAX, 1), "no such turn");
        let large = CLAIM_ENTRIES_MAX / 4;
        assert!((0..4).all(|turn| keeps(turn, large)));
        assert!(!keeps(4, 1), "it is full");
        assert!(keeps(3, large), "this one is known");
        assert_eq!(record.claims.len(), 4);
    }

    #[test]
    fn marks_are_kept_of_as_many_modules_as_there_can_be() {
        let mark = |module| CausalMark {
            module: ModuleId(module),
            sequence: 7,
        };
        let count = u32::try_from(MODULES_MAX).unwrap();
        let first: Vec<CausalMark> = (0..count).map(mark).collect();
        let mut marks = BTreeMap::new();
        assert!(merge_lowest(&mut marks, &first));
        assert!(!merge_lowest(&mut marks, &[mark(count), mark(0)]));
        assert_eq!(marks.len(), MODULES_MAX);
    }
}
