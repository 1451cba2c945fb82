//! Judges the end state: which module stands where, docked to which others.

use std::collections::{BTreeMap, BTreeSet};

use super::claims::{Claimed, replay_claims};
use super::record::{ModuleRecord, PlannedEpoch};
use super::{Observer, ObserverParameters};
use crate::model::{Digest, MicroUnits, ModuleId, ModulePhase, ModuleState, Pose, SpotId};
use crate::verify::plan::check_filled;
use crate::verify::{Missing, Violation};

/// A full turn in micro-radians.
const FULL_TURN: i64 = 6_283_185;

/// The newest epoch's members as they are now.
pub(super) struct EndState<'a> {
    planned: PlannedEpoch<'a>,
    pub(super) claimed: Claimed,
    /// The latest state of each member's run.
    states: BTreeMap<ModuleId, &'a ModuleState>,
    /// The members that have settled in this epoch.
    settled: BTreeMap<ModuleId, &'a ModuleState>,
    /// The members that have not shown the plan that most have shown.
    disagreeing: BTreeSet<ModuleId>,
    /// How many turns led to the plan that most have shown.
    turns: Option<u32>,
}

impl<'a> EndState<'a> {
    pub(super) fn new(observer: &'a Observer, planned: PlannedEpoch<'a>) -> Self {
        let members = planned.members().iter();
        let states: BTreeMap<ModuleId, &ModuleState> = members
            .filter_map(|member| {
                let module: &ModuleRecord = observer.modules.get(&member.module.id)?;
                let state = module.state_of(member.incarnation)?;
                Some((member.module.id, &**state))
            })
            .collect();
        let epoch = Some(planned.epoch);
        let settled = states
            .iter()
            .filter(|(_, state)| state.epoch == epoch && state.phase == ModulePhase::Settled)
            .map(|(&module, &state)| (module, state))
            .collect();
        let (disagreeing, turns) = disagreement(planned);
        Self {
            planned,
            claimed: replay_claims(planned),
            states,
            settled,
            disagreeing,
            turns,
        }
    }

    /// Which members have settled on which spot, by their own report.
    pub(super) fn assignments(&self) -> BTreeMap<ModuleId, SpotId> {
        self.settled
            .iter()
            .filter_map(|(&module, state)| Some((module, state.spot?)))
            .collect()
    }

    /// How many members have shown the plan.
    pub(super) fn agreed(&self) -> usize {
        self.planned.members().len() - self.disagreeing.len()
    }

    /// Whether every turn's claim arrived.
    pub(super) fn claims_are_whole(&self) -> bool {
        self.turns.is_some_and(|turns| turns <= self.claimed.turns)
    }

    pub(super) fn is_agreed(&self) -> bool {
        self.disagreeing.is_empty()
    }

    /// What is still to come; nothing when the end state is reached.
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

    /// What is wrong with the end state, once it is reached.
    pub(super) fn violations(&self, parameters: &ObserverParameters) -> Vec<Violation> {
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
            let turn = turn_between(&state.pose, &place.pose);
            if distance > parameters.position_tolerance || turn > parameters.heading_tolerance {
                violations.push(Violation::PoseOff {
                    module,
                    spot,
                    distance,
                    turn,
                });
            }
        }
        check_filled(
            self.planned.problem,
            &holders.keys().copied().collect(),
            &mut violations,
        );
        self.check_links(&holders, &mut violations);
        violations
    }

    /// The links of settled modules must be the target's edges among filled spots, named by both ends, and no others.
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
            violations.extend(
                wanted
                    .difference(&state.links)
                    .map(|&other| Violation::LinkMissing { module, other }),
            );
            violations.extend(
                state
                    .links
                    .difference(&wanted)
                    .map(|&other| Violation::LinkTooMany { module, other }),
            );
        }
        // A module without a spot may stay docked to others without one, never to the formation.
        for (&module, state) in &self.states {
            if !self.settled.contains_key(&module) {
                violations.extend(
                    state
                        .links
                        .iter()
                        .filter(|other| self.settled.contains_key(other))
                        .map(|&other| Violation::LinkTooMany { module, other }),
                );
            }
        }
    }
}

/// The members that have not shown the plan that most members have shown, and the number of its turns.
fn disagreement(planned: PlannedEpoch<'_>) -> (BTreeSet<ModuleId>, Option<u32>) {
    let mut shown: BTreeMap<Digest, BTreeMap<ModuleId, u32>> = BTreeMap::new();
    let members = planned.members();
    for member in members {
        let run = (member.module.id, member.incarnation);
        for (&digest, plan) in planned.record.shown.get(&run).into_iter().flatten() {
            shown
                .entry(digest)
                .or_default()
                .insert(member.module.id, plan.turns);
        }
    }
    let common = shown.into_values().max_by_key(BTreeMap::len);
    let agreeing = common.unwrap_or_default();
    let disagreeing = members
        .iter()
        .map(|member| member.module.id)
        .filter(|module| !agreeing.contains_key(module))
        .collect();
    (disagreeing, agreeing.into_values().max())
}

/// The angle between two headings, at most half a turn.
fn turn_between(one: &Pose, other: &Pose) -> MicroUnits {
    let turn = (one.theta.0 - other.theta.0).rem_euclid(FULL_TURN);
    MicroUnits(turn.min(FULL_TURN - turn))
}
