//! Agreeing on a finished plan and carrying it out: one unit after another, each only while all are known to agree.

mod steps;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use crate::model::{
    ActingUnit, CausalMark, Digest, Epoch, Incarnation, MicroUnits, ModuleId, ModulePhase,
    ModuleState, Plan, Roster, SpotId,
};

use super::io::MotionGoal;
use super::mutation::Mutation;
use super::peers::Peers;

/// What this module has to do in the acting phase, and how far it is.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Task {
    /// It has no spot.
    Spare,
    /// Its unit's turn has not come.
    Waiting,
    /// It lets go of links that the plan breaks.
    Undocking,
    /// It is on its way; `since` is when it set off, and `held` whether it was halted because agreement lapsed.
    Moving { since: Duration, held: bool },
    /// It stands on its spot and docks.
    Docking,
    /// It stands on its spot, docked.
    Settled,
    /// It could not reach its spot.
    GivenUp,
}

/// This module's place in the plan.
#[derive(Clone, Debug)]
struct Place {
    spot: SpotId,
    /// The position of its unit in the acting order.
    unit: usize,
}

/// The acting phase of one epoch.
#[derive(Clone)]
pub(in crate::protocol) struct Acting {
    module: ModuleId,
    epoch: Epoch,
    roster: Arc<Roster>,
    plan: Plan,
    digest: Digest,
    turns: u32,
    place: Option<Place>,
    task: Task,
    since: Duration,
    agreed_at: Option<Duration>,
    mismatch: bool,
    /// The incarnation that each member had in the roster.
    incarnations: BTreeMap<ModuleId, Incarnation>,
    asked_to_dock: BTreeSet<ModuleId>,
    waited_for: Vec<CausalMark>,
    agreed_on: Vec<CausalMark>,
    /// The sequence number of the first state that showed it settled; 0 before.
    settled_since: u64,
    told_waiting: Vec<ModuleId>,
    told_split: bool,
    /// Since when the unit that is to act now has been the one.
    unit_since: (usize, Duration),
}

impl Acting {
    pub fn new(
        module: ModuleId,
        roster: Arc<Roster>,
        plan: Plan,
        digest: Digest,
        turns: u32,
        now: Duration,
    ) -> Self {
        let place = plan
            .assembly
            .units
            .iter()
            .enumerate()
            .find_map(|(unit, acting)| {
                let placement = acting
                    .placements
                    .iter()
                    .find(|(holder, _)| *holder == module)?;
                Some(Place {
                    spot: placement.1,
                    unit,
                })
            });
        let incarnations = roster
            .members
            .iter()
            .map(|member| (member.module.id, member.incarnation))
            .collect();
        Self {
            module,
            epoch: roster.epoch,
            task: if place.is_some() {
                Task::Waiting
            } else {
                Task::Spare
            },
            place,
            roster,
            plan,
            digest,
            turns,
            since: now,
            agreed_at: None,
            mismatch: false,
            incarnations,
            asked_to_dock: BTreeSet::new(),
            waited_for: Vec::new(),
            agreed_on: Vec::new(),
            settled_since: 0,
            told_waiting: Vec::new(),
            told_split: false,
            unit_since: (0, now),
        }
    }

    pub fn roster(&self) -> &Arc<Roster> {
        &self.roster
    }

    /// Everything that changes while the plan is carried out.
    #[cfg(feature = "mutations")]
    pub fn progress(&self) -> impl std::fmt::Debug + '_ {
        (
            (&self.task, self.since, self.agreed_at, self.mismatch),
            (&self.asked_to_dock, &self.waited_for, &self.agreed_on),
            (self.settled_since, &self.told_waiting, self.told_split),
            self.unit_since,
        )
    }

    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    pub fn digest(&self) -> Digest {
        self.digest
    }

    pub fn turns(&self) -> u32 {
        self.turns
    }

    /// Whether some member showed another digest for this epoch.
    pub fn holds_mismatch(&self) -> bool {
        self.mismatch
    }

    pub fn phase(&self) -> ModulePhase {
        match self.task {
            _ if self.agreed_at.is_none() => ModulePhase::Agreeing,
            Task::Spare => ModulePhase::Spare,
            Task::Waiting => ModulePhase::Waiting,
            Task::Undocking | Task::Moving { .. } | Task::Docking | Task::GivenUp => {
                ModulePhase::Moving
            }
            Task::Settled => ModulePhase::Settled,
        }
    }

    pub fn arrived(&mut self) {
        if matches!(self.task, Task::Moving { .. }) {
            self.task = Task::Docking;
        }
    }

    /// Stops trying, if it had begun; returns the spot that it was to reach.
    pub fn give_up(&mut self) -> Option<SpotId> {
        if !matches!(
            self.task,
            Task::Undocking | Task::Moving { .. } | Task::Docking
        ) {
            return None;
        }
        self.task = Task::GivenUp;
        self.place.as_ref().map(|place| place.spot)
    }

    /// The spots that the plan leaves open.
    pub fn open_spots(&self) -> Vec<SpotId> {
        let filled: BTreeSet<SpotId> = self.plan.assignments.values().copied().collect();
        let target = self.roster.target.target.as_ref();
        target
            .into_iter()
            .flat_map(|target| target.spots())
            .map(|spot| spot.id)
            .filter(|spot| !filled.contains(spot))
            .collect()
    }

    /// Adds to a state what the plan says of this module.
    pub fn describe(&mut self, state: &mut ModuleState) {
        if let Some(place) = &self.place {
            state.spot = Some(place.spot);
            state.unit = Some(self.plan.assembly.units[place.unit].lead);
        }
        if self.task == Task::Settled && self.settled_since == 0 {
            self.settled_since = state.sequence;
        }
        state.settled_since = self.settled_since;
        if self.task != Task::Waiting {
            state.waited_for.clone_from(&self.waited_for);
            state.agreed_on.clone_from(&self.agreed_on);
        }
    }

    /// The members whose latest heartbeat does not show this plan, or is older than the lease.
    fn lagging(&self, peers: &Peers, now: Duration, lease: Duration) -> Vec<ModuleId> {
        self.incarnations
            .iter()
            .filter(|&(&module, _)| module != self.module)
            .filter(|&(&module, &incarnation)| {
                let Some(peer) = peers.get(module) else {
                    return true;
                };
                let same = peer.incarnation == incarnation
                    || peers.switch.is(Mutation::DropIncarnationCheck);
                let shows = same
                    && peer.heartbeat.is_some_and(|heartbeat| {
                        heartbeat.epoch == Some(self.epoch) && heartbeat.digest == Some(self.digest)
                    });
                !shows || peer.age(now).is_none_or(|age| age > lease)
            })
            .map(|(&module, _)| module)
            .collect()
    }

    /// A member that shows another digest for this epoch.
    fn dissenter(&self, peers: &Peers) -> Option<(ModuleId, Digest)> {
        self.incarnations.keys().find_map(|&module| {
            let heartbeat = peers.get(module)?.heartbeat?;
            let theirs = heartbeat.digest?;
            (heartbeat.epoch == Some(self.epoch) && theirs != self.digest)
                .then_some((module, theirs))
        })
    }

    /// The settled state of a member, if it has settled on its spot in this epoch.
    fn settled_state<'a>(&self, peers: &'a Peers, module: ModuleId) -> Option<&'a ModuleState> {
        let peer = peers.get(module)?;
        let state = peer.state.as_deref()?;
        let settled = state.epoch == Some(self.epoch)
            && state.digest == Some(self.digest)
            && state.phase == ModulePhase::Settled
            && self.incarnations.get(&module) == Some(&state.incarnation)
            && self.plan.assignments.get(&module).copied() == state.spot;
        settled.then_some(state)
    }

    fn is_settled(&self, peers: &Peers, module: ModuleId) -> bool {
        if module == self.module {
            self.task == Task::Settled
        } else {
            self.settled_state(peers, module).is_some()
        }
    }

    /// The modules of a unit that have not settled.
    fn unsettled_in(&self, unit: &ActingUnit, peers: &Peers) -> Vec<ModuleId> {
        unit.placements
            .iter()
            .map(|&(module, _)| module)
            .filter(|&module| !self.is_settled(peers, module))
            .collect()
    }

    /// The first unit that has not settled whole, with the modules that are missing.
    fn unit_to_act(&self, peers: &Peers) -> Option<(usize, Vec<ModuleId>)> {
        self.plan
            .assembly
            .units
            .iter()
            .enumerate()
            .map(|(index, unit)| (index, self.unsettled_in(unit, peers)))
            .find(|(_, unsettled)| !unsettled.is_empty())
    }

    fn mark_of(&self, peers: &Peers, module: ModuleId) -> Option<CausalMark> {
        let state = self.settled_state(peers, module)?;
        Some(CausalMark {
            module,
            sequence: state.sequence,
        })
    }

    /// The holders of spots beside this module's own, with their place in the order of filling.
    fn adjacent_holders(&self, place: &Place) -> Vec<(usize, ModuleId)> {
        let Some(target) = &self.roster.target.target else {
            return Vec::new();
        };
        let placements = self
            .plan
            .assembly
            .units
            .iter()
            .flat_map(|unit| &unit.placements);
        let adjacent: BTreeSet<SpotId> = target.neighbours_of(place.spot).collect();
        placements
            .enumerate()
            .filter(|(_, (_, spot))| adjacent.contains(spot))
            .map(|(order, &(module, _))| (order, module))
            .collect()
    }

    /// The adjacent holders that are placed before this module: those to which it docks.
    fn docks_with(&self, place: &Place) -> Vec<ModuleId> {
        let mut placements = self
            .plan
            .assembly
            .units
            .iter()
            .flat_map(|unit| &unit.placements);
        let own = placements.position(|&(module, _)| module == self.module);
        self.adjacent_holders(place)
            .into_iter()
            .filter(|&(order, _)| own.is_some_and(|own| order < own))
            .map(|(_, module)| module)
            .collect()
    }

    fn keeps_link_to(&self, other: ModuleId) -> bool {
        let pair = (self.module.min(other), self.module.max(other));
        self.plan.kept_links.contains(&pair)
    }

    /// Whether the plan wants the two modules docked in the end.
    fn wants_link_to(&self, other: ModuleId) -> bool {
        self.keeps_link_to(other)
            || self.place.as_ref().is_some_and(|place| {
                self.adjacent_holders(place)
                    .iter()
                    .any(|&(_, holder)| holder == other)
            })
    }

    /// The longest way in the unit, from the poses in the roster.
    fn unit_distance(&self, unit: &ActingUnit) -> MicroUnits {
        let Some(target) = &self.roster.target.target else {
            return MicroUnits::ZERO;
        };
        let way = |&(module, spot): &(ModuleId, SpotId)| {
            let member = self
                .roster
                .members
                .iter()
                .find(|member| member.module.id == module)?;
            Some(member.module.pose.distance_to(&target.spot(spot)?.pose))
        };
        unit.placements
            .iter()
            .filter_map(way)
            .max()
            .unwrap_or_default()
    }

    fn goal(&self) -> Option<MotionGoal> {
        let place = self.place.as_ref()?;
        let spot = self.roster.target.target.as_ref()?.spot(place.spot)?;
        Some(MotionGoal {
            pose: spot.pose,
            unit_distance: self.unit_distance(&self.plan.assembly.units[place.unit]),
        })
    }

    /// Notes what is waited for when this module sets off, so that observers can judge the order without clocks.
    ///
    /// The lead of a unit names every module of the unit before; the others name the holders beside their own spot.
    /// The lead of the first unit to move names the heartbeat of every member that showed agreement.
    fn note_causes(&mut self, place: &Place, peers: &Peers, own_heartbeat: u64) {
        let unit = &self.plan.assembly.units[place.unit];
        let mut causes: BTreeSet<ModuleId> = self.docks_with(place).into_iter().collect();
        let own_unit: BTreeSet<ModuleId> =
            unit.placements.iter().map(|&(module, _)| module).collect();
        causes.retain(|module| !own_unit.contains(module));
        let leads = unit.lead == self.module;
        if leads && let Some(before) = place.unit.checked_sub(1) {
            let before = &self.plan.assembly.units[before];
            causes.extend(before.placements.iter().map(|&(module, _)| module));
        }
        self.waited_for = causes
            .into_iter()
            .filter_map(|module| self.mark_of(peers, module))
            .collect();
        let first = self.plan.assembly.units[..place.unit]
            .iter()
            .all(|unit| unit.pinned);
        if leads && first {
            self.agreed_on = self
                .incarnations
                .keys()
                .filter_map(|&module| {
                    let sequence = if module == self.module {
                        own_heartbeat
                    } else {
                        peers.get(module)?.heartbeat?.sequence
                    };
                    Some(CausalMark { module, sequence })
                })
                .collect();
        }
    }
}
