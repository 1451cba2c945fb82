//! The invariants, by the name of their violation.

use std::time::Duration;

use thiserror::Error;

/// An invariant that was violated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Error)]
pub enum ViolationKind {
    /// Two modules settled on one spot of one plan.
    #[error("two modules on one spot")]
    TwoModulesOnOneSpot,
    /// A module settled on a spot on which another one stands, or stands by there without a spot, whatever their plans.
    #[error("two bodies on one spot")]
    TwoBodiesOnOneSpot,
    /// A module settled on two spots of one plan.
    #[error("one module on two spots")]
    OneModuleOnTwoSpots,
    /// A module began to move before every member had shown the same digest.
    #[error("motion without agreement")]
    MotionWithoutAgreement,
    /// A module began to move before the lease had passed since a voter of its roster showed another plan.
    #[error("motion before the lease")]
    MotionBeforeLease,
    /// A module moved long after a member had left the epoch.
    #[error("motion on a stale plan")]
    MotionOnStalePlan,
    /// Two modules moved on different plans at the same time.
    #[error("two plans in motion")]
    TwoPlansInMotion,
    /// A claim evicted a module that belongs to a configuration, or is pinned.
    #[error("configuration member evicted")]
    ConfigurationMemberEvicted,
    /// Two rosters were published for one epoch.
    #[error("two rosters for one epoch")]
    TwoRostersForOneEpoch,
    /// After the faults stopped, the modules neither formed nor waited for a quorum.
    #[error("no end")]
    NoEnd,
    /// They formed, but did not fill exactly the spots that there were modules for.
    #[error("hole")]
    Hole,
    /// They formed, but modules on adjacent spots are not docked.
    #[error("not docked")]
    NotDocked,
    /// A module returned to an epoch that it had left.
    #[error("epoch went back")]
    EpochWentBack,
    /// While modules moved along paths, the bodies of two that were not docked to each other overlapped.
    #[error("bodies overlap")]
    BodiesOverlap,
    /// A module that had settled for a target froze for it without a pin.
    #[error("pin forgotten")]
    PinForgotten,
    /// A module plans or agrees with another pose than the roster lists.
    #[error("not where frozen")]
    NotWhereFrozen,
    /// The modules of a quorum are live and reach each other, and still wait for one.
    #[error("quorum denied")]
    QuorumDenied,
    /// A module reports that it has settled, and does not stand on its spot.
    #[error("settled elsewhere")]
    SettledElsewhere,
    /// Two groups that cannot reach each other both hold a formation.
    #[error("two formations")]
    TwoFormations,
    /// The verifier reported FAILED although no invariant was violated and, where something was missing, although the modules
    /// had formed.
    #[error("false verdict")]
    FalseVerdict,
    /// An invariant was violated, and the verifier received every state and is satisfied.
    #[error("missed by the verifier")]
    MissedByVerifier,
}

impl ViolationKind {
    /// Whether the messages of a run show the violation to an observer that receives them all. The others show in the drives, in
    /// what processes hold, or in the times of different processes, which no message carries; or they show to observers on both sides
    /// of a cut alone.
    pub(crate) fn is_shown_by_messages(self) -> bool {
        matches!(
            self,
            Self::ConfigurationMemberEvicted
                | Self::MotionWithoutAgreement
                | Self::NoEnd
                | Self::NotDocked
                | Self::OneModuleOnTwoSpots
                | Self::QuorumDenied
                | Self::TwoModulesOnOneSpot
                | Self::TwoRostersForOneEpoch
        )
    }
}

/// One violation of an invariant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BrokenInvariant {
    /// When it was observed.
    pub at: Duration,
    /// The invariant.
    pub kind: ViolationKind,
    /// The modules and the plan.
    pub detail: String,
}
