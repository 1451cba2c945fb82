//! What goes into an agent and what comes out of it.

use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

use crate::model::{
    ConfigurationId, Digest, Epoch, Incarnation, Message, MicroUnits, ModuleId, Pose, Service,
    SpotId,
};

use super::refusal::Refusal;

/// Who sent a message, as the transport tells: one value a participant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SourceId(pub u128);

/// What a module knows of itself when its process starts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// The module.
    pub module: ModuleId,
    /// This run of its process.
    pub incarnation: Incarnation,
    /// Where it stands.
    pub pose: Pose,
    /// The modules that it is docked to.
    pub links: BTreeSet<ModuleId>,
    /// The initial configuration to which it belongs.
    pub configuration: Option<ConfigurationId>,
    /// The module that leads it.
    pub leader: Option<ModuleId>,
}

/// What a module's drive and docking ports report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionReport {
    /// It is on its way and stands here now.
    Pose(Pose),
    /// It has reached its goal.
    Arrived(Pose),
    /// It has come to a halt.
    Halted(Pose),
    /// It is docked to this module.
    Docked(ModuleId),
    /// It has let go of this module.
    Undocked(ModuleId),
    /// It cannot do what it was told.
    Failed,
}

/// What a person or a program beside the module tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Leave the formation: halt, let go, and take no spot any more.
    Retire,
    /// Take part again, after [`Self::Retire`] or after the drive had given up.
    Rejoin,
}

/// What an agent is told.
#[derive(Clone, Debug)]
pub enum Input {
    /// A message of another agent, or of a publisher.
    Message {
        /// Who sent it; `None` when the transport does not tell.
        source: Option<SourceId>,
        /// What it says.
        message: Message,
    },
    /// Its drive and docking ports report.
    Motion(MotionReport),
    /// Somebody tells this module what to do.
    Command(Command),
    /// The time that [`super::Agent::poll_timeout`] named has come.
    Timeout,
}

/// Where a module is to go. It repeats with every heartbeat while the module may move; a drive stops when it no longer does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionGoal {
    /// The pose to reach.
    pub pose: Pose,
    /// The way of the module of its unit that has the farthest to go, so that a block arrives together.
    pub unit_distance: MicroUnits,
}

/// How much a person should care about an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The course of things.
    Info,
    /// Something that the protocol can deal with.
    Warning,
    /// Something that a person has to mend.
    Error,
}

/// Something worth a line in a log.
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
        /// How many members the roster lists.
        members: usize,
    },
    /// Every turn is applied.
    Planned {
        /// The epoch.
        epoch: Epoch,
        /// The digest of the plan.
        digest: Digest,
        /// How many turns it took.
        turns: u32,
        /// How long after the roster became known.
        elapsed: Duration,
    },
    /// All members show the same digest.
    Agreed(Epoch),
    /// It starts to move to its spot.
    MotionBegun(SpotId),
    /// It stands on its spot and is docked.
    Settled(SpotId),
    /// It has no spot.
    Spare,
    /// It let another have its spot.
    Evicted {
        /// The module that took the spot.
        by: ModuleId,
        /// The spot.
        from: SpotId,
    },
    /// A message was refused.
    Refused {
        /// Whose message, where it says.
        module: Option<ModuleId>,
        /// Why.
        reason: Refusal,
    },
    /// A gathering ended, or goes on, without all.
    Missing {
        /// How many modules the target announcement expects.
        expected: Option<u32>,
        /// How many are there.
        gathered: usize,
        /// The modules that were heard of, or are named in links, and are not there.
        absent: Vec<ModuleId>,
    },
    /// Too few modules are within reach to decide anything.
    WaitingForQuorum {
        /// How many of the basis are within reach.
        present: usize,
        /// How many there are in the basis.
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
        /// What it shows.
        theirs: Digest,
        /// What this module shows.
        ours: Digest,
    },
    /// Another epoch has not helped: these members hold these plans, and nothing moves.
    PlansDiffer(Vec<(Digest, Vec<ModuleId>)>),
    /// Another process runs under the same module identifier.
    DuplicateModule(ModuleId),
    /// It halted because agreement lapsed; it goes on when all are heard again.
    AgreementLapsed(Vec<ModuleId>),
    /// It did not reach its spot in time.
    MotionOverdue(SpotId),
    /// Its drive or ports gave up, on the way to this spot if it was on its way; it takes part no more.
    MotionFailed(Option<SpotId>),
    /// It was told to leave the formation.
    Retired,
    /// It takes part again.
    Rejoined,
    /// These spots stay open, as there are too few modules that could take them. Told by the convener.
    SpotsLeftOpen(Vec<SpotId>),
    /// The plan's acting order has a flaw.
    AssemblyWarning(crate::model::AssemblyWarning),
    /// The target was withdrawn; modules stay where they are.
    TargetWithdrawn,
}

/// Why an epoch is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EpochReason {
    /// There is a target and no plan for it.
    NewTarget,
    /// Members have fallen silent.
    Silent(Vec<ModuleId>),
    /// Members have started anew.
    Restarted(Vec<ModuleId>),
    /// Modules without a spot could fill open spots.
    Newcomers(Vec<ModuleId>),
    /// Members make no progress.
    Stuck(Vec<ModuleId>),
    /// Members no longer take spots.
    OutOfService(Vec<(ModuleId, Service)>),
    /// Members hold different plans.
    DigestMismatch,
    /// The convener of the last gathering never published a roster.
    ConvenerSilent(ModuleId),
}

fn listed(modules: &[ModuleId]) -> String {
    modules
        .iter()
        .map(|module| module.0.to_string())
        .collect::<Vec<_>>()
        .join(", ")
}

impl fmt::Display for EpochReason {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NewTarget => write!(formatter, "there is a target and no plan for it"),
            Self::Silent(modules) => write!(formatter, "not heard any more: {}", listed(modules)),
            Self::Restarted(modules) => write!(formatter, "started anew: {}", listed(modules)),
            Self::Newcomers(modules) => write!(formatter, "new and wanted: {}", listed(modules)),
            Self::Stuck(modules) => write!(formatter, "no progress: {}", listed(modules)),
            Self::OutOfService(modules) => {
                let named: Vec<String> = modules
                    .iter()
                    .map(|(module, service)| format!("{} ({service})", module.0))
                    .collect();
                write!(formatter, "out of service: {}", named.join(", "))
            }
            Self::DigestMismatch => write!(formatter, "members hold different plans"),
            Self::ConvenerSilent(module) => write!(formatter, "{module} convened and fell silent"),
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
            } => write!(
                formatter,
                "planned {epoch} in {turns} turns and {} ms, digest {digest}",
                elapsed.as_millis()
            ),
            Self::Agreed(epoch) => write!(formatter, "all members agree on {epoch}"),
            Self::MotionBegun(spot) => write!(formatter, "moving to {spot}"),
            Self::Settled(spot) => write!(formatter, "settled on {spot}"),
            Self::Spare => write!(formatter, "has no spot and stands by"),
            Self::Evicted { by, from } => write!(formatter, "left {from} to {by}"),
            Self::Refused {
                module: Some(module),
                reason,
            } => {
                write!(formatter, "refused a message of {module}: {reason}")
            }
            Self::Refused {
                module: None,
                reason,
            } => write!(formatter, "refused a message: {reason}"),
            Self::Missing {
                expected,
                gathered,
                absent,
            } => {
                match expected {
                    Some(expected) => {
                        write!(formatter, "{gathered} of {expected} modules have gathered")?;
                    }
                    None => {
                        write!(formatter, "{gathered} modules have gathered")?;
                    }
                }
                if absent.is_empty() {
                    Ok(())
                } else {
                    write!(formatter, "; absent: {}", listed(absent))
                }
            }
            Self::WaitingForQuorum { present, basis } => write!(
                formatter,
                "waiting for a quorum: {present} of {basis} modules are within reach"
            ),
            Self::WaitingForAgreement(modules) => {
                write!(
                    formatter,
                    "no agreement yet from modules {}",
                    listed(modules)
                )
            }
            Self::WaitingFor(modules) => write!(
                formatter,
                "waiting for modules {} to settle",
                listed(modules)
            ),
            Self::DigestMismatch {
                module,
                theirs,
                ours,
            } => write!(
                formatter,
                "{module} holds another plan: its digest is {theirs}, ours {ours}"
            ),
            Self::PlansDiffer(sides) => {
                let named: Vec<String> = sides
                    .iter()
                    .map(|(digest, modules)| format!("{digest} held by {}", listed(modules)))
                    .collect();
                write!(
                    formatter,
                    "gives up: twice in a row the members hold different plans: {}",
                    named.join("; ")
                )
            }
            Self::DuplicateModule(module) => {
                write!(
                    formatter,
                    "a second process runs as {module}: it is refused until the first has been silent for suspicion_s"
                )
            }
            Self::AgreementLapsed(modules) => write!(
                formatter,
                "halted until modules {} are heard again",
                listed(modules)
            ),
            Self::MotionOverdue(spot) => {
                write!(formatter, "did not reach {spot} within motion_limit_s")
            }
            Self::MotionFailed(Some(spot)) => write!(
                formatter,
                "cannot reach {spot}: its drive or ports gave up; it takes part no more until it is told to rejoin"
            ),
            Self::MotionFailed(None) => write!(
                formatter,
                "its drive or ports gave up; it takes part no more until it is told to rejoin"
            ),
            Self::Retired => write!(formatter, "retired: it leaves the formation"),
            Self::Rejoined => write!(formatter, "takes part again"),
            Self::SpotsLeftOpen(spots) => {
                let ids: Vec<String> = spots.iter().map(|spot| spot.0.to_string()).collect();
                write!(
                    formatter,
                    "too few modules: spots {} stay open",
                    ids.join(", ")
                )
            }
            Self::AssemblyWarning(warning) => write!(formatter, "acting order: {warning}"),
            Self::TargetWithdrawn => write!(formatter, "the target was withdrawn"),
        }
    }
}

impl Event {
    /// How much a person should care.
    #[must_use]
    pub fn severity(&self) -> Severity {
        match self {
            Self::DigestMismatch { .. }
            | Self::PlansDiffer(_)
            | Self::DuplicateModule(_)
            | Self::MotionOverdue(_)
            | Self::MotionFailed(_) => Severity::Error,
            Self::Refused { .. }
            | Self::Missing { .. }
            | Self::WaitingForQuorum { .. }
            | Self::AgreementLapsed(_)
            | Self::SpotsLeftOpen(_)
            | Self::AssemblyWarning(_) => Severity::Warning,
            _ => Severity::Info,
        }
    }
}

/// What an agent wants done.
#[derive(Clone, Debug)]
pub enum Output {
    /// Tell the others.
    Publish(Message),
    /// Go there.
    Move(MotionGoal),
    /// Stand still, and report [`MotionReport::Halted`].
    Halt,
    /// Let go of this module, and report [`MotionReport::Undocked`].
    Undock(ModuleId),
    /// Dock to this module, and report [`MotionReport::Docked`].
    Dock(ModuleId),
    /// Note this.
    Event(Event),
}
