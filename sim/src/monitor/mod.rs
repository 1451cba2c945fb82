//! Monitors invariants: what must hold at every moment, judged from what modules publish and where their drives are.
//!
//! This shares nothing with the agents. It knows rosters, states, heartbeats and claims as any participant does, and drives
//! as an observer of the robots does. `ending` judges how a run ends.

mod bodies;
mod contact;
mod covering;
mod ending;
mod hands;
mod motion;
mod violation;
mod ways;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use formation_model::{
    ClosedRoster, Digest, Epoch, Heartbeat, Message, MicroUnits, ModuleId, ModulePhase, ModuleRun,
    ModuleState, Pose, Roster, RosterMember, RosterMessage, Service, SpotClaim, SpotId,
};

pub use bodies::{blocks_all, room};
use contact::ContactWatch;
pub use violation::{BrokenInvariant, ViolationKind};

use crate::cluster::Cluster;
use crate::faults::Fault;
use crate::observation::Observation;

struct KnownRoster {
    roster: Arc<ClosedRoster>,
    members: BTreeSet<ModuleId>,
    /// The members that no claim may evict.
    fixed: BTreeSet<ModuleId>,
    /// The modules of which some member had received a state.
    seen: BTreeSet<ModuleId>,
    /// The turn of the claim that is judged next, and the claims that came before their turn.
    next_turn: u32,
    early: BTreeMap<u32, SpotClaim>,
}

type PlanKey = (Epoch, Digest);

/// The latest messages of one run.
#[derive(Default)]
struct Latest {
    state: Option<Arc<ModuleState>>,
    /// The revision of the target that the run had received when it published its state; `None` before any.
    target_revision: Option<u64>,
    heartbeat: Option<Heartbeat>,
}

/// Judges one run of a cluster.
#[derive(Default)]
pub(crate) struct Monitor {
    lease: Duration,
    /// The time beyond the lease that a heartbeat may take before motion on it counts as stale.
    margin: Duration,
    rosters: BTreeMap<Epoch, KnownRoster>,
    latest: BTreeMap<ModuleRun, Latest>,
    /// When each module last showed the digest of each plan.
    last_shown: BTreeMap<ModuleId, BTreeMap<PlanKey, Duration>>,
    /// The runs that said in a state that they have forgotten nothing; of modules with stores all runs.
    knowing: BTreeSet<ModuleRun>,
    knowing_stores: BTreeSet<ModuleId>,
    /// The modules whose votes any roster removes.
    votes_removed: BTreeSet<ModuleId>,
    /// When each member first showed the digest of a plan.
    shown: BTreeMap<PlanKey, BTreeMap<ModuleId, Duration>>,
    /// The epoch that each module shows, and since when.
    left: BTreeMap<ModuleId, (Option<Epoch>, Duration)>,
    /// The spot, and the roster with its target, on which each run has settled and that it has not left.
    settled_on: BTreeMap<ModuleRun, (SpotId, Arc<ClosedRoster>)>,
    holders: BTreeMap<(PlanKey, SpotId), ModuleId>,
    spots: BTreeMap<(PlanKey, ModuleId), SpotId>,
    /// The spot that each module has in a plan, by any of its states.
    assigned: BTreeMap<(PlanKey, ModuleId), SpotId>,
    /// The plans on which a module has begun to move.
    begun: BTreeSet<PlanKey>,
    bodies: ContactWatch,
    hands: hands::Hands,
    pub violations: Vec<BrokenInvariant>,
}

impl Monitor {
    pub fn new(lease: Duration, margin: Duration) -> Self {
        Self {
            lease,
            margin,
            ..Self::default()
        }
    }

    fn violate(&mut self, at: Duration, kind: ViolationKind, detail: String) {
        self.violations.push(BrokenInvariant { at, kind, detail });
    }

    /// The number of epochs with a roster.
    pub fn epochs(&self) -> u64 {
        self.rosters.len() as u64
    }

    /// Judges what has just happened.
    pub fn observe(&mut self, observations: Vec<(Duration, Observation)>, cluster: &Cluster) {
        for (at, observation) in observations {
            match observation {
                Observation::Published(module, message) => match &message {
                    Message::Roster(RosterMessage::Plan(roster)) => {
                        self.observe_roster(at, module, roster, cluster);
                    }
                    Message::Heartbeat(heartbeat) => self.observe_heartbeat(at, heartbeat),
                    Message::ModuleState(state) => self.observe_state(at, state, cluster),
                    Message::Claim(claim) => self.observe_claim(at, claim),
                    _ => {}
                },
                Observation::Stands(module, pose) => self.follow_body(at, module, pose, cluster),
                Observation::Carried(module, pose) => self.note_carried(at, module, pose, cluster),
                Observation::Torn(part) => self.hands.note_torn(&part, at),
                Observation::SetOff(module, plan) => {
                    self.check_departure(at, module, plan, cluster);
                }
                Observation::Fault(Fault::Mislead(module, _)) => self.hands.note_misled(module, at),
                Observation::Noted(..)
                | Observation::Announced(_)
                | Observation::Injected(_)
                | Observation::Fault(_) => {}
            }
        }
    }

    fn observe_roster(
        &mut self,
        at: Duration,
        convener: ModuleId,
        roster: &Arc<ClosedRoster>,
        cluster: &Cluster,
    ) {
        self.check_pins(at, roster);
        let members = roster.members.iter();
        let active = || {
            let members = roster.members.iter();
            members.filter(|member| member.service == Service::Active)
        };
        let problem = roster.problem().ok().flatten();
        // One that walls and bodies cut off from the target stays, and those that are docked to it have no configuration with it.
        let is_candidate = |member: &&RosterMember| {
            let problem = problem.as_ref();
            problem.is_none_or(|problem| {
                let position = problem.position_of(member.module.id);
                position.is_none_or(|position| !problem.is_cut_off(position))
            })
        };
        let known = KnownRoster {
            members: members.clone().map(|member| member.module.id).collect(),
            fixed: fixed(&active().filter(is_candidate).collect::<Vec<_>>()),
            seen: members
                .clone()
                .flat_map(|member| cluster.seen_by(member.run()))
                .collect(),
            roster: Arc::clone(roster),
            next_turn: 0,
            early: BTreeMap::new(),
        };
        self.votes_removed.extend(&roster.voters.removed);
        self.votes_removed.extend(&roster.voters.listed);
        // Where all have forgotten an epoch, a later run of its convener opens it again for other runs of the members.
        let run_of_convener = |roster: &Roster| member(roster, convener).map(RosterMember::run);
        if let Some(earlier) = self.rosters.insert(roster.epoch, known)
            && run_of_convener(&earlier.roster) == run_of_convener(roster)
        {
            let detail = format!("{} by {convener}", roster.epoch);
            self.violate(at, ViolationKind::TwoRostersForOneEpoch, detail);
        }
    }

    fn observe_heartbeat(&mut self, at: Duration, heartbeat: &Heartbeat) {
        let module = heartbeat.module;
        let run = module.run(heartbeat.incarnation);
        let before = self
            .latest
            .entry(run)
            .or_default()
            .heartbeat
            .replace(heartbeat.clone());
        if let Some(before) = before.and_then(|before| before.epoch)
            && heartbeat.epoch < Some(before)
        {
            let detail = format!("{module} after {before}");
            self.violate(at, ViolationKind::EpochWentBack, detail);
        }
        let entry = self.left.entry(module).or_insert((heartbeat.epoch, at));
        if entry.0 != heartbeat.epoch {
            *entry = (heartbeat.epoch, at);
        }
        if let Some(plan) = heartbeat.epoch.zip(heartbeat.digest) {
            let shown = self.shown.entry(plan).or_default();
            shown.entry(module).or_insert(at);
            self.last_shown.entry(module).or_default().insert(plan, at);
        }
    }

    fn observe_state(&mut self, at: Duration, state: &Arc<ModuleState>, cluster: &Cluster) {
        let run = state.module.run(state.incarnation);
        let latest = self.latest.entry(run).or_default();
        latest.state = Some(Arc::clone(state));
        if state.knows {
            self.knowing.insert(run);
            if cluster.has_store(state.module) {
                self.knowing_stores.insert(state.module);
            }
        }
        let announcement = cluster.received_announcement(state.module);
        latest.target_revision = announcement.map(|announcement| announcement.revision);
        let was_settled = self.settled_on.contains_key(&run);
        self.follow(at, run, state);
        if let (Some(plan), Some(spot)) = (state.epoch.zip(state.digest), state.spot) {
            self.assigned.insert((plan, state.module), spot);
        }
        if !was_settled {
            self.check_bodies(at, state, cluster);
        }
        if let (ModulePhase::Settled, Some(plan), Some(spot)) =
            (state.phase, state.epoch.zip(state.digest), state.spot)
        {
            self.check_spots(at, plan, state.module, spot);
            self.check_stands_on(at, state, plan.0, spot, cluster);
        }
    }

    fn observe_claim(&mut self, at: Duration, claim: &SpotClaim) {
        let Some(roster) = self.rosters.get_mut(&claim.epoch) else {
            return;
        };
        roster.early.insert(claim.turn, claim.clone());
        let mut found = Vec::new();
        while let Some(claim) = roster.early.remove(&roster.next_turn) {
            roster.next_turn += 1;
            // A module that left its configuration in this or an earlier turn is a singleton like any other.
            for detached in &claim.decision.detached {
                roster.fixed.remove(detached);
            }
            let evicted = claim.decision.evictions.iter();
            let evicted = evicted
                .map(|eviction| eviction.evicted)
                .filter(|evicted| roster.fixed.contains(evicted));
            let detail = |evicted| format!("{evicted} by {} in {}", claim.claimant, claim.epoch);
            found.extend(evicted.map(detail));
        }
        for detail in found {
            self.violate(at, ViolationKind::ConfigurationMemberEvicted, detail);
        }
    }

    /// Compares a state with the entry of its module in the roster, and records where the module has settled.
    fn follow(&mut self, at: Duration, run: ModuleRun, state: &ModuleState) {
        let roster = state
            .epoch
            .and_then(|epoch| self.rosters.get(&epoch))
            .map(|known| Arc::clone(&known.roster));
        match state.phase {
            ModulePhase::Moving => {
                self.settled_on.remove(&run);
            }
            ModulePhase::Settled => {
                if let Some((spot, roster)) = state.spot.zip(roster) {
                    self.settled_on.insert(run, (spot, roster));
                }
            }
            ModulePhase::Planning | ModulePhase::Agreeing => {
                let roster = roster.as_deref();
                let frozen = roster.and_then(|roster| member(roster, state.module));
                let may_be_off = self.hands.has_moved_or_misled(state.module);
                if frozen.is_some_and(|member| member.module.pose != state.pose && !may_be_off) {
                    let detail = format!("{}", state.module);
                    self.violate(at, ViolationKind::NotWhereFrozen, detail);
                }
            }
            _ => {}
        }
        if state.service != Service::Active {
            self.settled_on.remove(&run);
        }
    }

    /// A module that freezes where it has settled, for the same target, publishes its pin.
    fn check_pins(&mut self, at: Duration, roster: &Roster) {
        let mut forgotten = Vec::new();
        for member in &roster.members {
            let Some((spot, before)) = self.settled_on.get(&member.run()) else {
                continue;
            };
            let latest = self.latest.get(&member.run());
            // A module that has not received the target cannot know whether it stands on a spot of it.
            let revision = latest.and_then(|latest| latest.target_revision);
            let knows_target = revision == Some(roster.target.revision);
            let frozen = latest.and_then(|latest| latest.state.as_deref());
            let same_target = before.target.target == roster.target.target
                && before.target.parameters == roster.target.parameters;
            if let Some(frozen) = frozen
                && frozen.epoch == Some(roster.epoch)
                && frozen.phase == ModulePhase::Gathered
                && frozen.spot != Some(*spot)
                && same_target
                && knows_target
                && !self.hands.has_moved_or_misled(member.module.id)
            {
                forgotten.push(format!(
                    "{} of {spot} in {}",
                    member.module.id, roster.epoch
                ));
            }
        }
        for detail in forgotten {
            self.violate(at, ViolationKind::PinForgotten, detail);
        }
    }

    /// A module that has settled stands where the target of its roster has its spot.
    fn check_stands_on(
        &mut self,
        at: Duration,
        state: &ModuleState,
        epoch: Epoch,
        spot: SpotId,
        cluster: &Cluster,
    ) {
        let target = self.rosters.get(&epoch);
        let target = target.and_then(|known| known.roster.target.target.as_ref());
        let pose = target.and_then(|target| Some(target.spot(spot)?.pose));
        let standing = cluster.standing(state.module);
        if let (Some(pose), Some(standing)) = (pose, standing)
            && !stands_on(&standing.pose, &pose)
            && !self.hands.may_be_off(state.module, at)
        {
            let detail = format!("{} not on {spot}", state.module);
            self.violate(at, ViolationKind::SettledElsewhere, detail);
        }
    }

    /// One module on each spot of a plan, and one spot for each module.
    fn check_spots(&mut self, at: Duration, plan: PlanKey, module: ModuleId, spot: SpotId) {
        let holder = *self.holders.entry((plan, spot)).or_insert(module);
        if holder != module {
            let detail = format!("{holder} and {module} on {spot} in {}", plan.0);
            self.violate(at, ViolationKind::TwoModulesOnOneSpot, detail);
        }
        let first = *self.spots.entry((plan, module)).or_insert(spot);
        if first != spot {
            let detail = format!("{module} on {first} and {spot} in {}", plan.0);
            self.violate(at, ViolationKind::OneModuleOnTwoSpots, detail);
        }
    }
}

fn member(roster: &Roster, module: ModuleId) -> Option<&RosterMember> {
    let mut members = roster.members.iter();
    members.find(|member| member.module.id == module)
}

/// A module stands on a spot that is this near along each axis, and its heading that of the spot to within as much.
const ON_SPOT: MicroUnits = MicroUnits(2_000);

fn stands_on(pose: &Pose, spot: &Pose) -> bool {
    let is_near = |one: MicroUnits, other: MicroUnits| (one.0 - other.0).abs() <= ON_SPOT.0;
    is_near(pose.x, spot.x) && is_near(pose.y, spot.y) && pose.heading_difference(spot) <= ON_SPOT
}

/// The active members that no claim may evict: those with a pin, and those of a configuration.
fn fixed(active: &[&RosterMember]) -> BTreeSet<ModuleId> {
    // A module that is docked to pinned modules only has no configuration to keep: it moves, and they stay. Links to
    // modules out of service make no configuration, as these undock.
    let is_partner = |own: ModuleId, other: ModuleId| {
        active.iter().any(|member| {
            let module = &member.module;
            module.id == other && module.links.contains(&own) && module.pin.is_none()
        })
    };
    let modules = active.iter().map(|member| &member.module);
    modules
        .filter(|module| {
            let mut links = module.links.iter();
            module.pin.is_some() || links.any(|&other| is_partner(module.id, other))
        })
        .map(|module| module.id)
        .collect()
}
