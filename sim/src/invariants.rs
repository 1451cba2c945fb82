//! What must hold at every moment, judged from what modules publish and where their drives are.
//!
//! This shares nothing with the agents: it knows rosters, states, heartbeats and claims as anyone on the network does, and
//! drives as anyone who watches the robots does. How a run must end is judged in `ending`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use formation::model::{
    Digest, Epoch, Heartbeat, Incarnation, Message, ModuleId, ModulePhase, ModuleRun, ModuleState,
    Roster, RosterMember, RosterMessage, Service, SpotId,
};
use formation::protocol::Event;

use crate::cluster::{Cluster, Observation};

/// What was broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ViolationKind {
    /// Two modules settled on one spot of one plan.
    TwoModulesOnOneSpot,
    /// A module settled on two spots of one plan.
    OneModuleOnTwoSpots,
    /// A module set off before every member had shown the same digest.
    MotionWithoutAgreement,
    /// A module set off before the lease had passed since the last member showed the digest.
    MotionBeforeLease,
    /// A module set off long after a member had left the epoch.
    MotionOnStalePlan,
    /// Two modules were on their way on different plans at once.
    TwoPlansInMotion,
    /// A claim evicted a module that belongs to a configuration, or is pinned.
    ConfigurationMemberEvicted,
    /// Two rosters were published for one epoch.
    TwoRostersForOneEpoch,
    /// After the faults stopped, the modules neither formed nor waited for a quorum.
    NoEnd,
    /// They formed, but not exactly as many spots as there were modules for were filled.
    Hole,
    /// A module returned to an epoch that it had left.
    EpochWentBack,
    /// Two modules of different units were on their way at once, on one plan.
    TwoUnitsInMotion,
    /// A module that had settled for a target froze for it without naming its spot.
    PinForgotten,
    /// A module plans or agrees at another place than the roster has it.
    NotWhereFrozen,
    /// A quorum lives and can hear each other, and still waits for one.
    QuorumDenied,
    /// A module says that it has settled, and stands elsewhere than on its spot.
    SettledElsewhere,
    /// Two groups that cannot hear each other both hold a formation.
    TwoFormations,
}

impl fmt::Display for ViolationKind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::TwoModulesOnOneSpot => "two modules on one spot",
            Self::OneModuleOnTwoSpots => "one module on two spots",
            Self::MotionWithoutAgreement => "motion without agreement",
            Self::MotionBeforeLease => "motion before the lease",
            Self::MotionOnStalePlan => "motion on a stale plan",
            Self::TwoPlansInMotion => "two plans in motion",
            Self::ConfigurationMemberEvicted => "configuration member evicted",
            Self::TwoRostersForOneEpoch => "two rosters for one epoch",
            Self::NoEnd => "no end",
            Self::Hole => "hole",
            Self::EpochWentBack => "epoch went back",
            Self::TwoUnitsInMotion => "two units in motion",
            Self::PinForgotten => "pin forgotten",
            Self::NotWhereFrozen => "not where frozen",
            Self::QuorumDenied => "quorum denied",
            Self::SettledElsewhere => "settled elsewhere",
            Self::TwoFormations => "two formations",
        })
    }
}

/// One breach.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// When it was seen.
    pub at: Duration,
    /// What was broken.
    pub kind: ViolationKind,
    /// By whom, on which plan.
    pub detail: String,
}

pub(crate) struct KnownRoster {
    pub roster: Arc<Roster>,
    pub members: BTreeSet<ModuleId>,
    /// Those that take part in the plan.
    pub active: BTreeSet<ModuleRun>,
    /// Those that no claim may evict.
    fixed: BTreeSet<ModuleId>,
}

type PlanKey = (Epoch, Digest);

/// What a module said of itself last.
#[derive(Default)]
pub(crate) struct LastWord {
    pub state: Option<Arc<ModuleState>>,
    /// The revision of the target that had reached it when it published that.
    pub target_revision: u64,
    pub heartbeat: Option<Heartbeat>,
    /// The latest epoch in which this run of its process saw all agree.
    pub agreed: Option<Epoch>,
}

/// Watches a run.
pub(crate) struct Watch {
    lease: Duration,
    /// How long a heartbeat may take beyond the lease before motion on it counts as stale.
    margin: Duration,
    pub rosters: BTreeMap<Epoch, KnownRoster>,
    pub last: BTreeMap<(ModuleId, Incarnation), LastWord>,
    pub shown: BTreeMap<PlanKey, BTreeMap<ModuleId, Duration>>,
    /// When each module was last seen to show another epoch than this.
    left: BTreeMap<ModuleId, (Option<Epoch>, Duration)>,
    /// On which spot of which target each run of a process has settled and not left.
    settled_on: BTreeMap<(ModuleId, Incarnation), (SpotId, Arc<Roster>)>,
    holders: BTreeMap<(PlanKey, SpotId), ModuleId>,
    spots: BTreeMap<(PlanKey, ModuleId), SpotId>,
    begun: BTreeSet<PlanKey>,
    pub violations: Vec<Violation>,
}

impl Watch {
    pub fn new(lease: Duration, margin: Duration) -> Self {
        Self {
            lease,
            margin,
            rosters: BTreeMap::new(),
            last: BTreeMap::new(),
            shown: BTreeMap::new(),
            left: BTreeMap::new(),
            settled_on: BTreeMap::new(),
            holders: BTreeMap::new(),
            spots: BTreeMap::new(),
            begun: BTreeSet::new(),
            violations: Vec::new(),
        }
    }

    pub fn violate(&mut self, at: Duration, kind: ViolationKind, detail: String) {
        self.violations.push(Violation { at, kind, detail });
    }

    /// How many epochs came to a roster.
    pub fn epochs(&self) -> u64 {
        self.rosters.len() as u64
    }

    /// Judges what has happened since the last call.
    pub fn look(&mut self, cluster: &mut Cluster) {
        for (at, observation) in cluster.take_observations() {
            match observation {
                Observation::Published(module, message) => {
                    self.heard(at, module, &message);
                    if let Message::ModuleState(state) = &message {
                        let run = (module, state.incarnation);
                        self.last.entry(run).or_default().target_revision =
                            cluster.target_revision(module);
                        self.moves_alone(at, state, cluster);
                        self.stands_on_its_spot(at, state, cluster);
                    }
                }
                Observation::SetOff(module, plan) => self.set_off(at, module, plan, cluster),
                Observation::Noted(module, Event::Agreed(epoch)) => {
                    // An event bears no incarnation; the module was running when it noted it.
                    if let Some(incarnation) = cluster.incarnation(module) {
                        let last = self.last.entry((module, incarnation)).or_default();
                        last.agreed = last.agreed.max(Some(epoch));
                    }
                }
                Observation::Noted(..) | Observation::Announced(_) | Observation::Fault(_) => {}
            }
        }
    }

    fn heard(&mut self, at: Duration, module: ModuleId, message: &Message) {
        match message {
            Message::Roster(RosterMessage::Plan(roster)) => {
                let members: BTreeSet<ModuleId> = roster
                    .members
                    .iter()
                    .map(|member| member.module.id)
                    .collect();
                // What a module out of service is docked to is no configuration: the one lets go of the other.
                let active = || {
                    let members = roster.members.iter();
                    members.filter(|member| member.service == Service::Active)
                };
                let linked = |one: ModuleId, other: ModuleId| {
                    active().any(|member| {
                        member.module.id == one && member.module.links.contains(&other)
                    })
                };
                let pinned = |id: ModuleId| {
                    active().any(|member| member.module.id == id && member.module.pin.is_some())
                };
                // What is docked to pinned modules only has no configuration to keep: it moves, and they stay.
                let fixed = active()
                    .map(|member| &member.module)
                    .filter(|module| {
                        module.pin.is_some()
                            || module
                                .links
                                .iter()
                                .any(|&other| linked(other, module.id) && !pinned(other))
                    })
                    .map(|module| module.id)
                    .collect();
                self.check_pins(at, roster);
                let known = KnownRoster {
                    roster: Arc::clone(roster),
                    active: active().map(RosterMember::run).collect(),
                    members,
                    fixed,
                };
                if self.rosters.insert(roster.epoch, known).is_some() {
                    let detail = format!("{} by {module}", roster.epoch);
                    self.violate(at, ViolationKind::TwoRostersForOneEpoch, detail);
                }
            }
            Message::Heartbeat(heartbeat) => {
                let run = (module, heartbeat.incarnation);
                let last = self.last.entry(run).or_default();
                let before = last.heartbeat.replace(*heartbeat);
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
                if let (Some(epoch), Some(digest)) = (heartbeat.epoch, heartbeat.digest) {
                    let shown = self.shown.entry((epoch, digest)).or_default();
                    shown.entry(module).or_insert(at);
                }
            }
            Message::ModuleState(state) => {
                let run = (module, state.incarnation);
                self.last.entry(run).or_default().state = Some(Arc::clone(state));
                self.follow(at, state);
                if let (ModulePhase::Settled, Some(epoch), Some(digest), Some(spot)) =
                    (state.phase, state.epoch, state.digest, state.spot)
                {
                    self.settled(at, (epoch, digest), module, spot);
                }
            }
            Message::Claim(claim) => {
                let Some(roster) = self.rosters.get_mut(&claim.epoch) else {
                    return;
                };
                // A module that left its configuration in this or an earlier turn is a singleton like any other.
                for detached in &claim.decision.detached {
                    roster.fixed.remove(detached);
                }
                let evicted: Vec<ModuleId> = claim
                    .decision
                    .evictions
                    .iter()
                    .map(|eviction| eviction.evicted)
                    .filter(|evicted| roster.fixed.contains(evicted))
                    .collect();
                for evicted in evicted {
                    let detail = format!("{evicted} by {module} in {}", claim.epoch);
                    self.violate(at, ViolationKind::ConfigurationMemberEvicted, detail);
                }
            }
            _ => {}
        }
    }

    /// Compares what a state says with where the roster has its module, and with where it settled before.
    fn follow(&mut self, at: Duration, state: &ModuleState) {
        let run = (state.module, state.incarnation);
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
                let frozen = roster.as_ref().and_then(|roster| {
                    let mut members = roster.members.iter();
                    members.find(|member| member.module.id == state.module)
                });
                if frozen.is_some_and(|member| member.module.pose != state.pose) {
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

    /// Whoever freezes where it has settled, for the same target, says so.
    fn check_pins(&mut self, at: Duration, roster: &Roster) {
        let mut forgotten = Vec::new();
        for member in &roster.members {
            let run = (member.module.id, member.incarnation);
            let Some((spot, before)) = self.settled_on.get(&run) else {
                continue;
            };
            let last = self.last.get(&run);
            // One that was not told of the target cannot know whether it stands on a spot of it.
            let told = last.is_some_and(|last| last.target_revision == roster.target.revision);
            let frozen = last.and_then(|last| last.state.as_deref());
            let same_target = before.target.target == roster.target.target
                && before.target.parameters == roster.target.parameters;
            if let Some(frozen) = frozen
                && frozen.epoch == Some(roster.epoch)
                && frozen.phase == ModulePhase::Gathered
                && frozen.spot != Some(*spot)
                && same_target
                && told
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

    /// While a module is on its way, all others on their way belong to its unit.
    fn moves_alone(&mut self, at: Duration, state: &ModuleState, cluster: &Cluster) {
        let Some(plan) = state.epoch.zip(state.digest) else {
            return;
        };
        if state.phase != ModulePhase::Moving || cluster.plan_in_motion(state.module) != Some(plan)
        {
            return;
        }
        let others: Vec<ModuleId> = cluster
            .running()
            .into_iter()
            .filter(|&other| other != state.module && cluster.plan_in_motion(other) == Some(plan))
            .filter(|&other| {
                let last = cluster
                    .incarnation(other)
                    .and_then(|incarnation| self.last.get(&(other, incarnation)))
                    .and_then(|last| last.state.as_deref());
                last.is_some_and(|last| {
                    last.epoch == state.epoch
                        && last.phase == ModulePhase::Moving
                        && last.unit != state.unit
                })
            })
            .collect();
        for other in others {
            let detail = format!("{} while {other} moves in {}", state.module, plan.0);
            self.violate(at, ViolationKind::TwoUnitsInMotion, detail);
        }
    }

    /// Whoever says that it has settled stands where the target of its roster has its spot.
    fn stands_on_its_spot(&mut self, at: Duration, state: &ModuleState, cluster: &Cluster) {
        let spot = state
            .epoch
            .filter(|_| state.phase == ModulePhase::Settled)
            .and_then(|epoch| self.rosters.get(&epoch)?.roster.target.target.as_ref())
            .and_then(|target| target.spot(state.spot?));
        let (Some(spot), Some(standing)) = (spot, cluster.standing(state.module)) else {
            return;
        };
        if spot.pose != standing.pose {
            let detail = format!("{} beside {}", state.module, spot.id);
            self.violate(at, ViolationKind::SettledElsewhere, detail);
        }
    }

    fn settled(&mut self, at: Duration, plan: PlanKey, module: ModuleId, spot: SpotId) {
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

    fn set_off(
        &mut self,
        at: Duration,
        module: ModuleId,
        plan: Option<PlanKey>,
        cluster: &Cluster,
    ) {
        let Some(plan) = plan else {
            let detail = format!("{module} moves without a plan");
            return self.violate(at, ViolationKind::MotionWithoutAgreement, detail);
        };
        let others: Vec<ModuleId> = cluster
            .running()
            .into_iter()
            .filter(|&other| {
                cluster
                    .standing(other)
                    .is_some_and(|standing| standing.moving)
            })
            .filter(|&other| {
                cluster
                    .plan_in_motion(other)
                    .is_some_and(|other| other != plan)
            })
            .collect();
        for other in others {
            let detail = format!("{module} on {} while {other} moves on another", plan.0);
            self.violate(at, ViolationKind::TwoPlansInMotion, detail);
        }
        let members = self
            .rosters
            .get(&plan.0)
            .map(|roster| roster.members.clone());
        let shown = self.shown.get(&plan);
        let missing: Vec<ModuleId> = members
            .unwrap_or_default()
            .into_iter()
            .filter(|member| shown.is_none_or(|shown| !shown.contains_key(member)))
            .collect();
        if !missing.is_empty() || !self.rosters.contains_key(&plan.0) {
            let detail = format!(
                "{module} on {}; {} members never agreed",
                plan.0,
                missing.len()
            );
            return self.violate(at, ViolationKind::MotionWithoutAgreement, detail);
        }
        let last = shown
            .and_then(|shown| shown.values().max().copied())
            .unwrap_or_default();
        // Clocks drift by millionths, and each module rounds on its own.
        if self.begun.insert(plan) && at + Duration::from_millis(5) < last + self.lease {
            let detail = format!("{module} on {}", plan.0);
            self.violate(at, ViolationKind::MotionBeforeLease, detail);
        }
        let stale: Vec<ModuleId> = self
            .rosters
            .get(&plan.0)
            .into_iter()
            .flat_map(|roster| roster.members.iter().copied())
            .filter(|member| {
                self.left.get(member).is_some_and(|&(epoch, since)| {
                    epoch != Some(plan.0) && at > since + self.lease + self.margin
                })
            })
            .collect();
        if let Some(member) = stale.first() {
            let detail = format!("{module} on {} long after {member} left it", plan.0);
            self.violate(at, ViolationKind::MotionOnStalePlan, detail);
        }
    }
}
