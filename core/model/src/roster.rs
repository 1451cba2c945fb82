//! Rosters: who takes part in an epoch, and what is planned for.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{
    BodyReport, Epoch, Incarnation, ModuleId, ModuleRun, PlannerParameters, PlanningModule,
    PlanningProblem, StoreId, Target, Voter,
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
    /// Enforces S2.
    pub fn quorum_basis(&self) -> Vec<Voter> {
        RosterMember::active(&self.members)
            .map(RosterMember::voter)
            .collect()
    }
}
