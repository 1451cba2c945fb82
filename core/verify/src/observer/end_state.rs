//! Judges the end state: where the modules stand and to which others they are docked.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use super::claims::{Claimed, disagreement, replay_claims};
use super::parameters::ObserverParameters;
use super::received::Received;
use super::record::{ModuleRecord, PlannedEpoch};
use crate::plan::check_filled;
use crate::{Missing, Violation};
use formation_model::{
    Incarnation, MICRO_PER_UNIT, MicroUnits, ModuleId, ModulePhase, ModuleState, Pose, SpotId,
    Whereabouts,
};

/// A body nearer to a spot than this stands on it: half the width of a module.
const ON_SPOT: MicroUnits = MicroUnits(MICRO_PER_UNIT / 2);

/// The current states of an epoch's members.
pub(super) struct EndState<'a> {
    received: &'a Received,
    modules: &'a BTreeMap<ModuleId, ModuleRecord>,
    /// Where modules of other sessions were last seen.
    other_sessions: &'a BTreeMap<ModuleId, (Incarnation, Pose)>,
    planned: PlannedEpoch<'a>,
    pub(super) claimed: Claimed,
    /// The latest state of each member's run.
    states: BTreeMap<ModuleId, &'a ModuleState>,
    /// The states of the members that have settled in this epoch, and have not been moved since.
    settled: BTreeMap<ModuleId, &'a ModuleState>,
    /// The members that have not shown the plan that most members have shown.
    disagreeing: BTreeSet<ModuleId>,
    /// The number of turns of the plan that most members have shown.
    turns: Option<u32>,
}

impl<'a> EndState<'a> {
    pub(super) fn new(received: &'a Received, planned: PlannedEpoch<'a>) -> Self {
        let Received {
            modules,
            other_sessions,
            ..
        } = received;
        let states: BTreeMap<ModuleId, &ModuleState> = planned
            .members()
            .iter()
            .filter_map(|member| {
                let module = member.module.id;
                let state = modules.get(&module)?.state_of(member.incarnation)?;
                Some((module, &**state))
            })
            .collect();
        let mut settled = states.clone();
        settled.retain(|_, state| {
            state.epoch == Some(planned.epoch)
                && state.phase == ModulePhase::Settled
                && !state.drive.is_off_way()
        });
        let (disagreeing, turns) = disagreement(planned);
        Self {
            received,
            modules,
            other_sessions,
            planned,
            claimed: replay_claims(planned),
            states,
            settled,
            disagreeing,
            turns,
        }
    }

    /// The spots of the settled members, by their own states.
    pub(super) fn assignments(&self) -> BTreeMap<ModuleId, SpotId> {
        self.settled
            .iter()
            .filter_map(|(&module, state)| Some((module, state.spot?)))
            .collect()
    }

    /// The spots that are filled: those of the settled members, and of members that settled there before and have not moved since
    /// the roster was made.
    pub(super) fn filled(&self) -> BTreeMap<ModuleId, SpotId> {
        let mut filled = self.assignments();
        for member in self.planned.members() {
            let (id, act) = (member.module.id, self.planned.act_of(member));
            let has_moved = act.is_some_and(|act| act.moved_received.is_some());
            if let Some(spot) = member.module.pin.filter(|_| !has_moved) {
                filled.entry(id).or_insert(spot);
            }
        }
        filled
    }

    /// The number of members that have shown the plan.
    pub(super) fn agreed(&self) -> usize {
        self.planned.members().len() - self.disagreeing.len()
    }

    /// Whether the claims of all turns were received.
    pub(super) fn claims_are_whole(&self) -> bool {
        self.turns.is_some_and(|turns| turns <= self.claimed.turns)
    }

    /// Whether all members have shown the plan.
    pub(super) fn is_agreed(&self) -> bool {
        self.disagreeing.is_empty()
    }

    /// What the end state still lacks; nothing once it is reached.
    pub(super) fn missing(&self) -> Vec<Missing> {
        let mut missing = Vec::new();
        if !self.claims_are_whole() {
            missing.push(Missing::Claim {
                epoch: self.planned.epoch,
                turn: self.claimed.turns,
            });
        }
        for &module in &self.disagreeing {
            missing.push(Missing::Agreement {
                epoch: self.planned.epoch,
                module,
                phase: self.states.get(&module).map(|state| state.phase),
            });
        }
        for module in self.planned.problem.modules() {
            let id = module.id;
            let state = self.states.get(&id);
            let phase = state.map(|state| state.phase);
            match self.claimed.replay.spots.get(&id) {
                Some(&spot) if !self.settled.contains_key(&id) => missing.push(Missing::Settled {
                    module: id,
                    spot,
                    phase,
                }),
                None if self.claims_are_whole() => {
                    let is_spare = state.is_some_and(|state| {
                        state.epoch == Some(self.planned.epoch) && state.phase == ModulePhase::Spare
                    });
                    if !is_spare {
                        missing.push(Missing::Spare { module: id, phase });
                    }
                }
                _ => {}
            }
        }
        missing
    }

    /// The violations of the end state, once it is reached.
    /// Enforces V1.
    pub(super) fn violations(
        &self,
        now: Duration,
        parameters: &ObserverParameters,
    ) -> Vec<Violation> {
        let mut violations = Vec::new();
        let mut holders: BTreeMap<SpotId, ModuleId> = BTreeMap::new();
        for (&module, &state) in &self.settled {
            let claimed = self.claimed.replay.spots.get(&module).copied();
            if state.spot != claimed {
                violations.push(Violation::WrongSpot {
                    module,
                    held: state.spot,
                    claimed,
                });
            }
            let Some(spot) = state.spot else { continue };
            let Some(place) = self.planned.problem.target().spot(spot) else {
                violations.push(Violation::UnknownSpot { spot });
                continue;
            };
            if let Some(first) = holders.insert(spot, module) {
                violations.push(Violation::TwoHolders {
                    spot,
                    first,
                    second: module,
                });
            }
            let distance = state.pose.distance_to(&place.pose);
            let turn = state.pose.heading_difference(&place.pose);
            if distance > parameters.position_tolerance || turn > parameters.heading_tolerance {
                violations.push(Violation::PoseOff {
                    module,
                    spot,
                    distance,
                    turn,
                });
            }
        }
        let filled = holders.keys().copied().collect();
        check_filled(self.planned.problem, &filled, &mut violations);
        self.check_links(&holders, &mut violations);
        self.check_bodies(&holders, now, parameters.silence, &mut violations);
        violations
    }

    /// No other module, member or not, of this session or another, stands on a spot on which a member has settled. A silent
    /// module stands where it was last seen, unless the roster says that its body was removed.
    /// Enforces V4.
    fn check_bodies(
        &self,
        holders: &BTreeMap<SpotId, ModuleId>,
        now: Duration,
        silence: Duration,
        violations: &mut Vec<Violation>,
    ) {
        let gone = self.gone(now, silence);
        let others = self.modules.iter();
        let mut bodies: Vec<(ModuleId, Pose)> = others
            .filter(|(module, _)| !self.settled.contains_key(module) && !gone.contains(module))
            .filter_map(|(&module, record)| Some((module, record.body()?.0.pose)))
            .collect();
        let other_sessions = self.other_sessions.iter();
        let other_sessions = other_sessions.filter(|&(module, &(incarnation, _))| {
            !self.modules.contains_key(module) && !self.is_removed(*module, incarnation)
        });
        bodies.extend(other_sessions.map(|(&module, &(_, pose))| (module, pose)));
        for (&spot, &first) in holders {
            let Some(place) = self.planned.problem.target().spot(spot) else {
                continue;
            };
            let on_it = bodies
                .iter()
                .filter(|(_, pose)| pose.distance_to(&place.pose) < ON_SPOT);
            violations.extend(on_it.map(|&(second, _)| Violation::TwoBodies {
                spot,
                first,
                second,
            }));
        }
    }

    /// The silent modules whose bodies need not stand where they were last seen.
    fn gone(&self, now: Duration, silence: Duration) -> BTreeSet<ModuleId> {
        let bodies = self.modules.values().filter_map(ModuleRecord::body);
        let gone = bodies
            .filter(|&(state, last)| is_silent(last, now, silence) && self.is_elsewhere(state));
        gone.map(|(state, _)| state.module).collect()
    }

    /// The modules whose heartbeats have ended, or never came, and of which the roster does not say that their bodies stand where they
    /// were last seen: later plans may have let them move on.
    pub(super) fn out_of_sight(&self, now: Duration, silence: Duration) -> BTreeSet<ModuleId> {
        let listed = &self.planned.roster.roster.bodies;
        let is_listed = |state: &ModuleState| {
            let body = listed.iter().find(|body| body.module == state.module);
            body.is_some_and(|body| *body.whereabouts.poses() == [state.pose])
        };
        let bodies = self.modules.values().filter_map(ModuleRecord::body);
        let unseen =
            bodies.filter(|&(state, last)| is_silent(last, now, silence) && !is_listed(state));
        unseen.map(|(state, _)| state.module).collect()
    }

    /// Whether the body of this run was removed, or the roster does not list it right where its latest state shows it: then it was on
    /// its way, or states of it did not arrive.
    /// Enforces V4.
    fn is_elsewhere(&self, latest: &ModuleState) -> bool {
        let (module, incarnation, pose) = (latest.module, latest.incarnation, latest.pose);
        let mut bodies = self.planned.roster.roster.bodies.iter();
        bodies.any(|body| {
            body.module == module
                && body.incarnation >= incarnation
                && *body.whereabouts.poses() != [pose]
        }) || self.is_removed(module, incarnation)
    }

    /// Whether the roster says that the body of this run was removed, or does not list it and an earlier one says so: members that
    /// restarted without a store never knew the body. Whether all agreed on the earlier one may not have arrived.
    fn is_removed(&self, module: ModuleId, incarnation: Incarnation) -> bool {
        let removes = |planned: PlannedEpoch<'_>| {
            let mut bodies = planned.roster.roster.bodies.iter();
            let listed = bodies.find(|body| body.module == module);
            listed.map(|body| {
                body.incarnation >= incarnation && body.whereabouts == Whereabouts::Removed
            })
        };
        removes(self.planned).unwrap_or_else(|| {
            let earlier = self.received.with_roster();
            let mut earlier = earlier.filter_map(|(epoch, record)| record.planned(epoch));
            earlier.any(|planned| removes(planned) == Some(true))
        })
    }

    /// The links of settled modules must be exactly the target's edges between filled spots, named by both ends.
    fn check_links(&self, holders: &BTreeMap<SpotId, ModuleId>, violations: &mut Vec<Violation>) {
        for (&spot, &module) in holders {
            let Some(state) = self.settled.get(&module) else {
                continue;
            };
            let wanted: BTreeSet<ModuleId> = self
                .planned
                .problem
                .target()
                .neighbours_of(spot)
                .filter_map(|spot| holders.get(&spot).copied())
                .collect();
            let lacking = wanted.difference(&state.links);
            violations.extend(lacking.map(|&other| Violation::LinkMissing { module, other }));
            let excess = state.links.difference(&wanted);
            violations.extend(excess.map(|&other| Violation::LinkTooMany { module, other }));
        }
        // A module without a spot can stay docked to others without one, but not to the formation.
        for (&module, state) in &self.states {
            if !self.settled.contains_key(&module) {
                let links = state.links.iter();
                let excess = links.filter(|&other| self.settled.contains_key(other));
                violations.extend(excess.map(|&other| Violation::LinkTooMany { module, other }));
            }
        }
    }
}

/// Whether the last heartbeat is older than `silence`, or none came.
fn is_silent(last: Option<Duration>, now: Duration, silence: Duration) -> bool {
    last.is_none_or(|last| now.saturating_sub(last) > silence)
}
