//! A complete plan, this module's place in it, and what the heartbeats and states of others mean for it.

use std::collections::{BTreeMap, BTreeSet};
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    ActingUnit, CausalMark, ClosedRoster, Digest, Epoch, Heartbeat, Incarnation, ModuleId,
    ModulePhase, ModuleState, Plan, Polyline, Pose, Service, SpotId, Whereabouts,
};

use formation_motion::paths::MotionError;

use super::super::context::Context;
use super::super::event::Event;
use super::super::peer::Peer;
use super::super::peers::{Peers, ShownChanges};
use super::super::plans::ComputedPlan;
use super::super::roster_plan::{Place, RosterPlan};
use super::route::HeldMotion;
use crate::indexed_motion::PathPlace;

/// A complete plan and this module's place in it.
#[derive(Clone)]
pub(crate) struct HeldPlan {
    own: ModuleId,
    pub roster: Arc<ClosedRoster>,
    /// When this module received the roster. All members had frozen by then.
    pub closed_at: Duration,
    pub plan: Arc<Plan>,
    /// How the modules move.
    pub(super) motion: HeldMotion,
    pub digest: Digest,
    /// The number of turns of the plan.
    pub turns: u32,
    pub(super) place: Option<Place>,
    /// What all members have in common.
    pub(super) roster_plan: Arc<RosterPlan>,
    /// Whether some member showed another digest for this epoch.
    pub has_mismatch: bool,
    /// What heartbeats had shown when they were last compared with the digest.
    compared: Option<ShownChanges>,
    /// A member of which an agreement was missing. While it is, the others need not be looked at.
    pub(super) waits_for: Option<ModuleId>,
    in_force: Option<InForce>,
    /// Whether every member has done its part; once it is so, it stays so.
    pub(super) is_carried_out: bool,
    /// A member that has not done its part. Until it has, the others need not be looked at.
    pub(super) unsettled: Option<ModuleId>,
}

/// No member lagged. While all show the same, that holds until the oldest heartbeat exceeds the lease, so the members need not be
/// looked at whenever a message comes.
#[derive(Clone, Copy)]
struct InForce {
    version: (u64, ShownChanges),
    until: Duration,
}

impl Hash for HeldPlan {
    /// The digest identifies the roster and the plan.
    fn hash<H: Hasher>(&self, state: &mut H) {
        (self.digest, self.has_mismatch, self.is_carried_out).hash(state);
    }
}

impl HeldPlan {
    pub fn new(
        own: ModuleId,
        roster: Arc<ClosedRoster>,
        computed: &ComputedPlan,
        roster_plan: Arc<RosterPlan>,
        digest: Digest,
        turns: u32,
    ) -> Self {
        let plan = Arc::clone(computed.plan());
        let place = roster_plan.places.get(&own).copied();
        debug_assert!(
            roster_plan.members.contains_key(&own),
            "{own} plans as a member only"
        );
        debug_assert_eq!(
            place.is_some(),
            plan.assignments.contains_key(&own),
            "each assigned module acts in one unit"
        );
        Self {
            own,
            place,
            motion: HeldMotion::of(own, computed.motion()),
            digest,
            roster_plan,
            roster,
            closed_at: Duration::ZERO,
            plan,
            turns,
            has_mismatch: false,
            compared: None,
            waits_for: None,
            in_force: None,
            is_carried_out: false,
            unsettled: None,
        }
    }

    pub(super) fn epoch(&self) -> Epoch {
        self.roster.epoch
    }

    /// Adds to a state the spot and the unit of this module.
    pub(super) fn describe(&self, state: &mut ModuleState) {
        if let Some(place) = self.place {
            state.spot = Some(place.spot);
            state.unit = Some(self.unit_of(place).lead);
        }
    }

    pub(super) fn unit_of(&self, place: Place) -> &ActingUnit {
        &self.plan.assembly.units[place.unit]
    }

    /// Reports the spots that the plan leaves open, and why.
    /// Enforces B4.
    pub(super) fn report_open_spots(&self, context: &mut Context) {
        let filled: BTreeSet<SpotId> = self.plan.assignments.values().copied().collect();
        let open = self.roster.open_target();
        let blocked = self.roster.blocked_spots();
        let is_blocked = |spot: SpotId| blocked.iter().any(|blocked| blocked.spot == spot);
        let is_reachable = |spot: SpotId| {
            open.as_ref()
                .is_some_and(|open| open.position_of(spot).is_some())
        };
        let target = self.roster.target.target.iter();
        let empty = target
            .flat_map(|target| target.spots())
            .map(|spot| spot.id)
            .filter(|spot| !filled.contains(spot));
        let (left, others): (Vec<SpotId>, Vec<SpotId>) =
            empty.partition(|&spot| is_reachable(spot));
        let cut_off: Vec<SpotId> = others
            .into_iter()
            .filter(|&spot| !is_blocked(spot))
            .collect();
        context.report_blocked(blocked);
        if !cut_off.is_empty() {
            context.emit(Event::SpotsCutOff(cut_off));
        }
        if !left.is_empty() {
            context.emit(Event::SpotsLeftOpen(left));
        }
    }

    /// Why no module moves by this plan, if so.
    pub(crate) fn refusal(&self) -> Option<&MotionError> {
        self.motion.paths.planned().refusal()
    }

    /// The service of this module when the roster was made.
    pub(super) fn listed_service(&self) -> Service {
        let member = self.roster.member(self.own);
        member.map_or(Service::Active, |member| member.service)
    }

    /// The retired members that stand on spots, and make way for those that take these.
    pub(super) fn making_room(&self) -> Vec<ModuleId> {
        let problem = self.roster.problem().ok().flatten();
        let problem = problem.iter();
        let making_room = problem.flat_map(|problem| problem.making_room());
        making_room.map(|module| module.id).collect()
    }

    /// The unit of each module in the paths, and the module's own path; empty if no module moves.
    pub(crate) fn places(&self) -> BTreeMap<ModuleId, PathPlace<'_>> {
        self.motion.paths.places()
    }

    /// Where another member, with its path if it has one, may be that was last `seen` there.
    /// Enforces B2.
    pub(crate) fn whereabouts(
        &self,
        (module, place): (ModuleId, Option<PathPlace<'_>>),
        seen: Pose,
        peer: Option<&Peer>,
    ) -> Whereabouts {
        let Some((unit, member)) = place else {
            return Whereabouts::Halted(seen);
        };
        let done = self.steps_done_by(module, peer) as usize;
        let mut rest = unit.poses_after(done, member).peekable();
        if done == unit.steps.len() {
            // What was seen may be older than what was done.
            return Whereabouts::Halted(rest.peek().copied().unwrap_or(seen));
        }
        let path = Polyline::through(std::iter::once(seen).chain(rest));
        debug_assert!(path.is_ok(), "a plan with more corners is not used");
        let on_the_way = match unit.is_in_block_after(done) {
            true => Whereabouts::InBlock,
            false => Whereabouts::OnTheWay,
        };
        path.map_or(Whereabouts::Seen(seen), on_the_way)
    }

    /// Whether the state of another member shows that it has done its part of this plan.
    pub(super) fn has_acted(&self, module: ModuleId, peer: Option<&Peer>) -> bool {
        if self.plan.assignments.contains_key(&module) {
            return self.settled_state(module, peer).is_some();
        }
        let state = peer.and_then(|peer| peer.state.as_ref());
        state.is_some_and(|state| {
            state.epoch == Some(self.epoch())
                && state.digest == Some(self.digest)
                && state.phase == ModulePhase::Spare
                && self.roster_plan.members.get(&module) == Some(&state.incarnation)
        })
    }

    /// Whether the plan gives a spot to a module that has not settled on it.
    pub(crate) fn is_to_fill(&self, spot: SpotId, context: &Context) -> bool {
        let mut holders = self.plan.assignments.iter();
        let holder = holders
            .find(|&(_, &one)| one == spot)
            .map(|(&holder, _)| holder);
        holder.is_some_and(|holder| {
            let has_settled = if holder == self.own {
                context
                    .robot
                    .settled_on
                    .is_some_and(|settled| settled.spot == spot)
            } else {
                self.settled_state(holder, context.peers.get(holder))
                    .is_some()
            };
            let place = self.roster_plan.places.get(&holder);
            !has_settled && place.is_some_and(|&place| !self.unit_of(place).pinned)
        })
    }

    /// The members that do not agree: those that are silent, and those whose latest heartbeat does not show this plan.
    pub(super) fn not_agreeing(&self, context: &Context) -> Vec<ModuleId> {
        let suspicion = context.parameters.suspicion;
        self.members_that(context, |_, incarnation, peer| {
            !self.is_shown_by(incarnation, peer, context, suspicion)
        })
    }

    /// The other members, in ascending order.
    pub(super) fn others(&self) -> Vec<ModuleId> {
        let members = self.roster_plan.members.keys().copied();
        members.filter(|&module| module != self.own).collect()
    }

    /// The members with their runs in the roster, in ascending order.
    fn runs(&self) -> impl Iterator<Item = (ModuleId, Incarnation)> {
        let members = self.roster_plan.members.iter();
        members.map(|(&module, &incarnation)| (module, incarnation))
    }

    /// The other members for which this holds, with the runs in the roster and what is known of them.
    fn members_that(
        &self,
        context: &Context,
        holds: impl Fn(ModuleId, Incarnation, Option<&Peer>) -> bool,
    ) -> Vec<ModuleId> {
        let members = context.peers.along(self.runs());
        members
            .filter(|&(module, incarnation, peer)| {
                module != self.own && holds(module, incarnation, peer)
            })
            .map(|(module, ..)| module)
            .collect()
    }

    /// Whether a member's latest heartbeat shows this plan and is not older than `limit`.
    fn is_shown_by(
        &self,
        incarnation: Incarnation,
        peer: Option<&Peer>,
        context: &Context,
        limit: Duration,
    ) -> bool {
        peer.is_some_and(|peer| {
            let is_member = peer.incarnation == incarnation;
            let shows = peer.heartbeat.as_ref().is_some_and(|heartbeat| {
                heartbeat.epoch == Some(self.epoch()) && heartbeat.digest == Some(self.digest)
            });
            is_member && shows && peer.age(context.now).is_some_and(|age| age <= limit)
        })
    }

    /// Whether [`Self::waits_for`] is among [`Self::lagging`].
    pub(super) fn still_lags(&self, context: &Context) -> bool {
        debug_assert!(
            self.waits_for
                .is_none_or(|module| self.roster_plan.members.contains_key(&module)),
            "only members are waited for"
        );
        let lags = |module: ModuleId| {
            let incarnation = *self.roster_plan.members.get(&module)?;
            let (peer, lease) = (context.peers.get(module), context.parameters.lease);
            Some(!self.is_shown_by(incarnation, peer, context, lease))
        };
        self.waits_for.and_then(lags).unwrap_or(false)
    }

    /// The members that forbid every motion: those whose latest heartbeat does not show this plan or exceeds the lease, and those
    /// whose motion failed since the roster was made, which stand in the way of the plan.
    /// Enforces A3.
    pub(super) fn lagging(&self, context: &Context) -> Vec<ModuleId> {
        let lease = context.parameters.lease;
        self.members_that(context, |module, incarnation, peer| {
            !self.is_shown_by(incarnation, peer, context, lease) || self.has_failed(module, peer)
        })
    }

    /// The same as [`Self::lagging`], found again only when it may have changed.
    /// Enforces A1.
    pub(super) fn lagging_now(&mut self, context: &Context) -> Vec<ModuleId> {
        let version = context.peers.version();
        let holds = |known: &InForce| known.version == version && context.now <= known.until;
        if self.in_force.as_ref().is_some_and(holds) {
            debug_assert!(
                self.lagging(context).is_empty(),
                "what members show has a version"
            );
            return Vec::new();
        }
        let lagging = self.lagging(context);
        self.in_force = lagging.is_empty().then(|| InForce {
            version,
            until: self.end_of_lease(context),
        });
        lagging
    }

    /// Until when no member was lagging as [`Self::lagging_now`] found it, even if no further heartbeat comes.
    pub(super) fn in_force_until(&self) -> Option<Duration> {
        Some(self.in_force.as_ref()?.until)
    }

    /// When the oldest of the members' latest heartbeats exceeds the lease.
    fn end_of_lease(&self, context: &Context) -> Duration {
        let members = context.peers.along(self.runs());
        let others = members.filter(|&(module, ..)| module != self.own);
        let oldest = others
            .filter_map(|(.., peer)| peer?.age(context.now))
            .max()
            .unwrap_or_default();
        context.now + context.parameters.lease.saturating_sub(oldest)
    }

    /// Whether the motion of a member failed since the roster was made.
    fn has_failed(&self, module: ModuleId, peer: Option<&Peer>) -> bool {
        let state = peer.and_then(|peer| peer.state.as_ref());
        let fails = |service| service == Service::MotionFailed;
        state.is_some_and(|state| fails(state.service))
            && !self
                .roster
                .member(module)
                .is_some_and(|member| fails(member.service))
    }

    /// Reports the first member that shows another digest for this epoch; returns whether it did.
    /// Enforces A6.
    pub(super) fn note_mismatch(&mut self, context: &mut Context) -> bool {
        if self.has_mismatch {
            return false;
        }
        let shown = context.peers.shown();
        let compared = self.compared.replace(shown);
        if compared == Some(shown) {
            return false;
        }
        let other_digest = |module: ModuleId, heartbeat: Option<&Heartbeat>| {
            let heartbeat = heartbeat?;
            let theirs = heartbeat.digest?;
            (heartbeat.epoch == Some(self.epoch()) && theirs != self.digest)
                .then_some((module, theirs))
        };
        let mismatch = match compared.and_then(|compared| shown.only_since(compared)) {
            Some(module) => (self.roster_plan.members.contains_key(&module))
                .then(|| other_digest(module, context.peers.heartbeat(module)))
                .flatten(),
            None => (context.peers.along(self.runs()))
                .find_map(|(module, _, peer)| other_digest(module, peer?.heartbeat.as_ref())),
        };
        let Some((module, theirs)) = mismatch else {
            return false;
        };
        self.has_mismatch = true;
        context.session.mismatches += 1;
        context.emit(Event::DigestMismatch {
            module,
            theirs,
            ours: self.digest,
        });
        true
    }

    /// The digests that members show for this epoch, each with its members.
    pub(super) fn sides(&self, context: &Context) -> BTreeMap<Digest, Vec<ModuleId>> {
        let mut sides: BTreeMap<Digest, Vec<ModuleId>> = BTreeMap::new();
        for &module in self.roster_plan.members.keys() {
            let shown = if module == self.own {
                Some(self.digest)
            } else {
                let heartbeat = context.peers.heartbeat(module);
                heartbeat
                    .filter(|heartbeat| heartbeat.epoch == Some(self.epoch()))
                    .and_then(|heartbeat| heartbeat.digest)
            };
            if let Some(digest) = shown {
                sides.entry(digest).or_default().push(module);
            }
        }
        sides
    }

    /// The state of another member, if it shows that the member has settled on its spot in this epoch.
    pub(super) fn settled_state<'a>(
        &self,
        module: ModuleId,
        peer: Option<&'a Peer>,
    ) -> Option<&'a ModuleState> {
        let state = peer?.state.as_ref()?;
        let is_settled = state.epoch == Some(self.epoch())
            && state.digest == Some(self.digest)
            && state.phase == ModulePhase::Settled
            && self.roster_plan.members.get(&module) == Some(&state.incarnation)
            && self.plan.assignments.get(&module).copied() == state.spot;
        is_settled.then_some(state)
    }

    /// The mark of another member's settled state.
    pub(super) fn settled_mark(&self, peers: &Peers, module: ModuleId) -> Option<CausalMark> {
        let state = self.settled_state(module, peers.get(module))?;
        Some(CausalMark {
            module,
            sequence: state.sequence,
        })
    }

    /// The number of steps that another member is known to have done in this epoch.
    /// Enforces X9.
    pub(super) fn steps_done_by(&self, module: ModuleId, peer: Option<&Peer>) -> u32 {
        let incarnation = self.roster_plan.members.get(&module).copied();
        let Some(peer) = peer.filter(|peer| Some(peer.incarnation) == incarnation) else {
            return 0;
        };
        let plan = (Some(self.epoch()), Some(self.digest));
        let heartbeat = peer.heartbeat.as_ref();
        let in_heartbeat = heartbeat
            .filter(|heartbeat| (heartbeat.epoch, heartbeat.digest) == plan)
            .map(|heartbeat| heartbeat.steps_done);
        let state = peer.state.as_ref();
        let in_state = state
            .filter(|state| (state.epoch, state.digest) == plan)
            .and_then(|state| state.steps_done);
        in_heartbeat.max(in_state).unwrap_or_default()
    }

    /// The holders of the spots next to a spot, in the order in which the spots are filled, each with its place.
    fn adjacent_holders(&self, spot: SpotId) -> Vec<(Place, ModuleId)> {
        let RosterPlan {
            places, holders, ..
        } = &*self.roster_plan;
        let target = self.roster.target.target.iter();
        let adjacent = target.flat_map(|target| target.neighbours_of(spot));
        let adjacent = adjacent.filter_map(|spot| holders.get(&spot));
        let mut adjacent: Vec<(Place, ModuleId)> = adjacent
            .filter_map(|module| Some((*places.get(module)?, *module)))
            .collect();
        adjacent.sort_unstable_by_key(|(place, _)| place.order);
        adjacent.dedup_by_key(|(place, _)| place.order);
        adjacent
    }

    /// The adjacent holders that are placed before this module: the ones to which it docks.
    pub(super) fn docks_with(&self, place: Place) -> Vec<ModuleId> {
        self.partners_of(self.own, place.spot)
    }

    /// The holders next to a module's spot that are placed before it.
    pub(super) fn partners_of(&self, own: ModuleId, spot: SpotId) -> Vec<ModuleId> {
        let place = self.roster_plan.places.get(&own);
        let order = place.map_or(usize::MAX, |place| place.order);
        let adjacent = self.adjacent_holders(spot).into_iter();
        let earlier = adjacent.filter(|(place, _)| place.order < order);
        earlier.map(|(_, module)| module).collect()
    }

    /// Whether this module keeps its link to another while it moves.
    pub(super) fn keeps_link_to(&self, other: ModuleId) -> bool {
        let pair = (self.own.min(other), self.own.max(other));
        self.plan.kept_links.contains(&pair)
    }

    /// The modules on the spots next to the one that the plan gives to this module.
    pub fn neighbours(&self) -> Vec<ModuleId> {
        let place = self.place.iter();
        let adjacent = place.flat_map(|place| self.adjacent_holders(place.spot));
        adjacent.map(|(_, module)| module).collect()
    }

    /// Whether the two modules are docked at the end of the plan.
    pub fn ends_linked_to(&self, other: ModuleId) -> bool {
        self.keeps_link_to(other)
            || self.place.is_some_and(|place| {
                let holders = self.adjacent_holders(place.spot);
                holders.iter().any(|&(_, holder)| holder == other)
            })
    }
}
