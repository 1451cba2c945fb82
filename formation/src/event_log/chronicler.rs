//! Makes entries of the messages on the topics.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use super::{Entry, Event, Told};
use crate::model::{
    Epoch, Incarnation, MODULES_MAX, Message, ModuleId, ModuleState, Pose, RosterMessage, SpotClaim,
};

/// Poses of one module that come faster than this tell nothing more.
const POSE_INTERVAL: Duration = Duration::from_millis(100);

/// Listens to all topics and tells what is new, in an order that can be replayed.
///
/// Messages may come late, more than once, and in any order across writers: what is out of date is left out, and the
/// claims of an epoch are put in the order of their turns. Of several different claims for one turn the first counts.
/// Memory is bounded by the number of modules; entries are handed out, not kept.
#[derive(Clone, Debug, Default)]
pub struct Chronicler {
    modules: BTreeMap<ModuleId, Known>,
    /// The newest epoch that was heard of, and whether its roster was.
    epoch: Option<(Epoch, bool)>,
    /// The turn whose claim is told next.
    next_turn: u32,
    /// The claims of the newest epoch that came before their turn.
    early: BTreeMap<u32, Arc<SpotClaim>>,
}

/// What was told of a module.
#[derive(Clone, Debug)]
struct Known {
    incarnation: Incarnation,
    sequence: u64,
    told: Told,
    pose_at: Duration,
}

impl Chronicler {
    /// Takes in a message, heard at `now` since the watching began, and tells what is new.
    pub fn hear(&mut self, now: Duration, message: &Message) -> Vec<Entry> {
        let events = match message {
            Message::ModuleState(state) => self.hear_state(now, state).into_iter().collect(),
            Message::Roster(RosterMessage::Gather { epoch, .. }) => {
                let is_new = self.turn_to(*epoch);
                is_new
                    .then_some(Event::Gathering(*epoch))
                    .into_iter()
                    .collect()
            }
            Message::Roster(RosterMessage::Plan(roster)) => {
                self.turn_to(roster.epoch);
                let mut events = Vec::new();
                if self.epoch == Some((roster.epoch, false)) {
                    self.epoch = Some((roster.epoch, true));
                    events.push(Event::Roster {
                        epoch: roster.epoch,
                        modules: roster
                            .members
                            .iter()
                            .map(|member| member.module.id)
                            .collect(),
                    });
                    self.tell_claims(&mut events);
                }
                events
            }
            Message::Claim(claim) => self.hear_claim(claim),
            // Claims carry their evictions, and heartbeats say nothing that states do not.
            Message::Target(_) | Message::Eviction(_) | Message::Heartbeat(_) => Vec::new(),
        };
        let at_ms = u64::try_from(now.as_millis()).unwrap_or(u64::MAX);
        events
            .into_iter()
            .map(|event| Entry { at_ms, event })
            .collect()
    }

    /// Forgets the claims of earlier epochs if this one is newer; whether it is.
    fn turn_to(&mut self, epoch: Epoch) -> bool {
        let is_new = self.epoch.is_none_or(|(known, _)| known < epoch);
        if is_new {
            self.epoch = Some((epoch, false));
            self.next_turn = 0;
            self.early.clear();
        }
        is_new
    }

    fn hear_claim(&mut self, claim: &Arc<SpotClaim>) -> Vec<Event> {
        self.turn_to(claim.epoch);
        let is_current = self.epoch.is_some_and(|(epoch, _)| epoch == claim.epoch);
        // A plan takes at most two turns a module: one in its configuration, and one more if it leaves that.
        let is_due = claim.turn >= self.next_turn
            && usize::try_from(claim.turn).is_ok_and(|turn| turn < 2 * MODULES_MAX);
        if !is_current || !is_due {
            return Vec::new();
        }
        self.early
            .entry(claim.turn)
            .or_insert_with(|| Arc::clone(claim));
        let mut events = Vec::new();
        self.tell_claims(&mut events);
        events
    }

    /// Tells the claims whose turn has come; none before the roster, which comes from another writer.
    fn tell_claims(&mut self, events: &mut Vec<Event>) {
        if !self.epoch.is_some_and(|(_, has_roster)| has_roster) {
            return;
        }
        while let Some(claim) = self.early.remove(&self.next_turn) {
            self.next_turn += 1;
            events.push(Event::Claim {
                epoch: claim.epoch,
                turn: claim.turn,
                claimant: claim.claimant,
                decision: claim.decision.clone(),
            });
        }
    }

    fn hear_state(&mut self, now: Duration, state: &ModuleState) -> Option<Event> {
        let told = Told {
            module: state.module,
            phase: state.phase,
            pose: state.pose,
            links: state.links.clone(),
            spot: state.spot,
            unit: state.unit,
        };
        let Some(known) = self.modules.get_mut(&state.module) else {
            if self.modules.len() < MODULES_MAX {
                let known = Known {
                    incarnation: state.incarnation,
                    sequence: state.sequence,
                    told: told.clone(),
                    pose_at: now,
                };
                self.modules.insert(state.module, known);
                return Some(Event::State(told));
            }
            return None;
        };
        if (state.incarnation, state.sequence) <= (known.incarnation, known.sequence) {
            return None;
        }
        let is_restart = known.incarnation != state.incarnation;
        (known.incarnation, known.sequence) = (state.incarnation, state.sequence);
        if told == known.told && !is_restart {
            return None;
        }
        let only_moved = !is_restart
            && Told {
                pose: told.pose,
                ..known.told.clone()
            } == told;
        if only_moved && now < known.pose_at.saturating_add(POSE_INTERVAL) {
            return None;
        }
        let pose: Pose = told.pose;
        known.told = told.clone();
        known.pose_at = now;
        Some(if only_moved {
            Event::Pose {
                module: state.module,
                pose,
            }
        } else {
            Event::State(told)
        })
    }
}

#[cfg(test)]
mod tests;
