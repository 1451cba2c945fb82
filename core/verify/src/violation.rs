//! The violations of a plan or a formation, and what an unfinished formation lacks.

use std::time::Duration;

use thiserror::Error;

use formation_model::{Digest, Epoch, MicroUnits, ModuleId, ModulePhase, SpotId};

/// The greatest number of violations that are listed.
pub(super) const VIOLATIONS_MAX: usize = 256;

/// A guarantee that was broken. The message of each variant describes it and names the modules and spots concerned.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Error)]
#[expect(missing_docs, reason = "the message of each variant describes it")]
pub enum Violation {
    // Of the turns, replayed one by one.
    #[error("{module} is named but takes no part")]
    UnknownModule { module: ModuleId },
    #[error("{spot} is named, but the target does not have it")]
    UnknownSpot { spot: SpotId },
    #[error("turn {turn} gives {module} two spots")]
    TwoSpots { turn: u32, module: ModuleId },
    #[error("turn {turn} gives {spot} to {module}, but {holder} holds it and is not evicted")]
    SpotTaken {
        turn: u32,
        spot: SpotId,
        module: ModuleId,
        holder: ModuleId,
    },
    /// An eviction contradicts the spots held before it, or the evicted module's new spot.
    #[error("turn {turn} evicts {module} from {spot}, which contradicts the spots held then")]
    WrongEviction {
        turn: u32,
        module: ModuleId,
        spot: SpotId,
    },
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
    /// A pinned module is given another spot, or loses its own.
    #[error("{module} is pinned to {pin}, but ends with {}", or_nothing(*spot))]
    PinLost {
        module: ModuleId,
        pin: SpotId,
        spot: Option<SpotId>,
    },
    /// A module ends with another spot than the target gives it.
    #[error("{module} ends with {}, but the target gives it {}", or_nothing(*spot), or_nothing(*given))]
    NotAsGiven {
        module: ModuleId,
        given: Option<SpotId>,
        spot: Option<SpotId>,
    },
    #[error("turn {turn} makes {evictions} evictions; at most {limit} are allowed")]
    ChainTooLong {
        turn: u32,
        evictions: usize,
        limit: u32,
    },
    #[error("turn {turn} detaches {module}, which holds {spot} already")]
    DetachedTooLate {
        turn: u32,
        module: ModuleId,
        spot: SpotId,
    },
    /// A swap after the claims would open a spot, move a pinned module, or give a module two spots.
    #[error("turn {turn} swaps {module} to {spot}, which it may not")]
    WrongSwap {
        turn: u32,
        spot: SpotId,
        module: ModuleId,
    },
    #[error("turn {turn} follows one after which spots were swapped")]
    SwapTooEarly { turn: u32 },
    /// There are more turns than two for each module (guarantee 1).
    #[error("{turns} turns for {modules} modules")]
    TooManyTurns { turns: usize, modules: usize },

    // Of the outcome.
    /// The number of filled spots is wrong (guarantee 2).
    #[error("{filled} spots are filled, not {expected}")]
    WrongCount { filled: usize, expected: usize },
    #[error("{spot} has two holders, {first} and {second}")]
    TwoHolders {
        spot: SpotId,
        first: ModuleId,
        second: ModuleId,
    },
    /// The filled spots are disconnected although the modules suffice to connect them.
    #[error(
        "the filled spots are disconnected: {unreached} cannot be reached from {from} over filled spots"
    )]
    Apart { from: SpotId, unreached: SpotId },
    #[error(
        "the turns lead {module} to {}, the plan says {}", or_nothing(*claimed), or_nothing(*planned)
    )]
    ReplayDiffers {
        module: ModuleId,
        claimed: Option<SpotId>,
        planned: Option<SpotId>,
    },
    /// A block is listed that no turn placed, or a block that a turn placed is not listed.
    #[error("the blocks of the plan are not those of its turns: {module} differs")]
    WrongBlock { module: ModuleId },
    #[error("the block of {first} is not connected by kept links: they do not reach {unreached}")]
    BlockApart {
        first: ModuleId,
        unreached: ModuleId,
    },
    #[error("the link of {first} and {second} is {}", if *listed { "listed as kept but is not" } else { "kept but not listed" })]
    WrongKeptLink {
        first: ModuleId,
        second: ModuleId,
        listed: bool,
    },
    #[error("the acting order lists {module} {times} times on the spot that it takes, not once")]
    WrongListing { module: ModuleId, times: usize },
    /// An acting unit is not exactly one block or one single module, or its lead is not its lowest module.
    #[error(
        "the acting unit of {lead} is not exactly one block or one single module, led by its lowest module"
    )]
    WrongUnit { lead: ModuleId },
    /// An acting unit is marked as pinned although its modules are not, or the reverse, or is pinned and follows one that
    /// moves.
    #[error(
        "the acting unit of {lead} is wrongly marked as pinned or moving, or is pinned and follows a moving one"
    )]
    WrongPin { lead: ModuleId },
    /// A spot is filled while no adjacent one is, although it is not the first of its connected part.
    #[error("{module} fills {spot} before any adjacent spot is filled")]
    NoPlacedNeighbour { module: ModuleId, spot: SpotId },

    // Of a formation, as seen on the topics.
    #[error("two rosters of {epoch} differ")]
    RostersDiffer { epoch: Epoch },
    #[error("the roster of {epoch} has another target than the announcement of the same revision")]
    TargetDiffers { epoch: Epoch },
    #[error("the roster of {epoch} contradicts itself: {reason}")]
    RosterInvalid { epoch: Epoch, reason: String },
    /// Two different claims for one turn are both possible.
    #[error("two different claims were made for turn {turn} of {epoch}")]
    ClaimsDiffer { epoch: Epoch, turn: u32 },
    #[error("{module} moves without the digest of a plan, or counts no steps of it")]
    MovedWithoutPlan { module: ModuleId },
    #[error("{first} acts on plan {first_digest}, {second} on plan {second_digest} in {epoch}")]
    PlansDiffer {
        epoch: Epoch,
        first: ModuleId,
        first_digest: Digest,
        second: ModuleId,
        second_digest: Digest,
    },
    #[error(
        "{module} is {distance} units off its pose in the roster of {epoch} although its state is not MOVING"
    )]
    MovedEarly {
        epoch: Epoch,
        module: ModuleId,
        distance: MicroUnits,
    },
    /// A unit moved on a heartbeat that its sender published before it agreed.
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
    /// The causal past of a unit does not prove the agreement of all members.
    #[error("{module} moved in {epoch} without proof that {member} agreed")]
    AgreementNotShown {
        epoch: Epoch,
        module: ModuleId,
        member: ModuleId,
    },
    #[error(
        "{module} counted {other} as settled in {epoch} at its state {sequence}, but it had not settled"
    )]
    WaitedForUnsettled {
        epoch: Epoch,
        module: ModuleId,
        other: ModuleId,
        sequence: u64,
    },
    #[error("the unit of {module} and others claim in {epoch} that they waited for each other")]
    CircularWait { epoch: Epoch, module: ModuleId },
    /// The times are those of the senders' clocks.
    #[error(
        "{first} and {second} overlap by {depth} units in {epoch} at {} s",
        at.as_secs_f64()
    )]
    BodiesOverlap {
        epoch: Epoch,
        first: ModuleId,
        second: ModuleId,
        depth: MicroUnits,
        at: Duration,
    },
    /// A step began while another module had not left the cells of the step, or had not done the step before of a block.
    #[error(
        "{module} began step {step} of its path in {epoch} {} s too early for {other} at {} s",
        early.as_secs_f64(),
        at.as_secs_f64()
    )]
    WaitNotKept {
        epoch: Epoch,
        module: ModuleId,
        step: u32,
        other: ModuleId,
        early: Duration,
        at: Duration,
    },
    /// Docked modules did not keep their places to each other in a step that is no fold.
    #[error(
        "{first} and {second} are docked and {off} units off their places to each other after step {step} in {epoch} at {} s",
        at.as_secs_f64()
    )]
    BlockTorn {
        epoch: Epoch,
        first: ModuleId,
        second: ModuleId,
        step: u32,
        off: MicroUnits,
        at: Duration,
    },
    #[error("{module} settled on {}, the claims say {}", or_nothing(*held), or_nothing(*claimed))]
    WrongSpot {
        module: ModuleId,
        held: Option<SpotId>,
        claimed: Option<SpotId>,
    },
    /// A module stands within half a unit of a spot on which another has settled.
    #[error("{first} and {second} both stand on {spot}")]
    TwoBodies {
        spot: SpotId,
        first: ModuleId,
        second: ModuleId,
    },
    #[error("{module} stands {distance} units and {turn} radians off the pose of {spot}")]
    PoseOff {
        module: ModuleId,
        spot: SpotId,
        distance: MicroUnits,
        turn: MicroUnits,
    },
    /// Two modules on adjacent spots are not docked, or only one of them names the link.
    #[error("{module} is not docked to {other}, which holds an adjacent spot")]
    LinkMissing { module: ModuleId, other: ModuleId },
    #[error("{module} is docked to {other}, which holds no adjacent spot")]
    LinkTooMany { module: ModuleId, other: ModuleId },
}

impl Violation {
    /// Whether no message shows the violation, but none shows either that the promise was kept. In an epoch that has ended, the
    /// messages that would have shown it may never come.
    pub(super) fn is_lack_of_proof(&self) -> bool {
        matches!(
            self,
            Self::AgreementNotShown { .. } | Self::NoPlacedNeighbour { .. }
        )
    }
}

/// What an unfinished formation lacks; after the time limit, the reason of its failure. The message of each variant describes
/// it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Error)]
#[expect(missing_docs, reason = "the message of each variant describes it")]
pub enum Missing {
    #[error("no target was announced")]
    Target,
    #[error("the target was withdrawn")]
    WithdrawnTarget,
    #[error("{joined} of {expected} modules have joined")]
    Modules { joined: usize, expected: usize },
    #[error("{module} has not joined")]
    Module { module: ModuleId },
    #[error("no roster was announced for target revision {revision}")]
    Roster { revision: u64 },
    #[error("the claim of turn {turn} of {epoch} is missing")]
    Claim { epoch: Epoch, turn: u32 },
    /// A member has not shown the digest that most members have shown.
    #[error("{module} did not agree in {epoch}{}", in_phase(*phase))]
    Agreement {
        epoch: Epoch,
        module: ModuleId,
        phase: Option<ModulePhase>,
    },
    #[error("{module} has not settled on {spot}{}", in_phase(*phase))]
    Settled {
        module: ModuleId,
        spot: SpotId,
        phase: Option<ModulePhase>,
    },
    #[error("{module} has been silent for more than {} s", silence.as_secs_f64())]
    Silent { module: ModuleId, silence: Duration },
    /// Of a target that says who takes which spot.
    #[error("the target gives {module} a spot, so the others wait for another target")]
    Given { module: ModuleId },
    #[error("{module} has no spot but is not SPARE{}", in_phase(*phase))]
    Spare {
        module: ModuleId,
        phase: Option<ModulePhase>,
    },
    #[error("{spot} is empty")]
    Spot { spot: SpotId },
    #[error("all modules are stopped by command, until `formation resume`")]
    Resumption,
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
