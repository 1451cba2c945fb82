//! The messages of the protocol as validated data; the wire types are in `formation_msgs`.

use std::collections::BTreeSet;
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{
    BodyReport, ClosedRoster, ConfigurationId, Decision, Digest, Epoch, EvictionRecord,
    Incarnation, ModuleId, ModuleRun, Pose, Service, SpotId, TargetAnnouncement,
};

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
    /// The module halts, measured off the way that its plan lets it take: it was pushed or carried, or its localisation is off. How
    /// it came there is not known.
    Displaced,
    /// The module halts, as its localisation is lost: its pose is not to be believed.
    Lost,
}

impl DriveState {
    /// Whether the module may have come to its pose by no drive of its own.
    pub fn is_off_way(self) -> bool {
        matches!(self, Self::Displaced | Self::Lost)
    }
}

/// When a state held. An agent counts from the start of its own clock, a message from 1970-01-01 UTC by the clock of its
/// sender. No agent decides by it, so it does not enter hashes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct SenderTime(pub Duration);

impl Hash for SenderTime {
    fn hash<H: Hasher>(&self, _: &mut H) {}
}

/// The report that the body of a run was taken away.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Removal {
    /// The run, with all earlier ones of its module.
    pub run: ModuleRun,
    /// Whether the vote of its module goes as well.
    pub takes_vote: bool,
}

impl Removal {
    /// The report that a body was taken away, whose module keeps its vote.
    #[must_use]
    pub fn of_body(run: ModuleRun) -> Self {
        Self {
            run,
            takes_vote: false,
        }
    }
}

/// The state that a module publishes.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ModuleState {
    /// The module.
    pub module: ModuleId,
    /// The run of its process.
    pub incarnation: Incarnation,
    /// Whether this run has forgotten nothing that its module agreed on.
    pub knows: bool,
    /// In GATHERED: whether no run of its module can have shown a plan within the lease.
    pub is_idle: bool,
    /// In GATHERED: the only plan that runs of its module can have shown within the lease, if they can have shown one.
    pub last_plan: Option<Digest>,
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
    /// The number of steps of its path that it has done in this epoch; `None` without a plan or paths.
    pub steps_done: Option<u32>,
    /// The sequence number of the first state that showed it settled in this epoch; 0 before. A reader that keeps one
    /// sample can miss that state, and this shows whether a mark is later.
    pub settled_since: u64,
    /// In MOVING and SETTLED: the settled states for which it waited. They prove the order to observers.
    pub waited_for: Vec<CausalMark>,
    /// In MOVING and SETTLED of the first unit to move: the heartbeats that showed agreement, one of each member. SETTLED
    /// repeats them for observers that join late and receive no MOVING.
    pub agreed_on: Vec<CausalMark>,
    /// In GATHERED: the voters whose votes were removed, as far as it knows.
    pub removed_voters: BTreeSet<ModuleId>,
    /// In GATHERED: those whose votes a roster has removed that it agreed to, and that may be in force.
    pub listed_voters: BTreeSet<ModuleId>,
    /// In GATHERED: the known bodies and removals of modules that are absent, ascending by module.
    pub bodies: Vec<BodyReport>,
    /// In GATHERED: the runs whose bodies were reported as removed, and that this module has not heard for `suspicion`; ascending by
    /// module.
    pub proposed_removals: Vec<Removal>,
    /// In GATHERED: the runs that this module has heard since their bodies were reported as removed; ascending by module.
    pub refuted_removals: Vec<ModuleRun>,
}

impl ModuleState {
    /// Whether its module only goes on from where an earlier state of the same run shows it: its pose and the steps that it has done are
    /// all that differs, and it does not say that it is off its way. What it shows to observers alone, the proofs and the time, is not
    /// compared.
    #[must_use]
    pub fn goes_on_from(&self, earlier: &Self) -> bool {
        let as_before = Self {
            sequence: self.sequence,
            at: self.at,
            pose: self.pose,
            steps_done: self.steps_done,
            waited_for: self.waited_for.clone(),
            agreed_on: self.agreed_on.clone(),
            ..earlier.clone()
        };
        !self.drive.is_off_way() && *self == as_before
    }

    /// The first state of a run: it stands at a pose, docked to no module, and takes part in no plan yet.
    #[must_use]
    pub fn standing(run: ModuleRun, pose: Pose) -> Self {
        Self {
            module: run.module,
            incarnation: run.incarnation,
            knows: false,
            is_idle: false,
            last_plan: None,
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
            removed_voters: BTreeSet::new(),
            listed_voters: BTreeSet::new(),
            bodies: Vec::new(),
            proposed_removals: Vec::new(),
            refuted_removals: Vec::new(),
        }
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
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Heartbeat {
    /// The module.
    pub module: ModuleId,
    /// The run of its process.
    pub incarnation: Incarnation,
    /// Whether this run has forgotten nothing that its module agreed on.
    pub knows: bool,
    /// Identifies the voters that it knows; 0 while it knows none.
    pub voters: u64,
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
    /// The modules that it knows of and does not receive, in ascending order.
    pub misses: Arc<[ModuleId]>,
}

impl Heartbeat {
    /// The first heartbeat of the first run of a module: it is in no epoch, has forgotten nothing, and knows of no voters.
    #[must_use]
    pub fn first(run: ModuleRun) -> Self {
        Self {
            module: run.module,
            incarnation: run.incarnation,
            knows: true,
            voters: 0,
            sequence: 1,
            uptime: Duration::ZERO,
            epoch: None,
            digest: None,
            digest_since: 0,
            applied_turns: 0,
            steps_done: 0,
            phase: ModulePhase::Listening,
            stop: Stop::default(),
            misses: Arc::default(),
        }
    }
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
    Removal(Removal),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MicroUnits;

    #[test]
    fn a_module_goes_on_if_it_shows_no_more_than_its_pose_and_its_steps() {
        let run = ModuleId(4).run(Incarnation(1));
        let mut earlier = ModuleState::standing(run, Pose::default());
        earlier.drive = DriveState::Moving;
        let mut later = earlier.clone();
        later.sequence += 1;
        later.pose.x = MicroUnits(1_000_000);
        later.steps_done = Some(1);
        assert!(later.goes_on_from(&earlier));
        type Change = fn(&mut ModuleState);
        let changes: [Change; 6] = [
            |state| state.service = Service::Retired,
            |state| state.phase = ModulePhase::Settled,
            |state| state.drive = DriveState::Standing,
            |state| state.links = [ModuleId(5)].into(),
            |state| {
                state.epoch = Some(Epoch {
                    number: 1,
                    convener: ModuleId(4),
                });
            },
            |state| state.spot = Some(SpotId(1)),
        ];
        for change in changes {
            let mut other = later.clone();
            change(&mut other);
            assert!(!other.goes_on_from(&earlier), "{other:?}");
        }
        // Each place where it is off its way matters.
        for drive in [DriveState::Displaced, DriveState::Lost] {
            let [mut was, mut is] = [&earlier, &later].map(ModuleState::clone);
            (was.drive, is.drive) = (drive, drive);
            assert!(!is.goes_on_from(&was));
        }
    }
}
