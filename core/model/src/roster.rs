//! Rosters: who takes part in an epoch, and what is planned for.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{
    BodyReport, Epoch, Incarnation, ModuleId, ModuleRun, PlannerParameters, PlanningModule,
    PlanningProblem, Target,
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
    /// The voters of the session, ascending; empty if they are not named. Each roster needs a majority of them.
    pub voters: Vec<ModuleId>,
}

impl TargetAnnouncement {
    /// The target of a problem, without a name, a number of modules and voters.
    #[must_use]
    pub fn new(problem: &PlanningProblem, revision: u64) -> Self {
        Self {
            revision,
            name: String::new(),
            target: Some(Arc::clone(problem.target())),
            parameters: *problem.parameters(),
            expected_modules: None,
            voters: Vec::new(),
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
    /// Retired by command: gets no spot, but votes while its process runs.
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
    /// Whether this run has forgotten nothing that its module agreed on, so that it counts in a majority.
    pub knows: bool,
    /// Whether nobody who is no member can be in motion by a plan that a run of its module showed within the lease: it showed none, or all
    /// who may move by that plan are members.
    pub is_idle: bool,
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
}

/// Who votes in a session.
///
/// A removal of a vote is in force once all members of a roster that lists it have agreed. Until then the vote counts neither for the
/// roster nor does the number that is needed sink, so that no false removal makes two majorities.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Voters {
    /// All that the session has, ascending; empty while none are named.
    pub named: Vec<ModuleId>,
    /// Those whose votes were removed.
    pub removed: BTreeSet<ModuleId>,
    /// Those whose votes a roster has removed that may be in force.
    pub listed: BTreeSet<ModuleId>,
}

impl Voters {
    /// Adds what others know of removals.
    pub fn learn(&mut self, removed: &BTreeSet<ModuleId>, listed: &BTreeSet<ModuleId>) {
        self.removed.extend(removed);
        self.listed.extend(listed);
        self.listed.retain(|module| !self.removed.contains(module));
    }

    /// All removals that are listed are in force.
    pub fn settle(&mut self) {
        self.removed.append(&mut self.listed);
    }

    /// Whether any vote was removed, or a roster that may be in force says so.
    pub fn has_removals(&self) -> bool {
        !(self.removed.is_empty() && self.listed.is_empty())
    }

    /// The voters of whom a majority is needed.
    pub fn counted(&self) -> impl Iterator<Item = ModuleId> + Clone {
        let named = self.named.iter().copied();
        named.filter(|module| !self.removed.contains(module))
    }

    /// Whether a module is one of those.
    pub fn counts(&self, module: ModuleId) -> bool {
        self.named.binary_search(&module).is_ok() && !self.removed.contains(&module)
    }

    /// The voters whose votes count.
    pub fn remaining(&self) -> impl Iterator<Item = ModuleId> + Clone {
        self.counted()
            .filter(|module| !self.listed.contains(module))
    }
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
    /// The voters, of whom this one holds a majority.
    pub voters: Voters,
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
}
