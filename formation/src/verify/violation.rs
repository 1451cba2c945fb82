//! What can be wrong with a plan or a formation, and what can be missing from one.

use std::time::Duration;

use thiserror::Error;

use crate::model::{Digest, Epoch, MicroUnits, ModuleId, ModulePhase, SpotId};

/// One guarantee that was violated; each message names the modules and spots concerned.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Error)]
#[expect(
    missing_docs,
    reason = "the fields are named as in the message of each variant"
)]
pub enum Violation {
    // Of the turns, replayed one by one.
    /// A decision or a plan names a module that takes no part.
    #[error("{module} is named but takes no part")]
    UnknownModule { module: ModuleId },
    /// A decision or a plan names a spot that the target does not have.
    #[error("{spot} is named, but the target does not have it")]
    UnknownSpot { spot: SpotId },
    /// A decision gives a module two spots.
    #[error("turn {turn} gives {module} two spots")]
    TwoSpots { turn: u32, module: ModuleId },
    /// A decision gives away a spot whose holder is not evicted from it.
    #[error("turn {turn} gives {spot} to {module}, but {holder} holds it and is not evicted")]
    SpotTaken {
        turn: u32,
        spot: SpotId,
        module: ModuleId,
        holder: ModuleId,
    },
    /// An eviction contradicts who held what, or where the decision sends the evicted module.
    #[error("turn {turn} evicts {module} from {spot}, which contradicts the spots held then")]
    WrongEviction {
        turn: u32,
        module: ModuleId,
        spot: SpotId,
    },
    /// A module changes its spot though no eviction explains it.
    #[error("turn {turn} moves {module} off {spot} without an eviction")]
    MovedWithoutEviction {
        turn: u32,
        module: ModuleId,
        spot: SpotId,
    },
    /// A module that was placed with its configuration loses its spot (guarantee 3 of the planning rules).
    #[error("turn {turn} evicts {module}, a member of a configuration, from {spot}")]
    MemberEvicted {
        turn: u32,
        module: ModuleId,
        spot: SpotId,
    },
    /// A module that stays where it settled is given another spot, or loses its own.
    #[error("{module} is pinned to {pin}, but ends with {}", or_nothing(*spot))]
    PinLost {
        module: ModuleId,
        pin: SpotId,
        spot: Option<SpotId>,
    },
    /// A chain is longer than the user allowed.
    #[error("turn {turn} makes {evictions} evictions; at most {limit} are allowed")]
    ChainTooLong {
        turn: u32,
        evictions: usize,
        limit: u32,
    },
    /// A module leaves its configuration after it has been placed.
    #[error("turn {turn} detaches {module}, which holds {spot} already")]
    DetachedTooLate {
        turn: u32,
        module: ModuleId,
        spot: SpotId,
    },
    /// More turns than placing each module and breaking up each configuration can take (guarantee 1).
    #[error("{turns} turns for {modules} modules")]
    TooManyTurns { turns: usize, modules: usize },

    // Of the outcome.
    /// Not as many spots are filled as can be (guarantee 2).
    #[error("{filled} spots are filled, not {expected}")]
    WrongCount { filled: usize, expected: usize },
    /// Two modules have one spot.
    #[error("{spot} has two holders, {first} and {second}")]
    TwoHolders {
        spot: SpotId,
        first: ModuleId,
        second: ModuleId,
    },
    /// The filled spots hang together in no way although they could.
    #[error(
        "the filled spots are apart: {unreached} cannot be reached from {from} over filled spots"
    )]
    Apart { from: SpotId, unreached: SpotId },
    /// The plan's assignment is not what its turns lead to.
    #[error(
        "the turns lead {module} to {}, the plan says {}", or_nothing(*claimed), or_nothing(*planned)
    )]
    ReplayDiffers {
        module: ModuleId,
        claimed: Option<SpotId>,
        planned: Option<SpotId>,
    },
    /// A group of modules is listed as a block, but no turn placed it so, or a block is not listed.
    #[error("the blocks of the plan are not those of its turns: {module} differs")]
    WrongBlock { module: ModuleId },
    /// A block is not held together by the links that it keeps.
    #[error("the block of {first} is not connected by kept links: {unreached} is apart")]
    BlockApart {
        first: ModuleId,
        unreached: ModuleId,
    },
    /// The list of kept links lacks one or has one too many.
    #[error("the link of {first} and {second} is {}", if *listed { "listed as kept but is not" } else { "kept but not listed" })]
    WrongKeptLink {
        first: ModuleId,
        second: ModuleId,
        listed: bool,
    },
    /// The acting order does not list each placed module once, on its spot.
    #[error("the acting order lists {module} {times} times on the spot that it takes, not once")]
    WrongListing { module: ModuleId, times: usize },
    /// An acting unit is not exactly one block or one single module, or is named wrongly.
    #[error(
        "the acting unit of {lead} is not exactly one block or one single module named by its lowest"
    )]
    WrongUnit { lead: ModuleId },
    /// An acting unit is called pinned and is not, or the other way round, or stands behind one that moves.
    #[error("the acting unit of {lead} is pinned, or not, or listed where it must not be")]
    WrongPin { lead: ModuleId },
    /// A spot is filled while no adjacent one is, though the part of the target it belongs to has been begun.
    #[error("{module} fills {spot} before any adjacent spot is filled")]
    NoPlacedNeighbour { module: ModuleId, spot: SpotId },

    // Of a formation, as seen on the topics.
    /// Two rosters of one epoch differ.
    #[error("two rosters of {epoch} differ")]
    RostersDiffer { epoch: Epoch },
    /// A roster carries another target than the announced one of the same revision.
    #[error("the roster of {epoch} carries another target than was announced as its revision")]
    TargetDiffers { epoch: Epoch },
    /// A roster contradicts itself.
    #[error("the roster of {epoch} contradicts itself: {reason}")]
    RosterInvalid { epoch: Epoch, reason: String },
    /// Two different decisions could each be the one of a turn.
    #[error("two different claims were made for turn {turn} of {epoch}")]
    ClaimsDiffer { epoch: Epoch, turn: u32 },
    /// A module moves without saying on which plan.
    #[error("{module} moves without the digest of a plan")]
    MovedWithoutPlan { module: ModuleId },
    /// Two modules act on different plans in one epoch.
    #[error("{first} acts on plan {first_digest}, {second} on plan {second_digest} in {epoch}")]
    PlansDiffer {
        epoch: Epoch,
        first: ModuleId,
        first_digest: Digest,
        second: ModuleId,
        second_digest: Digest,
    },
    /// A module left the pose that its roster froze before it was allowed to move.
    #[error(
        "{module} is {distance} units off its pose in the roster of {epoch} although it does not say that it moves"
    )]
    MovedEarly {
        epoch: Epoch,
        module: ModuleId,
        distance: MicroUnits,
    },
    /// A unit moved on a heartbeat that came before its sender agreed.
    #[error(
        "{module} moved in {epoch} on heartbeat {sequence} of {member}, which agreed only with heartbeat {agreed_since}"
    )]
    MovedBeforeAgreement {
        epoch: Epoch,
        module: ModuleId,
        member: ModuleId,
        sequence: u64,
        agreed_since: u64,
    },
    /// Nothing that a unit waited for leads back to an agreement of all members.
    #[error("{module} moved in {epoch} without proof that {member} agreed")]
    AgreementNotShown {
        epoch: Epoch,
        module: ModuleId,
        member: ModuleId,
    },
    /// A module counted another as settled that was not.
    #[error("{module} took {other} for settled in {epoch} at its state {sequence}, but it was not")]
    WaitedForUnsettled {
        epoch: Epoch,
        module: ModuleId,
        other: ModuleId,
        sequence: u64,
    },
    /// Units claim to have waited for each other.
    #[error("the units of {module} and others claim in {epoch} to have waited for each other")]
    CircularWait { epoch: Epoch, module: ModuleId },
    /// A module settled elsewhere than the claims say.
    #[error("{module} settled on {}, the claims say {}", or_nothing(*held), or_nothing(*claimed))]
    WrongSpot {
        module: ModuleId,
        held: Option<SpotId>,
        claimed: Option<SpotId>,
    },
    /// A settled module does not stand where its spot is.
    #[error("{module} stands {distance} units and {turn} radians off the pose of {spot}")]
    PoseOff {
        module: ModuleId,
        spot: SpotId,
        distance: MicroUnits,
        turn: MicroUnits,
    },
    /// Two modules on adjacent spots are not docked, or only one says so.
    #[error("{module} is not docked to {other}, which holds an adjacent spot")]
    LinkMissing { module: ModuleId, other: ModuleId },
    /// A settled module is docked to one that holds no adjacent spot.
    #[error("{module} is docked to {other}, which holds no adjacent spot")]
    LinkTooMany { module: ModuleId, other: ModuleId },
}

/// What a formation still lacks; after the time limit, why it failed.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Error)]
#[expect(
    missing_docs,
    reason = "the fields are named as in the message of each variant"
)]
pub enum Missing {
    /// No target was announced.
    #[error("no target was announced")]
    Target,
    /// The target was withdrawn.
    #[error("the target was withdrawn")]
    WithdrawnTarget,
    /// Fewer modules joined than were expected.
    #[error("{joined} of {expected} modules have joined")]
    Modules { joined: usize, expected: usize },
    /// No message of a module arrived.
    #[error("{module} has not joined")]
    Module { module: ModuleId },
    /// No roster of the newest target was announced.
    #[error("no roster was announced for target revision {revision}")]
    Roster { revision: u64 },
    /// A turn's claim did not arrive.
    #[error("the claim of turn {turn} of {epoch} is missing")]
    Claim { epoch: Epoch, turn: u32 },
    /// A member never showed that it holds the plan that it acts on, or holds another.
    #[error("{module} did not agree in {epoch}{}", in_phase(*phase))]
    Agreement {
        epoch: Epoch,
        module: ModuleId,
        phase: Option<ModulePhase>,
    },
    /// A module has not settled on its spot.
    #[error("{module} has not settled on {spot}{}", in_phase(*phase))]
    Settled {
        module: ModuleId,
        spot: SpotId,
        phase: Option<ModulePhase>,
    },
    /// A member fell silent, so its last state says nothing about now.
    #[error("{module} has been silent for more than {} s", silence.as_secs_f64())]
    Silent { module: ModuleId, silence: Duration },
    /// A module without a spot does not say that it is a spare.
    #[error("{module} has no spot but does not say that it is a spare{}", in_phase(*phase))]
    Spare {
        module: ModuleId,
        phase: Option<ModulePhase>,
    },
    /// A spot is empty.
    #[error("{spot} is empty")]
    Spot { spot: SpotId },
}

fn or_nothing(spot: Option<SpotId>) -> String {
    spot.map_or_else(|| "no spot".to_owned(), |spot| spot.to_string())
}

fn in_phase(phase: Option<ModulePhase>) -> String {
    phase.map_or_else(
        || "; no state of it arrived".to_owned(),
        |phase| format!("; it is {}", phase.name()),
    )
}
