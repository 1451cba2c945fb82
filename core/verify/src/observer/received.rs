//! All messages received, in a form that does not depend on their order.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use super::bodies::Bodies;
use super::causality::Acts;
use super::claims::replay_claims;
use super::parameters::ObserverParameters;
use super::record::{EpochRecord, ModuleRecord, PlannedEpoch, ReceivedRoster, entry_within};
use crate::violation::{VIOLATIONS_MAX, Violation};
use formation_model::{
    BodyReport, Epoch, Incarnation, MODULES_MAX, Message, MicroUnits, ModuleId, ModuleState, Pose,
    RosterMember, RosterMessage, TargetAnnouncement,
};

/// The greatest number of epochs that are kept.
const EPOCHS_MAX: usize = 64;

/// All messages received.
#[derive(Clone, Debug, Default)]
pub(super) struct Received {
    position_tolerance: MicroUnits,
    /// Where the modules were.
    pub(super) bodies: Bodies,
    /// The announcement with the highest revision.
    pub(super) target: Option<Arc<TargetAnnouncement>>,
    /// The highest revision that withdrew the target then in force. Agents ignore a withdrawal that arrives after a later
    /// revision.
    withdrawn: Option<u64>,
    /// When a target was announced again after that.
    announced_again: Option<Duration>,
    /// The time within which living modules have received what was announced.
    silence: Duration,
    pub(super) modules: BTreeMap<ModuleId, ModuleRecord>,
    /// Where the newest run of each module of another session was last seen.
    pub(super) other_sessions: BTreeMap<ModuleId, (Incarnation, Pose)>,
    epochs: BTreeMap<Epoch, EpochRecord>,
    /// The violations of epochs that were dropped for newer ones.
    pub(super) retired: Vec<Violation>,
    /// The promises of these epochs that no message showed to be kept.
    pub(super) unproven: u64,
    /// The number of messages, repetitions included.
    pub(super) messages: u64,
    /// The number of messages that were dropped because a limit was reached.
    pub(super) dropped: u64,
}

impl Received {
    pub(super) fn new(parameters: &ObserverParameters) -> Self {
        Self {
            position_tolerance: parameters.position_tolerance,
            silence: parameters.silence,
            bodies: Bodies::new(parameters),
            ..Self::default()
        }
    }

    /// Handles a message. Returns whether it announces a target with other content than the one in force before.
    pub(super) fn handle(&mut self, now: Duration, message: &Message) -> bool {
        self.messages += 1;
        let fits = match message {
            Message::Target(announcement) => return self.handle_target(now, announcement),
            Message::ModuleState(state) => self.handle_state(now, state),
            Message::Roster(RosterMessage::Plan(roster)) => {
                if let Some(target) = &roster.target.target {
                    self.bodies.note_target(target);
                }
                let convener = self.modules.get(&roster.epoch.convener).cloned();
                let epoch = self.epoch(roster.epoch);
                epoch.handle_roster(now, roster, convener.as_ref());
                true
            }
            Message::Claim(claim) => self.epoch(claim.epoch).handle_claim(now, claim),
            Message::Heartbeat(heartbeat) => {
                match entry_within(&mut self.modules, heartbeat.module, MODULES_MAX) {
                    Some(module) => {
                        module.handle_heartbeat(now, heartbeat);
                        heartbeat
                            .epoch
                            .is_none_or(|epoch| self.epoch(epoch).handle_heartbeat(heartbeat))
                    }
                    None => false,
                }
            }
            // A gathering decides nothing, and eviction notices repeat the claims.
            Message::Roster(RosterMessage::Gather { .. }) | Message::Eviction(_) => true,
            // Heartbeats repeat what operators command, and rosters what was removed.
            Message::Stop(_) | Message::Removal(_) => true,
            Message::OtherSessionState(state) => self.handle_other_session_state(state),
        };
        self.dropped += u64::from(!fits);
        false
    }

    fn handle_target(&mut self, now: Duration, announcement: &Arc<TargetAnnouncement>) -> bool {
        let known = self.target.as_ref();
        if known.is_some_and(|known| known.revision >= announcement.revision) {
            return false;
        }
        if announcement.target.is_none() {
            self.withdrawn = Some(announcement.revision);
            self.announced_again = None;
        } else if self.withdrawn.is_some() {
            self.announced_again.get_or_insert(now);
        }
        let has_new_content = known.is_none_or(|known| !have_same_content(known, announcement));
        self.target = Some(Arc::clone(announcement));
        has_new_content
    }

    fn handle_state(&mut self, now: Duration, state: &Arc<ModuleState>) -> bool {
        let Some(module) = entry_within(&mut self.modules, state.module, MODULES_MAX) else {
            return false;
        };
        module.handle_state(now, state);
        self.bodies.handle(state);
        state
            .epoch
            .is_none_or(|epoch| self.epoch(epoch).handle_state(now, state))
    }

    fn handle_other_session_state(&mut self, state: &ModuleState) -> bool {
        match entry_within(&mut self.other_sessions, state.module, MODULES_MAX) {
            Some(known) => {
                if known.0 <= state.incarnation {
                    *known = (state.incarnation, state.pose);
                }
                true
            }
            None => false,
        }
    }

    /// The record of an epoch. If there are too many to add it, the lowest without a roster is dropped, or else the lowest.
    fn epoch(&mut self, epoch: Epoch) -> &mut EpochRecord {
        if self.epochs.len() >= EPOCHS_MAX && !self.epochs.contains_key(&epoch) {
            let mut all = self.epochs.iter();
            let idle = all.find(|(_, record)| record.roster.is_none());
            let lowest = self.epochs.keys().next();
            let dropped = idle.map(|(epoch, _)| epoch).or(lowest).copied();
            if let Some(dropped) = dropped
                && let Some(record) = self.epochs.remove(&dropped)
            {
                let (shown, unproven) = split(self.violations_in(dropped, &record));
                self.retire(shown);
                self.unproven += unproven;
            }
        }
        self.epochs.entry(epoch).or_default()
    }

    /// Keeps violations that no epoch's record shows.
    fn retire(&mut self, violations: impl IntoIterator<Item = Violation>) {
        for violation in violations {
            if self.retired.len() < VIOLATIONS_MAX && !self.retired.contains(&violation) {
                self.retired.push(violation);
            }
        }
    }

    /// The epochs whose rosters were received, ascending.
    pub(super) fn with_roster(
        &self,
    ) -> impl DoubleEndedIterator<Item = (Epoch, &EpochRecord)> + Clone {
        let epochs = self.epochs.iter().map(|(&epoch, record)| (epoch, record));
        epochs.filter(|(_, record)| record.roster.is_some())
    }

    /// The newest epoch that can be planned for, and that is not of the past.
    pub(super) fn newest(&self) -> Option<PlannedEpoch<'_>> {
        let epochs = self.epochs.iter().rev();
        let mut planned = epochs.filter_map(|(&epoch, record)| record.planned(epoch));
        planned.find(|planned| !planned.is_past(&self.modules) && !self.is_forgotten(planned))
    }

    /// Whether the roster of an earlier epoch knows of a later run of the convener: all that may plan have forgotten the later epoch.
    fn is_forgotten(&self, planned: &PlannedEpoch<'_>) -> bool {
        let convener = planned.epoch.convener;
        let run = planned
            .members()
            .iter()
            .find(|member| member.module.id == convener);
        let run = run.map(RosterMember::run);
        let Some((run, record)) = run.zip(self.modules.get(&convener)) else {
            return false;
        };
        let earlier = self.epochs.range(..planned.epoch);
        let rosters = earlier.filter_map(|(_, record)| record.roster.as_ref());
        rosters.map(|received| &received.roster).any(|roster| {
            let members = roster.members.iter().map(RosterMember::run);
            let bodies = roster.bodies.iter().map(BodyReport::run);
            let mut known = members.chain(bodies).filter(|one| one.module == convener);
            known.any(|one| {
                let order = record.compare_runs(one.incarnation, run.incarnation);
                order.is_gt()
            })
        })
    }

    /// The newest epoch that can be planned for, if it plans for the target in force.
    pub(super) fn current(&self) -> Option<PlannedEpoch<'_>> {
        self.newest()
            .filter(|planned| !self.is_outdated(planned.roster))
    }

    /// Whether a newer target is in force than the roster's: one with other content, or the same after a withdrawal. Agents
    /// compare targets by content, too.
    pub(super) fn is_outdated(&self, received: &ReceivedRoster) -> bool {
        let planned = &received.roster.target;
        let is_withdrawn = self.withdrawn > Some(planned.revision);
        is_withdrawn && !self.outlasted_withdrawal(received)
            || self.target.as_ref().is_some_and(|target| {
                target.revision > planned.revision && !have_same_content(target, planned)
            })
    }

    /// Whether all members of a roster have stayed in its epoch although its target was withdrawn, and announced again, so long ago
    /// that each of them has received that. They were cut off meanwhile, and whoever did not hear of a withdrawal goes on.
    fn outlasted_withdrawal(&self, received: &ReceivedRoster) -> bool {
        let Some(announced_again) = self.announced_again else {
            return false;
        };
        let roster = &received.roster;
        roster.members.iter().all(|member| {
            let record = self.modules.get(&member.module.id);
            let run = record.and_then(|record| record.run_of(member.incarnation));
            run.is_some_and(|run| {
                run.shows_since(roster.epoch, announced_again.saturating_add(self.silence))
            })
        })
    }

    /// The violations that the messages of all epochs show.
    pub(super) fn violations(&self) -> BTreeSet<Violation> {
        let epochs = self.with_roster();
        let shown = epochs.flat_map(|(epoch, record)| self.violations_in(epoch, record));
        shown.chain(self.retired.iter().cloned()).collect()
    }

    /// The violations that the messages of one epoch show, whether or not its end state is reached.
    pub(super) fn violations_in(&self, epoch: Epoch, record: &EpochRecord) -> Vec<Violation> {
        let mut violations = record.violations.clone();
        if let Some(planned) = record.planned(epoch) {
            let moved = planned.members().iter().filter(|member| {
                let record = self.modules.get(&member.module.id);
                let run = record.and_then(|record| record.run_of(member.incarnation));
                run.is_some_and(|run| run.moved_outside_epochs)
            });
            violations.extend(moved.map(|member| Violation::MovedWithoutPlan {
                module: member.module.id,
            }));
            violations.extend(replay_claims(planned).replay.violations);
            violations.extend(Acts::new(planned).violations(self.position_tolerance));
            let is_known =
                |module, was_at: &dyn Fn(Pose) -> bool| planned.knows_body(module, was_at);
            violations.extend(self.bodies.violations(epoch, is_known));
        }
        violations
    }
}

/// The violations that messages show, and the number of the others.
/// Enforces V3.
pub(super) fn split(mut violations: Vec<Violation>) -> (Vec<Violation>, u64) {
    let all = violations.len();
    violations.retain(|violation| !violation.is_lack_of_proof());
    let unproven = all - violations.len();
    (violations, u64::try_from(unproven).unwrap_or(u64::MAX))
}

/// Whether two announcements lead to the same plans, whatever their revisions and names.
fn have_same_content(one: &TargetAnnouncement, other: &TargetAnnouncement) -> bool {
    one.target == other.target && one.parameters == other.parameters
}
