//! Judges a formation from what is on the topics, and from nothing else.
//!
//! The observer is a state machine without I/O. Messages may come in any order and more than once. What a module did is
//! judged by what it says it waited for, since the order in which messages of different writers arrive proves nothing.
//! That goes both ways: a guarantee counts as violated only if a message shows it, or if all messages arrived and none
//! shows that it was kept.

mod claims;
mod end_state;
mod order;
mod record;
mod verdict;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use super::{Missing, Violation};
use crate::model::{
    Epoch, FormationStage, MODULES_MAX, Message, MicroUnits, ModuleId, ModulePhase, RosterMessage,
    SpotId, TargetAnnouncement,
};
use claims::{Claimed, replay_claims};
use end_state::EndState;
use order::Acts;
use record::{EpochRecord, Epochs, ModuleRecord, PlannedEpoch};
pub use verdict::{Agreement, Counts, Outcome, Progress, Timings, Verdict};

/// How an observer judges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObserverParameters {
    /// How far a settled module may stand from its spot, in micro-units.
    pub position_tolerance: MicroUnits,
    /// By how much its heading may differ, in micro-radians.
    pub heading_tolerance: MicroUnits,
    /// A formation that is not done this long after a target was announced that asks for something new, or after the
    /// observer's start while there is no target, has failed.
    pub time_limit: Duration,
    /// How long an end state that is reached, but not yet right, may take to become right: messages that prove it may
    /// still be in transit. An end state with fewer modules than expected waits for more of them for the same time.
    pub grace: Duration,
    /// A member that is silent for longer than this does not count as living, and no formation that relies on it is done.
    pub silence: Duration,
    /// The modules that are to take part, where they are known beforehand, so that absent ones can be named.
    pub expected: BTreeSet<ModuleId>,
}

impl Default for ObserverParameters {
    fn default() -> Self {
        Self {
            position_tolerance: MicroUnits(50_000),
            heading_tolerance: MicroUnits(50_000),
            time_limit: Duration::from_secs(120),
            grace: Duration::from_secs(3),
            silence: Duration::from_secs(5),
            expected: BTreeSet::new(),
        }
    }
}

/// Takes the messages of all topics and judges the formation.
///
/// Call [`Self::handle`] for each message, then, as often as you like and when [`Self::poll_timeout`] is due,
/// [`Self::verdict`]. A verdict, once given, stands, unless it is asked to [`Self::review`] it.
#[derive(Clone, Debug)]
pub struct Observer {
    parameters: ObserverParameters,
    target: Option<Arc<TargetAnnouncement>>,
    /// The highest revision that withdrew a target.
    withdrawn: Option<u64>,
    modules: BTreeMap<ModuleId, ModuleRecord>,
    epochs: Epochs,
    /// Violations outside any epoch, and in epochs that had to make room.
    retired: Vec<Violation>,
    /// How many messages arrived, and how many were dropped.
    counts: Counts,
    /// Since when the end state is reached without a break.
    reached_since: Option<Duration>,
    /// Since when an end state that was reached and judged is no longer there.
    broken_since: Option<Duration>,
    /// From when the time limit counts.
    limit_from: Duration,
    /// Whether a target that asks for something else was announced since the verdict.
    has_new_target: bool,
    verdict: Option<Verdict>,
}

/// How long an end state must be gone before a verdict on it is retracted: a second process with a living module's
/// identifier may hide that module until its next heartbeat arrives.
const RETRACTION_DELAY: Duration = Duration::from_secs(1);

/// How many violations are listed; more say nothing new.
const VIOLATIONS_MAX: usize = 256;

impl Observer {
    /// An observer that starts at time zero.
    #[must_use]
    pub fn new(parameters: ObserverParameters) -> Self {
        Self {
            parameters,
            target: None,
            withdrawn: None,
            modules: BTreeMap::new(),
            epochs: Epochs::default(),
            retired: Vec::new(),
            counts: Counts::default(),
            reached_since: None,
            broken_since: None,
            limit_from: Duration::ZERO,
            has_new_target: false,
            verdict: None,
        }
    }

    /// Takes in one message that arrived at `now`, measured from the observer's start.
    pub fn handle(&mut self, now: Duration, message: &Message) {
        self.counts.messages += 1;
        match message {
            Message::Target(announcement) => {
                let is_newer = self
                    .target
                    .as_ref()
                    .is_none_or(|known| known.revision < announcement.revision);
                if is_newer {
                    let asks_the_same = self
                        .target
                        .as_ref()
                        .is_some_and(|known| ask_the_same(known, announcement));
                    if !asks_the_same {
                        self.has_new_target = self.verdict.is_some();
                        // The time limit counts from the request.
                        self.limit_from = now;
                    }
                    self.target = Some(Arc::clone(announcement));
                }
                if announcement.target.is_none() {
                    self.withdrawn = self.withdrawn.max(Some(announcement.revision));
                }
            }
            Message::ModuleState(state) => {
                let Some(module) = self.module(state.module) else {
                    return;
                };
                module.note_state(now, state);
                if state.epoch.is_none()
                    && matches!(state.phase, ModulePhase::Moving | ModulePhase::Settled)
                {
                    self.retire([Violation::MovedWithoutPlan {
                        module: state.module,
                    }]);
                }
                if let Some(epoch) = state.epoch {
                    let fits = self.epoch(epoch).note_state(now, state);
                    self.counts.dropped += u64::from(!fits);
                }
            }
            Message::Roster(RosterMessage::Plan(roster)) => {
                self.epoch(roster.epoch).note_roster(now, roster);
            }
            Message::Claim(claim) => {
                let fits = self.epoch(claim.epoch).note_claim(now, claim);
                self.counts.dropped += u64::from(!fits);
            }
            Message::Heartbeat(heartbeat) => {
                let Some(module) = self.module(heartbeat.module) else {
                    return;
                };
                module.note_heartbeat(now, heartbeat);
                if let Some(epoch) = heartbeat.epoch {
                    let fits = self.epoch(epoch).note_heartbeat(heartbeat);
                    self.counts.dropped += u64::from(!fits);
                }
            }
            // A gathering decides nothing yet, and eviction notices repeat what claims say.
            Message::Roster(RosterMessage::Gather { .. }) | Message::Eviction(_) => {}
        }
    }

    fn module(&mut self, id: ModuleId) -> Option<&mut ModuleRecord> {
        if self.modules.len() >= MODULES_MAX && !self.modules.contains_key(&id) {
            self.counts.dropped += 1;
            return None;
        }
        Some(self.modules.entry(id).or_default())
    }

    fn epoch(&mut self, epoch: Epoch) -> &mut EpochRecord {
        if let Some((old, record)) = self.epochs.make_room_for(epoch) {
            self.retire(self.violations_in(old, &record));
        }
        self.epochs.record(epoch)
    }

    /// Keeps violations that no epoch's record shows.
    fn retire(&mut self, violations: impl IntoIterator<Item = Violation>) {
        for violation in violations {
            if self.retired.len() < VIOLATIONS_MAX && !self.retired.contains(&violation) {
                self.retired.push(violation);
            }
        }
    }

    /// When [`Self::verdict`] may change without a message; `None` once it is given.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        if self.verdict.is_some() {
            return None;
        }
        let limit = self.time_limit();
        Some(self.reached_since.map_or(limit, |since| {
            limit.min(since.saturating_add(self.parameters.grace))
        }))
    }

    fn time_limit(&self) -> Duration {
        self.limit_from.saturating_add(self.parameters.time_limit)
    }

    /// The judgement, once there is one.
    pub fn verdict(&mut self, now: Duration) -> Option<&Verdict> {
        if self.verdict.is_none() {
            self.verdict = self.judge(now);
        }
        self.verdict.as_ref()
    }

    /// Looks again at a verdict that was given; `None` while it still holds.
    ///
    /// A formation that was done and is not any more, because a member fell silent or a new plan is under way, is
    /// FAILED until it is done again. A target that asks for something else ends the verdict, and the time limit starts
    /// again.
    pub fn review(&mut self, now: Duration) -> Option<&Verdict> {
        let known = self
            .verdict
            .take()
            .filter(|_| !std::mem::take(&mut self.has_new_target));
        let Some(known) = known else {
            self.broken_since = None;
            return self.verdict(now);
        };
        let fresh = match self.judge(now) {
            Some(verdict) => Some(verdict),
            // Done, but not right yet, which it may still become.
            None if self.reached_since.is_some() => None,
            None => {
                let since = *self.broken_since.get_or_insert(now);
                (now >= since.saturating_add(RETRACTION_DELAY))
                    .then(|| self.report(self.missing(now), None))
            }
        };
        if self.reached_since.is_some() {
            self.broken_since = None;
        }
        match fresh.filter(|fresh| !fresh.says_the_same_as(&known)) {
            Some(fresh) => Some(self.verdict.insert(fresh)),
            None => {
                self.verdict = Some(known);
                None
            }
        }
    }

    /// The target that was announced with the highest revision, or its withdrawal.
    #[must_use]
    pub fn target(&self) -> Option<&Arc<TargetAnnouncement>> {
        self.target.as_ref()
    }

    /// How far the formation has come.
    #[must_use]
    pub fn progress(&self) -> Progress {
        let announced = self.target.as_ref();
        let without_plan = match announced.and_then(|target| target.target.as_ref()) {
            Some(_) => FormationStage::Gathering,
            None => FormationStage::WaitingForTarget,
        };
        let mut progress = Progress {
            stage: without_plan,
            epoch: None,
            joined: self.modules.len(),
            expected: self.expected_count(),
            planned: 0,
            agreed: 0,
            settled: 0,
            to_fill: 0,
            waiting_for: self.absent().collect(),
        };
        let Some(planned) = self.newest() else {
            return progress;
        };
        let end = EndState::new(self, planned);
        let missing = end.missing();
        let problem = planned.problem;
        progress.epoch = Some(planned.epoch);
        progress.planned = end.claimed.replay.spots.len();
        progress.agreed = end.agreed();
        progress.settled = end.assignments().len();
        progress.to_fill = problem.modules().len().min(problem.target().spots().len());
        progress.stage = if self.is_outdated(planned) {
            without_plan
        } else if missing.is_empty() {
            FormationStage::Done
        } else if end.is_agreed() && end.claims_are_whole() {
            FormationStage::Acting
        } else if end.claims_are_whole() {
            FormationStage::Agreeing
        } else {
            FormationStage::Planning
        };
        let waits_for_agreement = progress.stage < FormationStage::Acting;
        let waiting_for: BTreeSet<ModuleId> = missing
            .iter()
            .filter_map(|one| match *one {
                Missing::Agreement { module, .. } => Some(module),
                Missing::Settled { module, .. } | Missing::Spare { module, .. } => {
                    (!waits_for_agreement).then_some(module)
                }
                _ => None,
            })
            .chain(self.absent())
            .collect();
        progress.waiting_for = waiting_for.into_iter().collect();
        progress
    }

    /// The newest plan, once all its members agree on it; `None` before, and as soon as a newer target is announced.
    #[must_use]
    pub fn agreement(&self) -> Option<Agreement> {
        let planned = self.current()?;
        let end = EndState::new(self, planned);
        if !end.is_agreed() || !end.claims_are_whole() {
            return None;
        }
        let last_claim = end.claimed.last_received.unwrap_or(planned.received);
        Some(Agreement {
            epoch: planned.epoch,
            planning: last_claim.saturating_sub(planned.received),
            violations: self.violations_in(planned.epoch, planned.record),
            assignments: end.claimed.replay.spots,
        })
    }

    fn expected_count(&self) -> Option<usize> {
        let announced = self
            .target
            .as_ref()
            .and_then(|target| target.expected_modules)
            .and_then(|count| usize::try_from(count).ok());
        let named = self.parameters.expected.len();
        announced.or((named > 0).then_some(named))
    }

    /// The expected modules of which no message arrived, ascending.
    fn absent(&self) -> impl Iterator<Item = ModuleId> + '_ {
        let expected = self.parameters.expected.iter().copied();
        expected.filter(|module| !self.modules.contains_key(module))
    }

    /// The newest epoch that can be planned for.
    fn newest(&self) -> Option<PlannedEpoch<'_>> {
        let mut epochs = self.epochs.with_roster().rev();
        epochs.find_map(|(epoch, record)| record.planned(epoch))
    }

    /// The newest epoch that can be planned for, if it plans for the target that holds.
    fn current(&self) -> Option<PlannedEpoch<'_>> {
        self.newest().filter(|planned| !self.is_outdated(*planned))
    }

    /// The newest epoch with a roster, if it plans for the target that holds.
    #[must_use]
    pub fn current_epoch(&self) -> Option<Epoch> {
        self.current().map(|planned| planned.epoch)
    }

    /// Whether a newer target holds than a roster plans for: one that asks for something else, or the same once more
    /// after it was withdrawn. Agents, too, compare targets by what they ask for.
    fn is_outdated(&self, planned: PlannedEpoch<'_>) -> bool {
        let planned = &planned.roster.target;
        let is_withdrawn = self.withdrawn > Some(planned.revision);
        is_withdrawn
            || self.target.as_ref().is_some_and(|target| {
                target.revision > planned.revision && !ask_the_same(target, planned)
            })
    }

    fn judge(&mut self, now: Duration) -> Option<Verdict> {
        let is_late = now >= self.time_limit();
        let missing = self.missing(now);
        if missing.is_empty() {
            self.reached_since.get_or_insert(now);
        } else {
            self.reached_since = None;
            return is_late.then(|| self.report(missing, None));
        }
        let since = self.reached_since.unwrap_or(now);
        let is_settled = is_late || now >= since.saturating_add(self.parameters.grace);
        let mut verdict = self.report(missing, Some(since));
        if verdict.violations.is_empty() {
            let members = verdict.assignments.len() + verdict.unassigned.len();
            let is_short = self.expected_count().is_some_and(|count| members < count);
            if verdict.open_spots.is_empty() {
                verdict.outcome = Outcome::Complete;
                return Some(verdict);
            }
            verdict.outcome = Outcome::Partial;
            return (is_settled || !is_short).then_some(verdict);
        }
        is_settled.then_some(verdict)
    }

    /// What the newest target still waits for.
    fn missing(&self, now: Duration) -> Vec<Missing> {
        let absent = self.absent().map(|module| Missing::Module { module });
        let Some(planned) = self.current() else {
            return absent.chain(self.missing_roster()).collect();
        };
        let mut missing = EndState::new(self, planned).missing();
        missing.extend(self.silent(now, planned));
        if !missing.is_empty() {
            missing.extend(absent);
        }
        missing
    }

    /// The members whose last heartbeat is too old.
    fn silent(&self, now: Duration, planned: PlannedEpoch<'_>) -> impl Iterator<Item = Missing> {
        let silence = self.parameters.silence;
        planned.members().iter().filter_map(move |member| {
            let module = member.module.id;
            let known = self.modules.get(&module)?;
            let last = known.heartbeat_of(member.incarnation)?;
            (now.saturating_sub(last) > silence).then_some(Missing::Silent { module, silence })
        })
    }

    fn missing_roster(&self) -> impl Iterator<Item = Missing> {
        let joined = self.modules.len();
        let expected = self.expected_count().filter(|&expected| joined < expected);
        let roster = match &self.target {
            None => Missing::Target,
            Some(target) if target.target.is_none() => Missing::WithdrawnTarget,
            Some(target) => Missing::Roster {
                revision: target.revision,
            },
        };
        let modules = expected.map(|expected| Missing::Modules { joined, expected });
        modules.into_iter().chain([roster])
    }

    /// The report on what is known now; its outcome stands at FAILED until something better is shown.
    fn report(&self, mut missing: Vec<Missing>, completed: Option<Duration>) -> Verdict {
        let mut violations = self.retired.clone();
        for (epoch, record) in self.epochs.with_roster() {
            violations.extend(self.violations_in(epoch, record));
        }
        let mut verdict = Verdict {
            outcome: Outcome::Failed,
            epoch: None,
            filled_spots: 0,
            open_spots: Vec::new(),
            assignments: BTreeMap::new(),
            unassigned: Vec::new(),
            violations,
            missing: Vec::new(),
            timings: Timings {
                completed,
                ..Timings::default()
            },
            counts: Counts {
                epochs: self.epochs.with_roster().count(),
                ..self.counts
            },
        };
        if let Some(planned) = self.current() {
            let end = EndState::new(self, planned);
            if completed.is_some() {
                verdict.violations.extend(end.violations(&self.parameters));
                let acts = Acts::new(planned);
                verdict
                    .violations
                    .extend(unit_violations(&acts, &end.claimed));
            }
            let rostered = &planned.roster.target;
            let target_differs = self.target.as_ref().is_some_and(|target| {
                target.revision == rostered.revision && target.target != rostered.target
            });
            if target_differs {
                let epoch = planned.epoch;
                verdict.violations.push(Violation::TargetDiffers { epoch });
            }
            verdict.report_on(planned, &end);
            if completed.is_none() {
                let holders = &end.claimed.replay.holders;
                let open = verdict.open_spots.iter().copied();
                missing.extend(
                    open.filter(|spot| !holders.contains_key(spot))
                        .map(|spot| Missing::Spot { spot }),
                );
            }
        }
        verdict.violations.sort();
        verdict.violations.dedup();
        verdict.violations.truncate(VIOLATIONS_MAX);
        verdict.missing = missing;
        verdict
    }

    /// What the messages of one epoch show to be wrong, whether or not its end state was reached.
    fn violations_in(&self, epoch: Epoch, record: &EpochRecord) -> Vec<Violation> {
        let mut violations = record.violations.clone();
        if let Some(planned) = record.planned(epoch) {
            violations.extend(replay_claims(planned).replay.violations);
            let acts = Acts::new(planned);
            violations.extend(acts.violations(self.parameters.position_tolerance));
        }
        violations
    }
}

impl Verdict {
    /// Whether the other verdict says nothing new; what is still missing changes all the time.
    fn says_the_same_as(&self, other: &Self) -> bool {
        let unfinished = self.outcome == Outcome::Failed;
        self.outcome == other.outcome
            && self.violations == other.violations
            && (unfinished
                || (self.epoch == other.epoch
                    && self.assignments == other.assignments
                    && self.unassigned == other.unassigned))
    }

    fn report_on(&mut self, planned: PlannedEpoch<'_>, end: &EndState<'_>) {
        self.epoch = Some(planned.epoch);
        self.assignments = end.assignments();
        let filled: BTreeSet<SpotId> = self.assignments.values().copied().collect();
        self.filled_spots = filled.len();
        let spots = planned.problem.target().spots().iter().map(|spot| spot.id);
        self.open_spots = spots.filter(|spot| !filled.contains(spot)).collect();
        let modules = planned.problem.modules().iter().map(|module| module.id);
        self.unassigned = modules
            .filter(|module| !self.assignments.contains_key(module))
            .collect();
        let claimed = &end.claimed;
        self.timings.roster_known = Some(planned.received);
        self.timings.first_moving = first_moving(planned);
        self.timings.last_claim = claimed.last_received;
        self.counts.claims = usize::try_from(claimed.turns).unwrap_or(usize::MAX);
        self.counts.pairs = claimed.replay.pairs;
        self.counts.evictions = claimed.replay.evictions;
        self.counts.detached = claimed.replay.detached.len();
    }
}

/// Whether two announcements lead to the same plans, whatever their revisions and names.
fn ask_the_same(one: &TargetAnnouncement, other: &TargetAnnouncement) -> bool {
    one.target == other.target && one.parameters == other.parameters
}

/// Modules that moved as one unit must have been placed as one block.
fn unit_violations(acts: &Acts<'_>, claimed: &Claimed) -> Vec<Violation> {
    let blocks: BTreeSet<&Vec<ModuleId>> = claimed.replay.blocks.iter().collect();
    let in_blocks: BTreeSet<ModuleId> = claimed.replay.blocks.iter().flatten().copied().collect();
    acts.units()
        .iter()
        .filter(|(lead, unit)| {
            let is_single = unit.modules.len() == 1 && !in_blocks.contains(lead);
            !(is_single || blocks.contains(&unit.modules)) || unit.modules.first() != Some(lead)
        })
        .map(|(&lead, _)| Violation::WrongUnit { lead })
        .collect()
}

fn first_moving(planned: PlannedEpoch<'_>) -> Option<Duration> {
    let members = planned.members().iter();
    members
        .filter(|member| member.module.pin.is_none())
        .filter_map(|member| planned.act_of(member)?.moved_at)
        .min()
}
