//! Events that are worth a line in a log, and their wording.

use std::time::Duration;

use thiserror::Error;

use formation_model::text::joined;
use formation_model::{
    AssemblyWarning, BlockedSpot, Digest, Epoch, GivenRefused, Incarnation, MicroUnits, ModuleId,
    Service, SpotId,
};

use formation_motion::paths::{MotionError, StartFault};

use super::quorum::Shortfall;
use super::refusal::Refusal;

/// How much attention an event needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Normal operation.
    Info,
    /// A condition that the protocol handles.
    Warning,
    /// A condition that an operator has to fix.
    Error,
}

/// Something worth a line in a log. The subject is the agent that emits it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Event {
    /// It convenes an epoch.
    #[error("convened {0}: {1}")]
    Convened(Epoch, EpochReason),
    /// It has halted for an epoch.
    #[error("halted for {0}")]
    Gathered(Epoch),
    /// It has a roster and plans.
    #[error("planning {epoch} with {members} modules")]
    PlanningBegun {
        /// The epoch.
        epoch: Epoch,
        /// The number of members in the roster.
        members: usize,
    },
    /// Every turn is applied.
    #[error("planned {epoch} in {turns} turns and {} ms, digest {digest}", elapsed.as_millis())]
    Planned {
        /// The epoch.
        epoch: Epoch,
        /// The digest of the plan.
        digest: Digest,
        /// The number of turns.
        turns: u32,
        /// The time since the roster became known.
        elapsed: Duration,
    },
    /// It still computes its plan after the time for which the other members wait for it.
    #[error("still computes the plan of {0} after plan_limit_s: the others leave it out")]
    PlanOverdue(Epoch),
    /// All members show the same digest.
    #[error("all members agree on {0}")]
    Agreed(Epoch),
    /// All agreed, and no voters are named.
    #[error(
        "no voters are named: should the modules be cut apart, two parts of them may form next to each other"
    )]
    NoVoters,
    /// All agreed, and nothing moves for this long.
    #[error("nothing moves for {:.1} s: until then, modules that were left out may move by an earlier plan", .0.as_secs_f64())]
    WaitingForLease(Duration),
    /// It starts to move to its spot.
    #[error("moving to {0}")]
    MotionBegun(SpotId),
    /// It stands on its spot and is docked.
    #[error("settled on {0}")]
    Settled(SpotId),
    /// It has no spot.
    #[error("has no spot and stands by")]
    Spare,
    /// It lost a spot to another module.
    #[error("left {from} to {by}")]
    Evicted {
        /// The module that took the spot.
        by: ModuleId,
        /// The spot.
        from: SpotId,
    },
    /// A message was refused.
    #[error("refused a message{}: {reason}", of_sender(*module))]
    Refused {
        /// The module that the message names as its sender, if any.
        module: Option<ModuleId>,
        /// The reason.
        reason: Refusal,
    },
    /// A gathering ended, or continues, without all modules.
    #[error("{gathered} {}modules have gathered{}", of_expected(*expected), absentees(absent))]
    Missing {
        /// The number of modules that the target announcement expects.
        expected: Option<u32>,
        /// The number of modules that have gathered.
        gathered: usize,
        /// The modules that are known, or are named in links, and have not gathered.
        absent: Vec<ModuleId>,
    },
    /// The modules within reach cannot decide anything.
    #[error("waiting for a quorum: {0}")]
    WaitingForQuorum(Shortfall),
    /// No agreement: these members do not show the same digest yet.
    #[error("no agreement yet from modules {}", ids(.0))]
    WaitingForAgreement(Vec<ModuleId>),
    /// Another member shows another digest for the same epoch.
    #[error("{module} holds another plan: its digest is {theirs}, ours {ours}")]
    DigestMismatch {
        /// The other member.
        module: ModuleId,
        /// The digest that the other member shows.
        theirs: Digest,
        /// The digest that this module shows.
        ours: Digest,
    },
    /// Another epoch has not helped: these members hold these plans, and no module moves.
    #[error("plan digests differ in two consecutive epochs; not moving: {}", sides(.0))]
    PlansDiffer(Vec<(Digest, Vec<ModuleId>)>),
    /// Another process runs under the same module identifier.
    #[error(
        "a second process runs as {0}: it is refused until the first has been silent for suspicion_s"
    )]
    DuplicateModule(ModuleId),
    /// It halted because agreement lapsed; it continues when all members show agreement again.
    #[error("halted: agreement of modules {} lapsed", ids(.0))]
    AgreementLapsed(Vec<ModuleId>),
    /// A former run of its module has a later number: its clock was set back in between.
    #[error(
        "others know a later run of this module, which is silent: was the clock set back? This run goes on as {}", .0.0
    )]
    RunRenumbered(Incarnation),
    /// The heartbeats of a module come earlier than its clock and this one allow.
    #[error(
        "halted: heartbeats of {module} come {:.1} s earlier than before, by their uptime: did the clock of this machine stand still?",
        gain.as_secs_f64()
    )]
    ClockInDoubt {
        /// The module.
        module: ModuleId,
        /// How much earlier.
        gain: Duration,
    },
    /// Those of at least half of the others do, or one by more than `suspicion`.
    #[error(
        "the clock of this machine stood still for {:.1} s: a new run begins where the module stands",
        .0.as_secs_f64()
    )]
    ClockStoodStill(Duration),
    /// It did not reach its spot in time.
    #[error("did not {} within motion_limit_s", aim(*.0))]
    MotionOverdue(Option<SpotId>),
    /// It is measured off its way, and halts.
    #[error(
        "halted: measured {0} units off the way that its plan lets it take; was it pushed, or is its localisation off?"
    )]
    OffPath(MicroUnits),
    /// It is measured on its way again.
    #[error("measured on its way again")]
    BackOnPath,
    /// It is measured far off its spot, although its ports are locked to modules that stand on theirs.
    #[error(
        "localisation lost: measured {0} units off its spot, while its ports are locked to modules that stand on theirs; it stays"
    )]
    PortsContradictPose(MicroUnits),
    /// Its driver states this standard deviation, with which its body may reach out of its cells.
    #[error(
        "localisation lost: its driver states a standard deviation of {0} units; it halts until that is less"
    )]
    LocalisationLost(MicroUnits),
    /// It halted because these members are measured off their ways.
    #[error("halted: measured off their ways: modules {}", ids(.0))]
    KeepingClear(Vec<ModuleId>),
    /// Its drive or ports failed, while it moved to this spot if it was moving; it takes no spot any more.
    #[error("{}its drive or docking ports failed; it takes no spot until it receives the command to rejoin", unreached(*.0))]
    MotionFailed(Option<SpotId>),
    /// No path without contact begins where it stands: it takes no spot any more.
    #[error(
        "cannot move from where it stands: {0}; it takes no spot until other bodies are gone, or it receives the command to rejoin"
    )]
    InvalidStart(StartFault),
    /// No path leads it to its spot: it takes none any more.
    #[error(
        "cannot move: {0}; it takes no spot until other bodies are gone, or it receives the command to rejoin"
    )]
    CannotReach(MotionError),
    /// The bodies are gone past which it found no path: it takes spots again.
    #[error("takes spots again, as other bodies have gone")]
    MayMoveAgain,
    /// It is retired, stands on a spot, and cannot make way: others leave the spot open.
    #[error("stands on a spot and cannot make way: {0}")]
    CannotMakeWay(MotionError),
    /// It received the command to leave the formation.
    #[error("retired: it leaves the formation")]
    Retired,
    /// It takes part again.
    #[error("takes part again")]
    Rejoined,
    /// These spots stay open, as there are too few modules that could take them. Emitted by the convener.
    #[error("too few modules: spots {} stay open", spot_ids(.0))]
    SpotsLeftOpen(Vec<SpotId>),
    /// Bodies of modules that take no part cover these spots, which stay open. Emitted by the convener.
    #[error("{}", joined(.0, "; "))]
    SpotsBlocked(Vec<BlockedSpot>),
    /// These spots stay open, as blocked ones separate them from the rest. Emitted by the convener.
    #[error("blocked spots cut off spots {}, which stay open", spot_ids(.0))]
    SpotsCutOff(Vec<SpotId>),
    /// It has no spot, stands on one that another module takes, and moves off it.
    #[error("moving off a spot that another module takes")]
    MakingRoom,
    /// It received the report that the body of this module was removed.
    #[error(
        "the body of {0} was reported as removed: that takes effect in a roster, once no member has heard {0} for suspicion_s"
    )]
    RemovalProposed(ModuleId),
    /// A heartbeat of this module came that was sent after its body was reported as removed.
    #[error(
        "the report that the body of {0} was removed is dropped: {0} has sent a heartbeat since"
    )]
    RemovalRefuted(ModuleId),
    /// Another member has heard this module since its body was reported as removed.
    #[error(
        "the report that the body of {0} was removed is dropped: another member has heard {0} since"
    )]
    RemovalOverruled(ModuleId),
    /// It refused the roster of this epoch, which lists modules as removed that it hears.
    #[error(
        "refused the roster of {epoch}, which lists as removed what sends heartbeats: modules {}",
        ids(modules)
    )]
    RemovalsHeard {
        /// The epoch.
        epoch: Epoch,
        /// The modules.
        modules: Vec<ModuleId>,
    },
    /// It refused the roster of this epoch, which lists modules as removed for which it has not listened for `suspicion`.
    #[error(
        "refused the roster of {epoch}, as this process has listened for less than suspicion_s for what that lists as removed: modules {}",
        ids(modules)
    )]
    RemovalsEarly {
        /// The epoch.
        epoch: Epoch,
        /// The modules.
        modules: Vec<ModuleId>,
    },
    /// All members agree that the body of this module was removed.
    #[error("the body of {0} was removed, by the roster that all members agree on")]
    BodyRemoved(ModuleId),
    /// The roster of this epoch, which does not list this module, says that its body was removed.
    #[error("the roster of {0} lists this run as removed: none of its members heard it")]
    RunRemoved(Epoch),
    /// All modules stand still on command, until they are resumed.
    #[error("stopped on command: no module moves until resumed")]
    Stopped,
    /// The modules may move again, on command.
    #[error("resumed on command")]
    Resumed,
    /// There are no paths without contact: no module moves.
    #[error("does not move: {0}")]
    NotMoving(MotionError),
    /// The target gives an allocation that these modules cannot carry out: no module moves.
    #[error("does not move: the policy `given` cannot be followed: {0}")]
    GivenRefused(GivenRefused),
    /// The plan's acting order has a flaw.
    #[error("acting order: {0}")]
    AssemblyWarning(AssemblyWarning),
    /// The target was withdrawn; modules stay where they are.
    #[error("the target was withdrawn")]
    TargetWithdrawn,
}

/// Why an epoch is opened.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum EpochReason {
    /// There is a target and no plan for it.
    #[error("there is a target and no plan for it")]
    NewTarget,
    /// The processes of members have left the graph.
    #[error("left the graph: {}", ids(.0))]
    Left(Vec<ModuleId>),
    /// Members have been silent for longer than `suspicion_s`.
    #[error("silent for longer than suspicion_s: {}", ids(.0))]
    Silent(Vec<ModuleId>),
    /// Not all members receive these.
    #[error("not received by all members, or not receiving all: {}", ids(.0))]
    NotReceived(Vec<ModuleId>),
    /// Members were moved by others: they stand off what their plan lets them do, by these distances.
    #[error("displaced: {}", with_distances(.0))]
    Displaced(Vec<(ModuleId, MicroUnits)>),
    /// Members have restarted.
    #[error("restarted: {}", ids(.0))]
    Restarted(Vec<ModuleId>),
    /// Modules without a spot could fill open spots.
    #[error("available for open spots: {}", ids(.0))]
    Newcomers(Vec<ModuleId>),
    /// Members make no progress.
    #[error("no progress: {}", ids(.0))]
    Stuck(Vec<ModuleId>),
    /// Members have entered a later epoch than this module.
    #[error("in a later epoch: {}", ids(.0))]
    MembersAhead(Vec<ModuleId>),
    /// A roster opened spots that the bodies of these modules cover, or does not say where these bodies are.
    #[error("the roster lacks bodies: {}", ids(.0))]
    BodiesUnlisted(Vec<ModuleId>),
    /// A roster listed these modules as removed, although this one hears them or has not listened for long enough.
    #[error("the roster lists as removed what may live: {}", ids(.0))]
    RemovalsRefused(Vec<ModuleId>),
    /// Bodies cover spots that the plan is still to fill.
    #[error("{}", joined(.0, "; "))]
    SpotsBlocked(Vec<BlockedSpot>),
    /// Bodies no longer cover these spots.
    #[error("no body blocks these spots any more, or need do so: {}", spot_ids(.0))]
    SpotsFreed(Vec<SpotId>),
    /// These bodies, for which no module could move, are in the way no more.
    #[error("no longer in the way of all: {}", ids(.0))]
    BodiesGone(Vec<ModuleId>),
    /// The votes of these modules are to be removed.
    #[error("votes to be removed: {}", ids(.0))]
    VotesRemoved(Vec<ModuleId>),
    /// Members no longer take spots.
    #[error("out of service: {}", with_services(.0))]
    OutOfService(Vec<(ModuleId, Service)>),
    /// Members hold different plans.
    #[error("members hold different plans")]
    DigestMismatch,
    /// The convener of the last gathering never published a roster.
    #[error("{0} convened and published no roster")]
    ConvenerSilent(ModuleId),
}

fn ids(modules: &[ModuleId]) -> String {
    joined(modules.iter().map(|module| module.0), ", ")
}

fn spot_ids(spots: &[SpotId]) -> String {
    joined(spots.iter().map(|spot| spot.0), ", ")
}

fn with_services(modules: &[(ModuleId, Service)]) -> String {
    let named = modules.iter();
    let named = named.map(|(module, service)| format!("{} ({service})", module.0));
    joined(named, ", ")
}

fn with_distances(displaced: &[(ModuleId, MicroUnits)]) -> String {
    let named = displaced.iter();
    let named = named.map(|(module, distance)| format!("{} by {distance} units", module.0));
    joined(named, ", ")
}

fn of_sender(module: Option<ModuleId>) -> String {
    module.map_or_else(String::new, |module| format!(" of {module}"))
}

fn of_expected(expected: Option<u32>) -> String {
    expected.map_or_else(String::new, |expected| format!("of {expected} "))
}

fn absentees(absent: &[ModuleId]) -> String {
    match absent {
        [] => String::new(),
        absent => format!("; absent: {}", ids(absent)),
    }
}

fn sides(sides: &[(Digest, Vec<ModuleId>)]) -> String {
    let named = sides.iter();
    let named = named.map(|(digest, modules)| format!("{digest} held by {}", ids(modules)));
    joined(named, "; ")
}

fn aim(spot: Option<SpotId>) -> String {
    spot.map_or_else(|| "make way".to_owned(), |spot| format!("reach {spot}"))
}

fn unreached(spot: Option<SpotId>) -> String {
    spot.map_or_else(String::new, |spot| format!("cannot reach {spot}: "))
}

impl Event {
    /// How much attention it needs.
    #[must_use]
    pub fn severity(&self) -> Severity {
        match self {
            Self::DigestMismatch { .. }
            | Self::PlansDiffer(_)
            | Self::DuplicateModule(_)
            | Self::MotionOverdue(_)
            | Self::RunRemoved(_)
            | Self::NotMoving(_)
            | Self::GivenRefused(_)
            | Self::InvalidStart(_)
            | Self::PortsContradictPose(_)
            | Self::LocalisationLost(_)
            | Self::MotionFailed(_) => Severity::Error,
            Self::Refused { .. }
            | Self::Missing { .. }
            | Self::PlanOverdue(_)
            | Self::RunRenumbered(_)
            | Self::ClockInDoubt { .. }
            | Self::ClockStoodStill(_)
            | Self::WaitingForQuorum(_)
            | Self::NoVoters
            | Self::AgreementLapsed(_)
            | Self::OffPath(_)
            | Self::KeepingClear(_)
            | Self::SpotsLeftOpen(_)
            | Self::SpotsBlocked(_)
            | Self::SpotsCutOff(_)
            | Self::RemovalRefuted(_)
            | Self::RemovalOverruled(_)
            | Self::RemovalsHeard { .. }
            | Self::RemovalsEarly { .. }
            | Self::Stopped
            | Self::AssemblyWarning(_) => Severity::Warning,
            _ => Severity::Info,
        }
    }
}
