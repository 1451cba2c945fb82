//! Events that are worth a line in a log, and their wording.

use std::fmt;
use std::time::Duration;

use crate::model::{AssemblyWarning, BlockedSpot, Digest, Epoch, ModuleId, Service, SpotId};

use crate::motion::paths::{MotionError, StartFault};

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
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// It convenes an epoch.
    Convened(Epoch, EpochReason),
    /// It has halted for an epoch.
    Gathered(Epoch),
    /// It has a roster and plans.
    PlanningBegun {
        /// The epoch.
        epoch: Epoch,
        /// The number of members in the roster.
        members: usize,
    },
    /// Every turn is applied.
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
    PlanOverdue(Epoch),
    /// All members show the same digest.
    Agreed(Epoch),
    /// It starts to move to its spot.
    MotionBegun(SpotId),
    /// It stands on its spot and is docked.
    Settled(SpotId),
    /// It has no spot.
    Spare,
    /// It lost a spot to another module.
    Evicted {
        /// The module that took the spot.
        by: ModuleId,
        /// The spot.
        from: SpotId,
    },
    /// A message was refused.
    Refused {
        /// The module that the message names as its sender, if any.
        module: Option<ModuleId>,
        /// The reason.
        reason: Refusal,
    },
    /// A gathering ended, or continues, without all modules.
    Missing {
        /// The number of modules that the target announcement expects.
        expected: Option<u32>,
        /// The number of modules that have gathered.
        gathered: usize,
        /// The modules that are known, or are named in links, and have not gathered.
        absent: Vec<ModuleId>,
    },
    /// Too few modules are within reach to decide anything.
    WaitingForQuorum {
        /// The number of modules of the basis within reach.
        present: usize,
        /// The number of modules in the basis.
        basis: usize,
    },
    /// No agreement: these members do not show the same digest yet.
    WaitingForAgreement(Vec<ModuleId>),
    /// Its unit waits for these modules to settle.
    WaitingFor(Vec<ModuleId>),
    /// Another member shows another digest for the same epoch.
    DigestMismatch {
        /// The other member.
        module: ModuleId,
        /// The digest that the other member shows.
        theirs: Digest,
        /// The digest that this module shows.
        ours: Digest,
    },
    /// Another epoch has not helped: these members hold these plans, and no module moves.
    PlansDiffer(Vec<(Digest, Vec<ModuleId>)>),
    /// Another process runs under the same module identifier.
    DuplicateModule(ModuleId),
    /// It halted because agreement lapsed; it continues when all members show agreement again.
    AgreementLapsed(Vec<ModuleId>),
    /// It did not reach its spot in time.
    MotionOverdue(Option<SpotId>),
    /// Its drive or ports failed, while it moved to this spot if it was moving; it takes no spot any more.
    MotionFailed(Option<SpotId>),
    /// No path without contact begins where it stands, and the target forbids straight lines: it takes no spot any more.
    InvalidStart(StartFault),
    /// It received the command to leave the formation.
    Retired,
    /// It takes part again.
    Rejoined,
    /// These spots stay open, as there are too few modules that could take them. Emitted by the convener.
    SpotsLeftOpen(Vec<SpotId>),
    /// Bodies of modules that take no part cover these spots, which stay open. Emitted by the convener.
    SpotsBlocked(Vec<BlockedSpot>),
    /// These spots stay open, as blocked ones separate them from the rest. Emitted by the convener.
    SpotsCutOff(Vec<SpotId>),
    /// It has no spot, stands on one that another module takes, and moves off it.
    MakingRoom,
    /// It received the report that the body of this module was removed.
    BodyRemoved(ModuleId),
    /// This run of its module was reported as removed; it takes no part until its process restarts.
    RunRemoved,
    /// All modules stand still on command, until they are resumed.
    Stopped,
    /// The modules may move again, on command.
    Resumed,
    /// There are no paths without contact, for this reason: modules move in straight lines.
    NoPaths(MotionError),
    /// There are no paths without contact, and the target forbids straight lines: no module moves.
    NotMoving(MotionError),
    /// The plan's acting order has a flaw.
    AssemblyWarning(AssemblyWarning),
    /// The target was withdrawn; modules stay where they are.
    TargetWithdrawn,
}

/// Why an epoch is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EpochReason {
    /// There is a target and no plan for it.
    NewTarget,
    /// Members have been silent for longer than `suspicion_s`.
    Silent(Vec<ModuleId>),
    /// Members have restarted.
    Restarted(Vec<ModuleId>),
    /// Modules without a spot could fill open spots.
    Newcomers(Vec<ModuleId>),
    /// Members make no progress.
    Stuck(Vec<ModuleId>),
    /// Members have entered a later epoch than this module.
    MembersAhead(Vec<ModuleId>),
    /// A roster opened spots that the bodies of these modules cover.
    BodiesUnlisted(Vec<ModuleId>),
    /// Bodies cover spots that the plan is still to fill.
    SpotsBlocked(Vec<BlockedSpot>),
    /// Bodies no longer cover these spots.
    SpotsFreed(Vec<SpotId>),
    /// Members no longer take spots.
    OutOfService(Vec<(ModuleId, Service)>),
    /// Members hold different plans.
    DigestMismatch,
    /// The convener of the last gathering never published a roster.
    ConvenerSilent(ModuleId),
}

/// Numbers, separated by commas.
fn listed(numbers: impl Iterator<Item = u32>) -> String {
    let texts: Vec<String> = numbers.map(|number| number.to_string()).collect();
    texts.join(", ")
}

fn sentences(blocked: &[BlockedSpot]) -> String {
    let sentences: Vec<String> = blocked.iter().map(BlockedSpot::to_string).collect();
    sentences.join("; ")
}

fn ids(modules: &[ModuleId]) -> String {
    listed(modules.iter().map(|module| module.0))
}

impl fmt::Display for EpochReason {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NewTarget => write!(formatter, "there is a target and no plan for it"),
            Self::Silent(modules) => {
                write!(
                    formatter,
                    "silent for longer than suspicion_s: {}",
                    ids(modules)
                )
            }
            Self::Restarted(modules) => write!(formatter, "restarted: {}", ids(modules)),
            Self::Newcomers(modules) => {
                write!(formatter, "available for open spots: {}", ids(modules))
            }
            Self::Stuck(modules) => write!(formatter, "no progress: {}", ids(modules)),
            Self::MembersAhead(modules) => {
                write!(formatter, "in a later epoch: {}", ids(modules))
            }
            Self::BodiesUnlisted(modules) => {
                write!(formatter, "the roster lacks bodies: {}", ids(modules))
            }
            Self::SpotsBlocked(blocked) => formatter.write_str(&sentences(blocked)),
            Self::SpotsFreed(spots) => {
                let spots = listed(spots.iter().map(|spot| spot.0));
                write!(formatter, "no body blocks these spots any more: {spots}")
            }
            Self::OutOfService(modules) => {
                let named: Vec<String> = modules
                    .iter()
                    .map(|(module, service)| format!("{} ({service})", module.0))
                    .collect();
                write!(formatter, "out of service: {}", named.join(", "))
            }
            Self::DigestMismatch => write!(formatter, "members hold different plans"),
            Self::ConvenerSilent(module) => {
                write!(formatter, "{module} convened and published no roster")
            }
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Convened(epoch, reason) => write!(formatter, "convened {epoch}: {reason}"),
            Self::Gathered(epoch) => write!(formatter, "halted for {epoch}"),
            Self::PlanningBegun { epoch, members } => {
                write!(formatter, "planning {epoch} with {members} modules")
            }
            Self::Planned {
                epoch,
                digest,
                turns,
                elapsed,
            } => {
                let millis = elapsed.as_millis();
                write!(
                    formatter,
                    "planned {epoch} in {turns} turns and {millis} ms, digest {digest}"
                )
            }
            Self::PlanOverdue(epoch) => write!(
                formatter,
                "still computes the plan of {epoch} after plan_limit_s: the others leave it out"
            ),
            Self::Agreed(epoch) => write!(formatter, "all members agree on {epoch}"),
            Self::MotionBegun(spot) => write!(formatter, "moving to {spot}"),
            Self::Settled(spot) => write!(formatter, "settled on {spot}"),
            Self::Spare => write!(formatter, "has no spot and stands by"),
            Self::Evicted { by, from } => write!(formatter, "left {from} to {by}"),
            Self::Refused { module, reason } => write_refused(formatter, *module, *reason),
            Self::Missing {
                expected,
                gathered,
                absent,
            } => write_missing(formatter, *expected, *gathered, absent),
            Self::WaitingForQuorum { present, basis } => write!(
                formatter,
                "waiting for a quorum: {present} of {basis} modules are within reach"
            ),
            Self::WaitingForAgreement(modules) => {
                write!(formatter, "no agreement yet from modules {}", ids(modules))
            }
            Self::WaitingFor(modules) => {
                write!(formatter, "waiting for modules {} to settle", ids(modules))
            }
            Self::DigestMismatch {
                module,
                theirs,
                ours,
            } => write!(
                formatter,
                "{module} holds another plan: its digest is {theirs}, ours {ours}"
            ),
            Self::PlansDiffer(sides) => write_sides(formatter, sides),
            Self::DuplicateModule(module) => write!(
                formatter,
                "a second process runs as {module}: it is refused until the first has been silent for suspicion_s"
            ),
            Self::AgreementLapsed(modules) => {
                let modules = ids(modules);
                write!(formatter, "halted: agreement of modules {modules} lapsed")
            }
            Self::MotionOverdue(Some(spot)) => {
                write!(formatter, "did not reach {spot} within motion_limit_s")
            }
            Self::MotionOverdue(None) => {
                write!(formatter, "did not make way within motion_limit_s")
            }
            Self::NoPaths(error) => write!(
                formatter,
                "moves in straight lines, which is not collision-free: {error}"
            ),
            Self::NotMoving(error) => write!(formatter, "does not move: {error}"),
            Self::MotionFailed(spot) => write_motion_failed(formatter, *spot),
            Self::InvalidStart(fault) => write!(
                formatter,
                "cannot move from where it stands: {fault}; it takes no spot until it receives the command to rejoin"
            ),
            Self::Retired => write!(formatter, "retired: it leaves the formation"),
            Self::Rejoined => write!(formatter, "takes part again"),
            Self::SpotsLeftOpen(spots) => write_open(formatter, spots),
            Self::SpotsBlocked(blocked) => formatter.write_str(&sentences(blocked)),
            Self::SpotsCutOff(spots) => {
                let spots = listed(spots.iter().map(|spot| spot.0));
                write!(
                    formatter,
                    "blocked spots cut off spots {spots}, which stay open"
                )
            }
            Self::MakingRoom => write!(formatter, "moving off a spot that another module takes"),
            Self::BodyRemoved(module) => {
                write!(formatter, "the body of {module} was reported as removed")
            }
            Self::RunRemoved => write!(
                formatter,
                "this run was reported as removed: it takes no part until its process restarts"
            ),
            Self::Stopped => write!(
                formatter,
                "stopped on command: no module moves until resumed"
            ),
            Self::Resumed => write!(formatter, "resumed on command"),
            Self::AssemblyWarning(warning) => write!(formatter, "acting order: {warning}"),
            Self::TargetWithdrawn => write!(formatter, "the target was withdrawn"),
        }
    }
}

fn write_refused(
    formatter: &mut fmt::Formatter<'_>,
    module: Option<ModuleId>,
    reason: Refusal,
) -> fmt::Result {
    match module {
        Some(module) => write!(formatter, "refused a message of {module}: {reason}"),
        None => write!(formatter, "refused a message: {reason}"),
    }
}

fn write_open(formatter: &mut fmt::Formatter<'_>, spots: &[SpotId]) -> fmt::Result {
    let spots = listed(spots.iter().map(|spot| spot.0));
    write!(formatter, "too few modules: spots {spots} stay open")
}

fn write_missing(
    formatter: &mut fmt::Formatter<'_>,
    expected: Option<u32>,
    gathered: usize,
    absent: &[ModuleId],
) -> fmt::Result {
    write!(formatter, "{gathered} ")?;
    if let Some(expected) = expected {
        write!(formatter, "of {expected} ")?;
    }
    write!(formatter, "modules have gathered")?;
    if absent.is_empty() {
        Ok(())
    } else {
        write!(formatter, "; absent: {}", ids(absent))
    }
}

fn write_sides(
    formatter: &mut fmt::Formatter<'_>,
    sides: &[(Digest, Vec<ModuleId>)],
) -> fmt::Result {
    let named: Vec<String> = sides
        .iter()
        .map(|(digest, modules)| format!("{digest} held by {}", ids(modules)))
        .collect();
    write!(
        formatter,
        "plan digests differ in two consecutive epochs; not moving: {}",
        named.join("; ")
    )
}

fn write_motion_failed(formatter: &mut fmt::Formatter<'_>, spot: Option<SpotId>) -> fmt::Result {
    if let Some(spot) = spot {
        write!(formatter, "cannot reach {spot}: ")?;
    }
    write!(
        formatter,
        "its drive or docking ports failed; it takes no spot until it receives the command to rejoin"
    )
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
            | Self::RunRemoved
            | Self::NotMoving(_)
            | Self::InvalidStart(_)
            | Self::MotionFailed(_) => Severity::Error,
            Self::Refused { .. }
            | Self::Missing { .. }
            | Self::PlanOverdue(_)
            | Self::WaitingForQuorum { .. }
            | Self::AgreementLapsed(_)
            | Self::SpotsLeftOpen(_)
            | Self::SpotsBlocked(_)
            | Self::SpotsCutOff(_)
            | Self::Stopped
            | Self::NoPaths(_)
            | Self::AssemblyWarning(_) => Severity::Warning,
            _ => Severity::Info,
        }
    }
}
