//! Makes entries of the messages on the topics.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use super::{Entry, LogEvent, ModuleSnapshot, milliseconds};
use formation_model::{
    ClosedRoster, DriveState, Epoch, Incarnation, MODULES_MAX, Message, ModuleId, ModuleState,
    RosterMember, RosterMessage, Service, SpotClaim, TURNS_MAX,
};

/// The usual least time between two recorded poses of one module.
pub const POSE_INTERVAL: Duration = Duration::from_millis(100);

/// Makes entries of messages, in an order that can be replayed.
///
/// Messages may arrive late, more than once, and in any order across writers. The recorder leaves out what is out of
/// date and puts the claims of an epoch in the order of their turns; of several different claims for one turn the first
/// counts. Memory is bounded by the number of modules; entries are handed out, not kept.
#[derive(Clone, Debug)]
pub struct Recorder {
    pose_interval: Duration,
    modules: BTreeMap<ModuleId, Known>,
    /// The newest known epoch, and whether its roster arrived.
    epoch: Option<(Epoch, bool)>,
    /// The turn whose claim is recorded next.
    next_turn: u32,
    /// The claims of the newest epoch that arrived before their turn.
    early: BTreeMap<u32, Arc<SpotClaim>>,
}

/// The latest state of a module, as far as it was recorded.
#[derive(Clone, Debug)]
struct Known {
    incarnation: Incarnation,
    sequence: u64,
    snapshot: ModuleSnapshot,
    drive: DriveState,
    steps_done: Option<u32>,
    pose_at: Duration,
}

impl Recorder {
    /// A recorder that leaves out poses of one module that follow each other faster than `pose_interval`.
    #[must_use]
    pub fn new(pose_interval: Duration) -> Self {
        Self {
            pose_interval,
            modules: BTreeMap::new(),
            epoch: None,
            next_turn: 0,
            early: BTreeMap::new(),
        }
    }

    /// Records a message that arrived at `now`, measured from the beginning of the observation.
    pub fn record(&mut self, now: Duration, message: &Message) -> Vec<Entry> {
        let mut events = Vec::new();
        match message {
            Message::ModuleState(state) => events.extend(self.record_state(now, state)),
            Message::Roster(RosterMessage::Gather { epoch, .. }) => {
                if self.advance_to(*epoch) {
                    events.push(LogEvent::Gathering(*epoch));
                }
            }
            Message::Roster(RosterMessage::Plan(roster)) => {
                let epoch = roster.epoch;
                self.advance_to(epoch);
                if self.epoch == Some((epoch, false)) {
                    self.epoch = Some((epoch, true));
                    events.push(roster_event(roster));
                    self.record_claims_due(&mut events);
                }
            }
            Message::Claim(claim) => {
                if self.keep_claim(claim) {
                    self.record_claims_due(&mut events);
                }
            }
            // Claims carry their evictions, and states carry all of a heartbeat that an entry needs.
            Message::Target(_)
            | Message::Eviction(_)
            | Message::Heartbeat(_)
            | Message::OtherSessionState(_)
            | Message::Stop(_)
            | Message::Removal(_) => {}
        }
        let at_ms = milliseconds(now);
        let entries = events.into_iter();
        entries.map(|event| Entry { at_ms, event }).collect()
    }

    /// Whether the latest state of a module came from this run of its process.
    #[must_use]
    pub fn is_current(&self, module: ModuleId, incarnation: Incarnation) -> bool {
        let known = self.modules.get(&module);
        known.is_some_and(|known| known.incarnation == incarnation)
    }

    /// Drops the claims of earlier epochs if this one is newer; returns whether it is.
    fn advance_to(&mut self, epoch: Epoch) -> bool {
        let is_new = self.epoch.is_none_or(|(known, _)| known < epoch);
        if is_new {
            self.epoch = Some((epoch, false));
            self.next_turn = 0;
            self.early.clear();
        }
        is_new
    }

    fn keep_claim(&mut self, claim: &Arc<SpotClaim>) -> bool {
        self.advance_to(claim.epoch);
        let is_current = self.epoch.is_some_and(|(epoch, _)| epoch == claim.epoch);
        let is_due = (self.next_turn..TURNS_MAX).contains(&claim.turn);
        if is_current && is_due {
            let kept = self.early.entry(claim.turn);
            kept.or_insert_with(|| Arc::clone(claim));
        }
        is_current && is_due
    }

    /// Records the claims whose turn has come; none before the roster, which another writer publishes.
    fn record_claims_due(&mut self, events: &mut Vec<LogEvent>) {
        if !self.epoch.is_some_and(|(_, has_roster)| has_roster) {
            return;
        }
        while let Some(claim) = self.early.remove(&self.next_turn) {
            self.next_turn += 1;
            events.push(LogEvent::Claim {
                epoch: claim.epoch,
                turn: claim.turn,
                claimant: claim.claimant,
                decision: claim.decision.clone(),
            });
        }
    }

    fn record_state(&mut self, now: Duration, state: &ModuleState) -> Option<LogEvent> {
        let snapshot = ModuleSnapshot {
            module: state.module,
            phase: state.phase,
            pose: state.pose,
            links: state.links.clone(),
            spot: state.spot,
            unit: state.unit,
            in_service: state.service == Service::Active,
        };
        let known = self.modules.get_mut(&state.module);
        let is_restart = known
            .as_ref()
            .is_none_or(|known| known.incarnation != state.incarnation);
        let mut only_moved = false;
        if let Some(known) = known {
            if (state.incarnation, state.sequence) <= (known.incarnation, known.sequence) {
                return None;
            }
            (known.incarnation, known.sequence) = (state.incarnation, state.sequence);
            let before = ModuleSnapshot {
                pose: snapshot.pose,
                ..known.snapshot.clone()
            };
            only_moved = !is_restart && before == snapshot;
            let is_too_soon = now < known.pose_at.saturating_add(self.pose_interval);
            // Viewers interpolate between poses, so they need every corner, begin and stop.
            let goes_on = known.drive == state.drive;
            let is_corner = known.steps_done != state.steps_done;
            let is_same = snapshot.pose == known.snapshot.pose;
            if only_moved && goes_on && (is_same || is_too_soon && !is_corner) {
                return None;
            }
        } else if self.modules.len() >= MODULES_MAX {
            return None;
        }
        let known = Known {
            incarnation: state.incarnation,
            sequence: state.sequence,
            snapshot: snapshot.clone(),
            drive: state.drive,
            steps_done: state.steps_done,
            pose_at: now,
        };
        self.modules.insert(state.module, known);
        Some(match only_moved {
            true => LogEvent::Pose {
                module: snapshot.module,
                pose: snapshot.pose,
            },
            false => LogEvent::State(snapshot),
        })
    }
}

fn roster_event(roster: &ClosedRoster) -> LogEvent {
    let ids = |members: &mut dyn Iterator<Item = &RosterMember>| -> Vec<ModuleId> {
        members.map(|member| member.module.id).collect()
    };
    let members = || roster.members.iter();
    let problem = roster.problem().ok().flatten();
    LogEvent::Roster {
        epoch: roster.epoch,
        modules: ids(&mut members()),
        out_of_service: ids(&mut members().filter(|member| member.service != Service::Active)),
        problem: problem.map(|problem| problem.digest()),
    }
}

#[cfg(test)]
mod tests;
