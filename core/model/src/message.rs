//! The messages of the protocol as validated data; the wire types are in `formation_msgs`.

use std::collections::BTreeSet;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{
    BlockedSpot, BodyReport, ClosedRoster, ConfigurationId, Digest, Epoch, Incarnation, ModuleId,
    ModuleRun, PlannerParameters, PlanningModule, PlanningProblem, Pose, SpotId, StoreId, Target,
    Voter, body,
};

/// A target as announced to all modules.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TargetAnnouncement {
    /// Rises with every change of the target; the announcement of the highest revision is in force.
    pub revision: u64,
    /// The formation's name, for people.
    pub name: String,
    /// The target; `None` withdraws it, and the modules stop.
    pub target: Option<Arc<Target>>,
    /// The user's choices about planning.
    pub parameters: PlannerParameters,
    /// The number of modules that take part, if known. Without it a gathering ends when no further module joins.
    pub expected_modules: Option<u32>,
    /// The modules that found the formation, ascending; empty if they are not named. The first roster needs all of them, or a
    /// majority with stores, and every later one needs one of them.
    pub founders: Vec<ModuleId>,
}

impl TargetAnnouncement {
    /// The target of a problem, without a name, a number of modules and founders.
    #[must_use]
    pub fn new(problem: &PlanningProblem, revision: u64) -> Self {
        Self {
            revision,
            name: String::new(),
            target: Some(Arc::clone(problem.target())),
            parameters: *problem.parameters(),
            expected_modules: None,
            founders: Vec::new(),
        }
    }
}

/// The phase in which a module is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum ModulePhase {
    /// Started; receives messages for a while before it takes part.
    Listening,
    /// Halted, in an epoch that gathers its members.
    Gathered,
    /// Halted; computes the plan of its epoch, or as its convener which pins stay.
    Computing,
    /// Taking turns.
    Planning,
    /// All turns are applied; waits until all members show the same digest.
    Agreeing,
    /// Agreed; waits until the earlier units have settled.
    Waiting,
    /// Moves to its spot.
    Moving,
    /// On its spot and docked.
    Settled,
    /// Agreed; the plan gives it no spot.
    Spare,
    /// Receives heartbeats of too few modules for a majority.
    WaitingForQuorum,
}

impl ModulePhase {
    /// The name of the phase for people and in `ModuleState.msg`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Listening => "LISTENING",
            Self::Gathered => "GATHERED",
            Self::Computing => "COMPUTING",
            Self::Planning => "PLANNING",
            Self::Agreeing => "AGREEING",
            Self::Waiting => "WAITING",
            Self::Moving => "MOVING",
            Self::Settled => "SETTLED",
            Self::Spare => "SPARE",
            Self::WaitingForQuorum => "WAITING_FOR_QUORUM",
        }
    }
}

/// Whether a module takes part in plans. Digests contain the numbers.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub enum Service {
    /// Takes a spot if the plan gives it one.
    #[default]
    Active = 0,
    /// Retired by command: gets no spot, but counts towards majorities while its process runs.
    Retired = 1,
    /// Its drive or a docking port has failed; treated as retired.
    MotionFailed = 2,
}

impl fmt::Display for Service {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Active => "active",
            Self::Retired => "retired",
            Self::MotionFailed => "motion failed",
        })
    }
}

/// A message of a module for which an action waited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CausalMark {
    /// The module that sent it.
    pub module: ModuleId,
    /// Its sequence number.
    pub sequence: u64,
}

/// What the drive of a module does from the time of a state on.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum DriveState {
    /// The module stands where it is until it publishes another state.
    #[default]
    Standing,
    /// The module moves straight on, until it publishes a state at the next corner or stop.
    Moving,
    /// The module moves straight on in a step in which its unit folds, so modules of the unit may overlap.
    Folding,
}

/// When a state held. An agent counts from the start of its own clock, a message from 1970-01-01 UTC by the clock of its
/// sender. No agent decides by it, so it does not enter hashes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct SenderTime(pub Duration);

impl Hash for SenderTime {
    fn hash<H: Hasher>(&self, _: &mut H) {}
}

/// The state that a module publishes.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ModuleState {
    /// The module.
    pub module: ModuleId,
    /// The run of its process.
    pub incarnation: Incarnation,
    /// Its store, if it has one.
    pub store: Option<StoreId>,
    /// Rises with every state that this incarnation publishes.
    pub sequence: u64,
    /// The epoch of the state; `None` before the first.
    pub epoch: Option<Epoch>,
    /// The digest of its plan; `None` without a plan.
    pub digest: Option<Digest>,
    /// Its phase.
    pub phase: ModulePhase,
    /// Whether it takes part in plans.
    pub service: Service,
    /// When it had this pose.
    pub at: SenderTime,
    /// What its drive does from then on.
    pub drive: DriveState,
    /// Its pose.
    pub pose: Pose,
    /// The modules to which it is docked.
    pub links: BTreeSet<ModuleId>,
    /// The initial configuration to which it belongs.
    pub configuration: Option<ConfigurationId>,
    /// The module that leads it.
    pub leader: Option<ModuleId>,
    /// The spot that the plan gives it; in GATHERED, the spot on which it has settled already and stays.
    pub spot: Option<SpotId>,
    /// The lead of its acting unit; itself when it moves alone.
    pub unit: Option<ModuleId>,
    /// The number of steps of its path that it has done in this epoch; `None` without a plan, or if modules move in
    /// straight lines.
    pub steps_done: Option<u32>,
    /// The sequence number of the first state that showed it settled in this epoch; 0 before. A reader that keeps one
    /// sample can miss that state, and this shows whether a mark is later.
    pub settled_since: u64,
    /// In MOVING and SETTLED: the settled states for which it waited. They prove the order to observers.
    pub waited_for: Vec<CausalMark>,
    /// In MOVING and SETTLED of the first unit to move: the heartbeats that showed agreement, one of each member. SETTLED
    /// repeats them for observers that join late and receive no MOVING.
    pub agreed_on: Vec<CausalMark>,
    /// In GATHERED: the rosters known to it of which a new one must contain a majority.
    pub quorum_bases: Vec<QuorumBasis>,
    /// In GATHERED: the known bodies and removals of modules that are absent, ascending by module.
    pub bodies: Vec<BodyReport>,
    /// In GATHERED: the runs whose bodies were reported as removed, and that this module has not heard for `suspicion`; ascending by
    /// module.
    pub proposed_removals: Vec<ModuleRun>,
    /// In GATHERED: the runs that this module has heard since their bodies were reported as removed; ascending by module.
    pub refuted_removals: Vec<ModuleRun>,
}

impl ModuleState {
    /// The first state of a run: it stands at a pose, docked to no module, and takes part in no plan yet.
    #[must_use]
    pub fn standing(run: ModuleRun, pose: Pose) -> Self {
        Self {
            module: run.module,
            incarnation: run.incarnation,
            store: None,
            sequence: 1,
            epoch: None,
            digest: None,
            phase: ModulePhase::Listening,
            service: Service::Active,
            at: SenderTime::default(),
            drive: DriveState::Standing,
            pose,
            links: BTreeSet::new(),
            configuration: None,
            leader: None,
            spot: None,
            unit: None,
            steps_done: None,
            settled_since: 0,
            waited_for: Vec::new(),
            agreed_on: Vec::new(),
            quorum_bases: Vec::new(),
            bodies: Vec::new(),
            proposed_removals: Vec::new(),
            refuted_removals: Vec::new(),
        }
    }

    /// The module with the memory that counts towards majorities.
    #[must_use]
    pub fn voter(&self) -> Voter {
        let run = self.module.run(self.incarnation);
        Voter::new(run, self.store)
    }
}

/// One member of a roster, as it was when it halted.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct RosterMember {
    /// The run of its process.
    pub incarnation: Incarnation,
    /// Its store, if it has one.
    pub store: Option<StoreId>,
    /// Whether it takes part in plans. A member out of service is not part of the plan; it agrees like any other.
    pub service: Service,
    /// The data on which planning depends.
    pub module: PlanningModule,
}

impl RosterMember {
    /// The member with this module, among members that ascend by module.
    pub fn find(members: &[Self], module: ModuleId) -> Option<&Self> {
        let position = members.binary_search_by_key(&module, |member| member.module.id);
        members.get(position.ok()?)
    }

    /// Those of some members that take part in plans.
    pub fn active(members: &[Self]) -> impl Iterator<Item = &Self> + Clone {
        members
            .iter()
            .filter(|member| member.service == Service::Active)
    }

    /// The module with the run of its process.
    pub fn run(&self) -> ModuleRun {
        self.module.id.run(self.incarnation)
    }

    /// The module with the memory that counts towards majorities.
    pub fn voter(&self) -> Voter {
        Voter::new(self.run(), self.store)
    }
}

/// The members of an earlier roster of which a new one must contain a majority.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct QuorumBasis {
    /// The epoch.
    pub epoch: Epoch,
    /// Whether all of its members are known to have agreed.
    pub agreed: bool,
    /// Its active members in ascending order, each with the memory with which it took part.
    pub members: Vec<Voter>,
}

/// The input of one epoch's plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Roster {
    /// The epoch.
    pub epoch: Epoch,
    /// The target and the parameters of the planner.
    pub target: TargetAnnouncement,
    /// The members in ascending order of module.
    pub members: Vec<RosterMember>,
    /// The earlier rosters of which this one contains a majority.
    pub quorum_bases: Vec<QuorumBasis>,
    /// The times that all members must have in common.
    pub timing: Timing,
    /// The known bodies and removals of modules that are no members, ascending by module.
    pub bodies: Vec<BodyReport>,
}

/// The times that all members of a roster must have in common for the lease to be safe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Timing {
    /// The time between two heartbeats.
    pub heartbeat: Duration,
    /// A module that is silent for longer is considered failed.
    pub suspicion: Duration,
    /// The greatest age of a heartbeat on which a module moves.
    pub lease: Duration,
}

impl fmt::Display for Timing {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            heartbeat,
            suspicion,
            lease,
        } = self;
        write!(
            formatter,
            "heartbeat {heartbeat:?}, suspicion {suspicion:?}, lease {lease:?}"
        )
    }
}

impl Roster {
    /// The member with this module.
    pub fn member(&self, module: ModuleId) -> Option<&RosterMember> {
        RosterMember::find(&self.members, module)
    }

    /// The active members, ascending: a later roster must contain a majority of them. Members out of service have agreed to
    /// this roster, and so to counting no more.
    pub fn quorum_basis(&self) -> Vec<Voter> {
        RosterMember::active(&self.members)
            .map(RosterMember::voter)
            .collect()
    }

    /// The spots of its target that bodies cover, ascending.
    pub fn blocked_spots(&self) -> Vec<BlockedSpot> {
        self.blocked_by(&self.bodies)
    }

    /// The blocked spots if these were the bodies of modules that are not members.
    pub fn blocked_by(&self, bodies: &[BodyReport]) -> Vec<BlockedSpot> {
        let motion = self.target.parameters.motion;
        let target = self.target.target.as_ref();
        target.map_or_else(Vec::new, |target| {
            body::blocked_spots(target, motion, &self.members, bodies)
        })
    }

    /// The part of its target that bodies leave open; `None` when they leave none, or the target is withdrawn.
    pub fn open_target(&self) -> Option<Arc<Target>> {
        let target = self.target.target.as_ref()?;
        body::open_part(target, &self.members, &self.blocked_spots())
    }
}

/// The message of a convener.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RosterMessage {
    /// Opens an epoch: receivers halt and publish their state.
    Gather {
        /// The epoch.
        epoch: Epoch,
        /// The revision of the target to plan for.
        target_revision: u64,
        /// Its digest: a module that has settled for a target with this digest publishes its spot as its pin.
        target: Digest,
    },
    /// Ends the gathering: receivers plan for this roster.
    Plan(Arc<ClosedRoster>),
}

impl RosterMessage {
    /// The epoch that it opens or plans.
    pub fn epoch(&self) -> Epoch {
        match self {
            Self::Gather { epoch, .. } => *epoch,
            Self::Plan(roster) => roster.epoch,
        }
    }
}

/// One (spot, selector) pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SpotSelection {
    /// The spot.
    pub spot: SpotId,
    /// The module that takes it.
    pub module: ModuleId,
}

/// One module losing its spot to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct EvictionRecord {
    /// The module that loses its spot.
    pub evicted: ModuleId,
    /// The module that takes it.
    pub by: ModuleId,
    /// The spot that changes hands.
    pub from: SpotId,
    /// The spot that the evicted module takes instead; `None` leaves it without a spot.
    pub to: Option<SpotId>,
}

/// The decision of one unit in its turn; applied as a whole or not at all.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Decision {
    /// The new pairs, with the new spots of evicted modules; ascending by spot. Empty means NO_SPOT_FOUND.
    pub selections: Vec<SpotSelection>,
    /// The evictions that it makes, in the order of the chain.
    pub evictions: Vec<EvictionRecord>,
    /// The modules that leave their configuration, ascending; in an exact finish also those that left it in an earlier turn
    /// and get a spot only now.
    pub detached: Vec<ModuleId>,
}

impl Decision {
    /// The number of its spots, evictions and modules, by which the memory for decisions is limited.
    pub fn entry_count(&self) -> usize {
        self.selections.len() + self.evictions.len() + self.detached.len()
    }
}

/// A unit's decision as published.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct SpotClaim {
    /// The epoch.
    pub epoch: Epoch,
    /// Counts the turns of the epoch, from 0.
    pub turn: u32,
    /// The module that publishes for the unit: its leader.
    pub claimant: ModuleId,
    /// The run of its process.
    pub incarnation: Incarnation,
    /// The decision.
    pub decision: Decision,
}

/// One eviction, published for the evicted module and for observers; it changes no state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EvictionNotice {
    /// The epoch.
    pub epoch: Epoch,
    /// The turn whose claim evicts.
    pub turn: u32,
    /// The eviction.
    pub eviction: EvictionRecord,
}

/// A heartbeat of one module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Heartbeat {
    /// The module.
    pub module: ModuleId,
    /// The run of its process.
    pub incarnation: Incarnation,
    /// Its store, if it has one.
    pub store: Option<StoreId>,
    /// Rises with every heartbeat of this incarnation.
    pub sequence: u64,
    /// The time since the start of this incarnation, by its own clock, at the time of sending. Receivers compare it with
    /// their own clocks to recognise a heartbeat that was delayed in a buffer.
    pub uptime: Duration,
    /// Its epoch.
    pub epoch: Option<Epoch>,
    /// The digest of its plan; `None` until every turn is applied.
    pub digest: Option<Digest>,
    /// The sequence number of the first heartbeat that showed this digest; 0 without one.
    pub digest_since: u64,
    /// The number of turns of the epoch that it has applied.
    pub applied_turns: u32,
    /// The number of steps of its path that it has done in this epoch.
    pub steps_done: u32,
    /// Its phase.
    pub phase: ModulePhase,
    /// The latest command to stop or to resume that it knows.
    pub stop: Stop,
}

/// A command to all modules to stand still, or to move again; the highest revision applies. Revision 0 stands for none.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct Stop {
    /// Rises with every command.
    pub revision: u64,
    /// Whether the modules are to stand still; of two commands of one revision, the one to stand still applies.
    pub stopped: bool,
}

/// A message that an agent can receive, by its topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// On `target`.
    Target(Arc<TargetAnnouncement>),
    /// On `module_states`.
    ModuleState(Arc<ModuleState>),
    /// On `module_states`, of another session: the module takes no part, and its body stands there.
    OtherSessionState(Arc<ModuleState>),
    /// On `roster`.
    Roster(RosterMessage),
    /// On `claims`.
    Claim(Arc<SpotClaim>),
    /// On `evictions`.
    Eviction(EvictionNotice),
    /// On `heartbeats`.
    Heartbeat(Heartbeat),
    /// On `commands`.
    Stop(Stop),
    /// On `commands`: the body of this run, with those of all earlier ones, was taken away.
    Removal(ModuleRun),
}
