//! What agents tell each other, as validated data; the wire types live in `formation_msgs`.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::model::{
    ConfigurationId, Digest, Epoch, Incarnation, ModuleId, ModuleRun, PlannerParameters,
    PlanningModule, PlanningProblem, Pose, ProblemError, SpotId, Target,
};

/// The target that all modules are to form, as announced.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TargetAnnouncement {
    /// Rises with every change of the target; the highest revision holds.
    pub revision: u64,
    /// What the formation is called, for people.
    pub name: String,
    /// The target; `None` withdraws it, and modules stay where they are.
    pub target: Option<Arc<Target>>,
    /// What the user chose about planning.
    pub parameters: PlannerParameters,
    /// How many modules take part, if it is known; without it the gathering ends when nothing new comes.
    pub expected_modules: Option<u32>,
}

/// What a module is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum ModulePhase {
    /// Started, and listening before it takes part.
    Listening,
    /// Halted and frozen in an epoch that gathers its members.
    Gathered,
    /// Taking turns.
    Planning,
    /// Every turn is applied; waiting until all members show the same digest.
    Agreeing,
    /// Agreed; waiting until the earlier units have settled.
    Waiting,
    /// On the way to its spot.
    Moving,
    /// On its spot and docked.
    Settled,
    /// Agreed, and without a spot.
    Spare,
    /// Too few modules are within reach to decide anything.
    WaitingForQuorum,
}

impl ModulePhase {
    /// What it is called before people and in `ModuleState.msg`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Listening => "LISTENING",
            Self::Gathered => "GATHERED",
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

/// Whether a module takes a spot when it can.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Service {
    /// It does.
    #[default]
    Active,
    /// It was told to leave the formation: it gets no spot, and still counts towards majorities while it runs.
    Retired,
    /// Its drive or its docking ports gave up; as if it were retired.
    MotionFailed,
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

/// One module's state at one point in time that an action waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CausalMark {
    /// The module that was waited for.
    pub module: ModuleId,
    /// Its sequence number at that time.
    pub sequence: u64,
}

/// One module's announcement of itself.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ModuleState {
    /// The module.
    pub module: ModuleId,
    /// Which run of its process speaks.
    pub incarnation: Incarnation,
    /// Rises with every state that this incarnation publishes.
    pub sequence: u64,
    /// The epoch in which the state holds; `None` before the first.
    pub epoch: Option<Epoch>,
    /// The digest of the plan on which it acts; `None` while there is none.
    pub digest: Option<Digest>,
    /// What it is doing.
    pub phase: ModulePhase,
    /// Whether it takes a spot when it can.
    pub service: Service,
    /// Where it stands.
    pub pose: Pose,
    /// The modules that it is docked to.
    pub links: BTreeSet<ModuleId>,
    /// The initial configuration to which it belongs.
    pub configuration: Option<ConfigurationId>,
    /// The module that leads it.
    pub leader: Option<ModuleId>,
    /// The spot that the plan gives it; while it is gathered, the spot on which it has settled already and stays.
    pub spot: Option<SpotId>,
    /// The module whose acting unit it moves with; itself when it moves alone.
    pub unit: Option<ModuleId>,
    /// The sequence number of the first state that showed it settled in this epoch; 0 before. A depth-1 reader may
    /// have missed that state, and still knows whether a mark lies after it.
    pub settled_since: u64,
    /// In MOVING and SETTLED: the settled states that it waited for. Proof of order for observers.
    pub waited_for: Vec<CausalMark>,
    /// In MOVING and SETTLED, of the first unit to move: the heartbeats that showed agreement, one a member. SETTLED keeps
    /// them, as an observer that comes late hears no MOVING.
    pub agreed_on: Vec<CausalMark>,
    /// While it is gathered: the rosters of which a new one must hold a majority, as far as it knows.
    pub quorum_bases: Vec<QuorumBasis>,
}

/// One member of a roster, frozen.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct RosterMember {
    /// Which run of its process takes part.
    pub incarnation: Incarnation,
    /// Whether it takes a spot. One that does not is no part of the plan; it agrees and is counted like any other.
    pub service: Service,
    /// What planning has to know of it.
    pub module: PlanningModule,
}

impl RosterMember {
    /// Which run of which module it is.
    #[must_use]
    pub fn run(&self) -> ModuleRun {
        ModuleRun {
            module: self.module.id,
            incarnation: self.incarnation,
        }
    }
}

/// The members of an earlier epoch, by which a majority is counted.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct QuorumBasis {
    /// The epoch.
    pub epoch: Epoch,
    /// Whether all of its members were seen to agree.
    pub agreed: bool,
    /// Its active members in ascending order, in the runs that took part.
    pub members: Vec<ModuleRun>,
}

/// The whole input of one epoch's plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Roster {
    /// The epoch.
    pub epoch: Epoch,
    /// The target and planner parameters that all plan for.
    pub target: TargetAnnouncement,
    /// The members in ascending order of module.
    pub members: Vec<RosterMember>,
    /// The earlier rosters of which this one holds a majority.
    pub quorum_bases: Vec<QuorumBasis>,
}

impl Roster {
    /// The members of which a later roster must hold a majority, ascending: the active ones. Those out of service agreed
    /// to this roster like the others, and with that to being counted no more.
    #[must_use]
    pub fn quorum_basis(&self) -> Vec<ModuleRun> {
        self.members
            .iter()
            .filter(|member| member.service == Service::Active)
            .map(RosterMember::run)
            .collect()
    }

    /// The planning input of this roster, its active members only; `None` when its target is withdrawn.
    ///
    /// # Errors
    /// Says what contradicts itself in the roster.
    pub fn problem(&self) -> Result<Option<PlanningProblem>, ProblemError> {
        let Some(target) = &self.target.target else {
            return Ok(None);
        };
        let modules = self
            .members
            .iter()
            .filter(|member| member.service == Service::Active)
            .map(|member| member.module.clone())
            .collect();
        PlanningProblem::new(Arc::clone(target), self.target.parameters, modules).map(Some)
    }
}

/// What a convener announces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RosterMessage {
    /// An epoch opens: halt, freeze and announce your state.
    Gather {
        /// The epoch.
        epoch: Epoch,
        /// The revision of the target that will be planned for.
        target_revision: u64,
    },
    /// The gathering is over; plan on this.
    Plan(Arc<Roster>),
}

impl RosterMessage {
    /// The epoch that it opens or fixes.
    #[must_use]
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
    /// The module that is to occupy it.
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
    /// Where the evicted module goes; `None` when it is dropped.
    pub to: Option<SpotId>,
}

/// What one unit decides in its turn; applied whole or not at all.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Decision {
    /// The pairs that change, the new spots of evicted modules included; ascending by spot. Empty means NO_SPOT_FOUND.
    pub selections: Vec<SpotSelection>,
    /// The evictions that it makes, in the order of the chain.
    pub evictions: Vec<EvictionRecord>,
    /// The modules that leave their configuration, ascending; in an exact finish also those that left it before and are
    /// placed only now.
    pub detached: Vec<ModuleId>,
}

/// A unit's decision, as broadcast.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct SpotClaim {
    /// The epoch.
    pub epoch: Epoch,
    /// Counts the turns of the epoch, from 0.
    pub turn: u32,
    /// The module that decides for the unit.
    pub claimant: ModuleId,
    /// Which run of its process speaks.
    pub incarnation: Incarnation,
    /// What it decides.
    pub decision: Decision,
}

/// One eviction, told to the evicted and whoever watches; it changes no state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EvictionNotice {
    /// The epoch.
    pub epoch: Epoch,
    /// The turn whose claim evicts.
    pub turn: u32,
    /// Who loses what to whom.
    pub eviction: EvictionRecord,
}

/// A sign of life of one module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Heartbeat {
    /// The module.
    pub module: ModuleId,
    /// Which run of its process speaks.
    pub incarnation: Incarnation,
    /// Rises with every heartbeat of this incarnation.
    pub sequence: u64,
    /// How long this incarnation has been running when it sent this, by its own clock. Receivers compare it with
    /// their own clocks, so that a heartbeat that lay in a buffer is not taken for a fresh one.
    pub uptime: Duration,
    /// The epoch it is in.
    pub epoch: Option<Epoch>,
    /// The digest of its whole plan; `None` until every turn is applied.
    pub digest: Option<Digest>,
    /// The sequence number of the first heartbeat that showed this digest; 0 without one.
    pub digest_since: u64,
    /// How many turns of the epoch it has applied.
    pub applied_turns: u32,
    /// What it is doing.
    pub phase: ModulePhase,
}

/// Everything that an agent may hear.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// On `target`.
    Target(Arc<TargetAnnouncement>),
    /// On `module_states`.
    ModuleState(Arc<ModuleState>),
    /// On `roster`.
    Roster(RosterMessage),
    /// On `claims`.
    Claim(Arc<SpotClaim>),
    /// On `evictions`; informs only.
    Eviction(EvictionNotice),
    /// On `heartbeats`.
    Heartbeat(Heartbeat),
}
