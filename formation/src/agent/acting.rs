//! Agreeing on a finished plan and carrying it out: one unit after another, each only while all are known to agree.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use crate::digest;
use crate::fixed::MicroUnits;
use crate::id::{Digest, Epoch, Incarnation, ModuleId, SpotId};
use crate::message::{CausalMark, ModulePhase, ModuleState, Roster, Service};
use crate::plan::{ActingUnit, Plan};

use super::io::{Event, MotionGoal, Output};
use super::mutation::Mutation;
use super::peers::Peers;
use super::{Agent, SettledOn, Stage};

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
pub(super) struct Acting {
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

impl Agent {
    /// The members that keep the epoch from going on: taken for dead, they are left out of the next one.
    pub(super) fn stuck_modules(&self) -> Vec<ModuleId> {
        let limit = self.parameters.stuck;
        match &self.stage {
            Stage::Planning(turns) => turns.stuck_claimant(self.now, limit).into_iter().collect(),
            Stage::Acting(acting) if acting.agreed_at.is_none() => {
                if acting.mismatch || self.now.saturating_sub(acting.since) <= limit {
                    return Vec::new();
                }
                acting.lagging(&self.peers, self.now, self.parameters.suspicion)
            }
            Stage::Acting(acting) => {
                let (unit, since) = acting.unit_since;
                let limit = self.parameters.motion_limit + limit;
                let overdue = self.now.saturating_sub(since) > limit;
                match acting.plan.assembly.units.get(unit) {
                    Some(unit) if overdue => acting.unsettled_in(unit, &self.peers),
                    _ => Vec::new(),
                }
            }
            _ => Vec::new(),
        }
    }

    /// Follows what another module says of its links: it docked to this one, or let go of it.
    pub(super) fn adjust_links_to(&mut self, other: ModuleId) {
        let (Stage::Acting(acting), Some(state)) = (
            &self.stage,
            self.peers.get(other).and_then(|peer| peer.state.as_deref()),
        ) else {
            return;
        };
        if state.epoch != self.epoch {
            return;
        }
        let names_us = state.links.contains(&self.module);
        let linked = self.body.links.contains(&other);
        let wanted = acting.wants_link_to(other);
        let acts = matches!(state.phase, ModulePhase::Moving | ModulePhase::Settled);
        if acts && linked && !names_us && !wanted {
            self.body.links.remove(&other);
            self.voice.state_changed = true;
        } else if state.phase == ModulePhase::Settled
            && !linked
            && names_us
            && wanted
            && acting.task == Task::Settled
        {
            self.body.links.insert(other);
            self.voice.state_changed = true;
        }
    }

    /// Sends the drive its goal again: it stops when goals cease to repeat.
    pub(super) fn repeat_goal(&mut self) {
        if let Stage::Acting(acting) = &self.stage
            && matches!(acting.task, Task::Moving { held: false, .. })
            && (self.switch.is(Mutation::IgnoreLapse)
                || acting
                    .lagging(&self.peers, self.now, self.parameters.lease)
                    .is_empty())
            && let Some(goal) = acting.goal()
        {
            self.outputs.push_back(Output::Move(goal));
        }
    }

    /// Agrees, waits, moves and docks, as far as is safe now.
    pub(super) fn advance_acting(&mut self) {
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let lease = self.parameters.lease;
        if let Some((module, theirs)) = acting.dissenter(&self.peers)
            && !acting.mismatch
        {
            acting.mismatch = true;
            self.convening.mismatches += 1;
            let ours = acting.digest;
            self.emit(Event::DigestMismatch {
                module,
                theirs,
                ours,
            });
            return;
        }
        let mut lagging = acting.lagging(&self.peers, self.now, lease);
        if self.switch.is(Mutation::SkipDigestBarrier) {
            lagging.clear();
        }
        if acting.agreed_at.is_none() {
            if !lagging.is_empty() {
                self.tell_split();
                let Stage::Acting(acting) = &mut self.stage else {
                    return;
                };
                if acting.told_waiting != lagging && self.now > acting.since + lease {
                    acting.told_waiting.clone_from(&lagging);
                    self.emit(Event::WaitingForAgreement(lagging));
                }
                return;
            }
            self.note_agreement();
        }
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let Some(agreed_at) = acting.agreed_at else {
            return;
        };
        // Whoever the roster left out stops within the lease, since members no longer show its epoch.
        let wait = if self.switch.is(Mutation::SkipLeaseWait) {
            Duration::ZERO
        } else {
            lease
        };
        let first_motion = agreed_at + wait;
        if self.now < first_motion {
            self.wake_at(first_motion);
            return;
        }
        self.carry_on(&lagging);
    }

    /// Says who holds which plan, when another epoch has not helped and nothing more will be tried.
    fn tell_split(&mut self) {
        let lasts = self.convening.mismatches > 1;
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let told_at = acting.since + self.parameters.lease;
        if !lasts || !acting.mismatch || acting.told_split {
            return;
        }
        if self.now < told_at {
            self.wake_at(told_at);
            return;
        }
        acting.told_split = true;
        let mut sides: BTreeMap<Digest, Vec<ModuleId>> = BTreeMap::new();
        for &module in acting.incarnations.keys() {
            let shown = if module == acting.module {
                Some((Some(acting.epoch), Some(acting.digest)))
            } else {
                let heartbeat = self.peers.get(module).and_then(|peer| peer.heartbeat);
                heartbeat.map(|heartbeat| (heartbeat.epoch, heartbeat.digest))
            };
            if let Some((Some(epoch), Some(digest))) = shown
                && epoch == acting.epoch
            {
                sides.entry(digest).or_default().push(module);
            }
        }
        self.emit(Event::PlansDiffer(sides.into_iter().collect()));
    }

    fn note_agreement(&mut self) {
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        acting.agreed_at = Some(self.now);
        acting.told_waiting.clear();
        let epoch = acting.epoch;
        let basis = acting.roster.quorum_basis();
        let spare = acting.task == Task::Spare;
        let open = acting.open_spots();
        self.quorum.note_agreed(epoch, &basis);
        self.convening.relax(self.parameters.epoch_interval);
        self.convening.mismatches = 0;
        self.voice.state_changed = true;
        self.emit(Event::Agreed(epoch));
        if spare {
            self.emit(Event::Spare);
        }
        if epoch.convener == self.module && !open.is_empty() {
            self.emit(Event::SpotsLeftOpen(open));
        }
    }

    /// One step of this module's task; `lagging` members forbid every motion.
    fn carry_on(&mut self, lagging: &[ModuleId]) {
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let to_act = acting.unit_to_act(&self.peers);
        let index = to_act.as_ref().map_or(usize::MAX, |(index, _)| *index);
        if acting.unit_since.0 != index || !lagging.is_empty() {
            acting.unit_since = (index, self.now);
        }
        let Some(place) = acting.place.clone() else {
            if lagging.is_empty() {
                self.let_go();
            }
            return;
        };
        if self.service != Service::Active {
            return;
        }
        match acting.task.clone() {
            Task::Waiting => {
                if acting.plan.assembly.units[place.unit].pinned {
                    self.stay(lagging);
                    return;
                }
                match to_act {
                    Some((unit, missing))
                        if unit < place.unit && !self.switch.is(Mutation::MoveOutOfOrder) =>
                    {
                        let told = acting.told_waiting == missing;
                        acting.told_waiting.clone_from(&missing);
                        if !told {
                            self.emit(Event::WaitingFor(missing));
                        }
                    }
                    _ if lagging.is_empty() && !self.parameters.plan_only => self.set_off(&place),
                    _ => {}
                }
            }
            Task::Undocking => {
                let done = self
                    .body
                    .links
                    .iter()
                    .all(|&link| acting.keeps_link_to(link));
                if done && lagging.is_empty() {
                    acting.task = Task::Moving {
                        since: self.now,
                        held: false,
                    };
                    if let Some(goal) = acting.goal() {
                        self.body.moving = true;
                        self.outputs.push_back(Output::Move(goal));
                    }
                }
            }
            Task::Moving { since, held } => self.watch_motion(&place, since, held, lagging),
            Task::Docking => self.dock(&place),
            Task::Spare | Task::Settled | Task::GivenUp => {}
        }
    }

    /// Stays on its spot, and lets go of whatever the target does not want there, such as a dead neighbour.
    fn stay(&mut self, lagging: &[ModuleId]) {
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let unwanted: Vec<ModuleId> = self
            .body
            .links
            .iter()
            .copied()
            .filter(|&link| !acting.wants_link_to(link))
            .collect();
        if unwanted.is_empty() {
            acting.task = Task::Settled;
            self.voice.state_changed = true;
        } else if lagging.is_empty() {
            for link in unwanted {
                if self.body.ports_busy.insert(link) {
                    self.outputs.push_back(Output::Undock(link));
                }
            }
        }
    }

    fn set_off(&mut self, place: &Place) {
        let own_heartbeat = self.voice.heartbeat_sequence;
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        acting.note_causes(place, &self.peers, own_heartbeat);
        acting.task = Task::Undocking;
        self.body.settled_on = None;
        let broken: Vec<ModuleId> = self
            .body
            .links
            .iter()
            .copied()
            .filter(|&link| !acting.keeps_link_to(link))
            .collect();
        self.voice.state_changed = true;
        self.emit(Event::MotionBegun(place.spot));
        for link in broken {
            self.body.ports_busy.insert(link);
            self.outputs.push_back(Output::Undock(link));
        }
        self.advance_acting();
    }

    fn watch_motion(&mut self, place: &Place, since: Duration, held: bool, lagging: &[ModuleId]) {
        let overdue_at = since + self.parameters.motion_limit;
        if self.now >= overdue_at {
            self.stand_still();
            self.emit(Event::MotionOverdue(place.spot));
            self.fail_motion();
            return;
        }
        self.wake_at(overdue_at);
        let hold = !lagging.is_empty() && !self.switch.is(Mutation::IgnoreLapse);
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let goal = acting.goal();
        acting.task = Task::Moving { since, held: hold };
        if hold && !held {
            self.stand_still();
            self.emit(Event::AgreementLapsed(lagging.to_vec()));
        } else if !hold
            && !self.body.moving
            && let Some(goal) = goal
        {
            // The drive halted, because agreement lapsed or because it was not told for too long.
            self.body.moving = true;
            self.outputs.push_back(Output::Move(goal));
        } else if hold && let Some(oldest) = self.next_lapse() {
            self.wake_at(oldest);
        }
        if !hold && let Some(lapse) = self.next_lapse() {
            self.wake_at(lapse);
        }
    }

    /// When the oldest heartbeat of a member passes the lease, unless a newer one comes.
    fn next_lapse(&self) -> Option<Duration> {
        let Stage::Acting(acting) = &self.stage else {
            return None;
        };
        let margin = Duration::from_millis(1);
        acting
            .incarnations
            .keys()
            .filter_map(|&module| self.peers.get(module)?.age(self.now))
            .map(|age| self.now + self.parameters.lease.saturating_sub(age) + margin)
            .min()
    }

    fn dock(&mut self, place: &Place) {
        let Stage::Acting(acting) = &mut self.stage else {
            return;
        };
        let wanted = acting.docks_with(place);
        let missing: Vec<ModuleId> = wanted
            .into_iter()
            .filter(|module| !self.body.links.contains(module))
            .collect();
        if missing.is_empty() {
            acting.task = Task::Settled;
            let target = digest::of_target(&acting.roster.target);
            self.body.settled_on = Some(SettledOn {
                spot: place.spot,
                target,
            });
            self.voice.state_changed = true;
            self.emit(Event::Settled(place.spot));
            return;
        }
        let ready: Vec<ModuleId> = missing
            .into_iter()
            .filter(|&module| acting.is_settled(&self.peers, module))
            .filter(|module| !acting.asked_to_dock.contains(module))
            .collect();
        for module in ready {
            acting.asked_to_dock.insert(module);
            self.body.ports_busy.insert(module);
            self.outputs.push_back(Output::Dock(module));
        }
    }
}
