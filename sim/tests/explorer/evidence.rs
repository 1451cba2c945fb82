//! The evidence of an observer of a search, and its judgement.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    Digest, Epoch, Message, ModuleId, ModulePhase, Roster, RosterMember, RosterMessage, SpotId,
    Target,
};
use formation_sim::{blocks_all, room};

use super::world::{World, id};
use super::{Bound, MODULES};

/// After the last disturbance, everything must have ended within this time.
const PATIENCE: Duration = Duration::from_secs(120);
/// An end must last for longer than it takes to detect a silent module.
const CALM: Duration = Duration::from_secs(6);

pub(super) type PlanKey = (Epoch, Digest);

/// The observations on which later judgements depend.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct Evidence {
    pub(super) rosters: BTreeMap<Epoch, Vec<ModuleId>>,
    /// The number of spots that the members of each roster can fill, as bodies block the others.
    pub(super) rooms: BTreeMap<Epoch, usize>,
    pub(super) shown: BTreeMap<PlanKey, BTreeMap<ModuleId, Duration>>,
    pub(super) begun: BTreeSet<PlanKey>,
    /// The epoch that each module shows, and since when.
    pub(super) in_epoch: BTreeMap<ModuleId, (Option<Epoch>, Duration)>,
    pub(super) settled: BTreeMap<(Epoch, Digest, SpotId), ModuleId>,
}

impl Evidence {
    /// Whether these modules are more than half of the last roster for which all members showed one digest, or just half
    /// with the lowest of them. The first roster needs more than half of all.
    fn allows(&self, members: &[ModuleId]) -> bool {
        let agreed = self.rosters.iter().rev().find(|(epoch, roster)| {
            let mut plans = self.shown.iter().filter(|((of, _), _)| of == *epoch);
            plans.any(|(_, shown)| roster.iter().all(|member| shown.contains_key(member)))
        });
        let Some((_, roster)) = agreed else {
            return members.len() * 2 > MODULES;
        };
        let present = roster
            .iter()
            .filter(|member| members.contains(member))
            .count()
            * 2;
        let lowest = roster
            .first()
            .is_some_and(|lowest| members.contains(lowest));
        present > roster.len() || (present == roster.len() && lowest)
    }
}

/// The number of spots that the members of a roster can fill.
fn room_of(roster: &Roster) -> usize {
    let target = roster.target.target.as_ref();
    let active = RosterMember::active(&roster.members).count();
    target.map_or(0, |target| room(roster, target, active))
}

impl World {
    pub(super) fn note(&mut self, index: usize, message: &Message) {
        let (now, module) = (self.now, id(index));
        let evidence = Rc::make_mut(&mut self.evidence);
        match message {
            Message::Heartbeat(heartbeat) => {
                self.published.heartbeats.insert(index, heartbeat.clone());
                let entry = evidence
                    .in_epoch
                    .entry(module)
                    .or_insert((heartbeat.epoch, now));
                if entry.0 > heartbeat.epoch {
                    self.violation = Some(format!("{module} went back from {:?}", entry.0));
                }
                if entry.0 != heartbeat.epoch {
                    *entry = (heartbeat.epoch, now);
                }
                if let Some(plan) = heartbeat.epoch.zip(heartbeat.digest) {
                    evidence
                        .shown
                        .entry(plan)
                        .or_default()
                        .entry(module)
                        .or_insert(now);
                }
            }
            Message::Roster(RosterMessage::Plan(roster)) => {
                let members: Vec<_> = roster
                    .members
                    .iter()
                    .map(|member| member.module.id)
                    .collect();
                if !evidence.allows(&members) {
                    self.violation = Some(format!("a minority plans {}", roster.epoch));
                }
                if evidence.rosters.insert(roster.epoch, members).is_some() {
                    self.violation = Some(format!("two rosters for {}", roster.epoch));
                }
                evidence.rooms.insert(roster.epoch, room_of(roster));
                // Earlier rosters no longer matter.
                while evidence.rosters.len() > 4 {
                    evidence.rosters.pop_first();
                    evidence.rooms.pop_first();
                }
                let oldest = evidence.rosters.keys().next().copied();
                evidence
                    .shown
                    .retain(|(epoch, _), _| Some(*epoch) >= oldest);
                evidence.begun.retain(|(epoch, _)| Some(*epoch) >= oldest);
                evidence
                    .settled
                    .retain(|(epoch, ..), _| Some(*epoch) >= oldest);
            }
            Message::ModuleState(state) => {
                self.published.states.insert(index, Arc::clone(state));
                if let (ModulePhase::Settled, Some(epoch), Some(digest), Some(spot)) =
                    (state.phase, state.epoch, state.digest, state.spot)
                {
                    let holder = *evidence
                        .settled
                        .entry((epoch, digest, spot))
                        .or_insert(module);
                    if holder != module {
                        self.violation = Some(format!("{holder} and {module} both on {spot}"));
                    }
                }
            }
            _ => {}
        }
    }

    /// A drive receives a goal.
    pub(super) fn set_off(&mut self, index: usize, plan: Option<PlanKey>, lease: Duration) {
        let module = id(index);
        let now = self.now;
        let Some(plan) = plan else {
            self.violation = Some(format!("{module} moves without a plan"));
            return;
        };
        for (other, actor) in self.actors.iter().enumerate() {
            let Some((_, arrives, repeated, others)) = actor.as_ref().and_then(|actor| actor.drive)
            else {
                continue;
            };
            let still_going = arrives > now && repeated + lease >= now && !self.is_down(other);
            if still_going && other != index && others != Some(plan) {
                self.violation = Some(format!(
                    "{module} and {} move on different plans",
                    id(other)
                ));
            }
        }
        let evidence = Rc::make_mut(&mut self.evidence);
        let shown = evidence.shown.get(&plan).cloned().unwrap_or_default();
        let members = evidence.rosters.get(&plan.0).cloned().unwrap_or_default();
        if members.is_empty() || members.iter().any(|member| !shown.contains_key(member)) {
            self.violation = Some(format!("{module} moves before all have agreed"));
            return;
        }
        let last = shown.values().max().copied().unwrap_or_default();
        // All who may move by a plan that a member showed before are members now.
        let is_over = |other: &PlanKey| {
            let others = evidence.rosters.get(&other.0);
            others.is_some_and(|others| others.iter().all(|other| members.contains(other)))
        };
        let by_members = |by: &BTreeMap<_, _>| members.iter().any(|member| by.contains_key(member));
        let mut before = evidence.shown.iter();
        let before: Vec<_> = before
            .by_ref()
            .filter(|&(other, by)| *other != plan && by_members(by))
            .collect();
        let follows = !before.is_empty() && before.iter().all(|(other, _)| is_over(other));
        if evidence.begun.insert(plan) && now < last + lease && !follows {
            self.violation = Some(format!("{module} sets off before the lease has passed"));
        }
        // Heartbeats take no time here unless a timer overtakes them, which a second covers.
        let margin = Duration::from_secs(1);
        for member in members {
            if let Some(&(epoch, since)) = evidence.in_epoch.get(&member)
                && epoch != Some(plan.0)
                && now > since + lease + margin
            {
                self.violation = Some(format!("{module} moves long after {member} left"));
            }
        }
    }

    /// Notes whether everything has come to its end, and whether it should have by now.
    pub(super) fn judge(&mut self, target: &Target) {
        let live: Vec<usize> = (0..MODULES)
            .filter(|&index| self.actors[index].is_some())
            .collect();
        let plans: BTreeSet<_> = live
            .iter()
            .filter_map(|index| self.published.heartbeats.get(index))
            .map(|heartbeat| (heartbeat.epoch, heartbeat.digest))
            .collect();
        let spots: BTreeSet<_> = live
            .iter()
            .filter_map(|index| self.published.states.get(index))
            .filter(|state| state.phase == ModulePhase::Settled)
            .filter(|state| plans.contains(&(state.epoch, state.digest)))
            .filter_map(|state| state.spot)
            .collect();
        let epoch = plans.first().and_then(|(epoch, _)| *epoch);
        let is_full = epoch.is_some_and(|epoch| {
            let members = self.evidence.rosters.get(&epoch);
            let are_members = members.is_some_and(|members| members.len() == live.len());
            are_members
                && self
                    .evidence
                    .rooms
                    .get(&epoch)
                    .is_some_and(|&room| spots.len() >= room)
        });
        // No roster is closed while no spot is free.
        let is_over = plans.len() == 1 && is_full || self.all_is_blocked(target, &live);
        let ended = self.disturbance.agenda.is_none() && is_over;
        self.ended_since = match self.ended_since {
            Some(since) if ended => Some(since),
            _ => ended.then_some(self.now),
        };
        if !ended
            && self.disturbance.agenda.is_none()
            && self.now > self.disturbance.last + PATIENCE
        {
            let phases: Vec<_> = live
                .iter()
                .filter_map(|index| self.published.heartbeats.get(index))
                .map(|heartbeat| (heartbeat.module.0, heartbeat.phase))
                .collect();
            self.violation = Some(format!("no end: {phases:?}"));
        }
    }

    /// Whether the bodies of absent modules block every spot, as the others report.
    fn all_is_blocked(&self, target: &Target, live: &[usize]) -> bool {
        let states = live
            .iter()
            .filter_map(|index| self.published.states.get(index));
        let present: BTreeSet<ModuleId> = states.clone().map(|state| state.module).collect();
        let bodies = states.flat_map(|state| &state.bodies);
        let absent = bodies.filter(|body| !present.contains(&body.module));
        let absent = absent.map(|body| body.whereabouts.clone());
        blocks_all(target, absent)
    }

    pub(super) fn has_ended(&self, bound: Bound) -> bool {
        let undisturbed = self.now >= bound.until
            || (self.disturbance.deviations == 0 && !self.disturbance.fault);
        self.ended_since
            .is_some_and(|since| undisturbed && self.now >= since.max(self.disturbance.last) + CALM)
    }
}
