//! The invariants, by the name of their violation.

use std::fmt;
use std::time::Duration;

/// An invariant that was violated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ViolationKind {
    /// Two modules settled on one spot of one plan.
    TwoModulesOnOneSpot,
    /// A module settled on a spot on which another one stands, or stands by there without a spot, whatever their plans.
    TwoBodiesOnOneSpot,
    /// A module settled on two spots of one plan.
    OneModuleOnTwoSpots,
    /// A module began to move before every member had shown the same digest.
    MotionWithoutAgreement,
    /// A module began to move before the lease had passed since the last member showed the digest.
    MotionBeforeLease,
    /// A module moved long after a member had left the epoch.
    MotionOnStalePlan,
    /// Two modules moved on different plans at the same time.
    TwoPlansInMotion,
    /// A claim evicted a module that belongs to a configuration, or is pinned.
    ConfigurationMemberEvicted,
    /// Two rosters were published for one epoch.
    TwoRostersForOneEpoch,
    /// After the faults stopped, the modules neither formed nor waited for a quorum.
    NoEnd,
    /// They formed, but did not fill exactly the spots that there were modules for.
    Hole,
    /// A module returned to an epoch that it had left.
    EpochWentBack,
    /// Two modules of different units moved at the same time, on one plan.
    TwoUnitsInMotion,
    /// While modules moved along paths, the bodies of two that were not docked to each other overlapped.
    BodiesOverlap,
    /// A module that had settled for a target froze for it without a pin.
    PinForgotten,
    /// A module plans or agrees with another pose than the roster lists.
    NotWhereFrozen,
    /// The modules of a quorum are live and reach each other, and still wait for one.
    QuorumDenied,
    /// A module reports that it has settled, and does not stand on its spot.
    SettledElsewhere,
    /// Two groups that cannot reach each other both hold a formation.
    TwoFormations,
}

impl fmt::Display for ViolationKind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::TwoModulesOnOneSpot => "two modules on one spot",
            Self::TwoBodiesOnOneSpot => "two bodies on one spot",
            Self::OneModuleOnTwoSpots => "one module on two spots",
            Self::MotionWithoutAgreement => "motion without agreement",
            Self::MotionBeforeLease => "motion before the lease",
            Self::MotionOnStalePlan => "motion on a stale plan",
            Self::TwoPlansInMotion => "two plans in motion",
            Self::ConfigurationMemberEvicted => "configuration member evicted",
            Self::TwoRostersForOneEpoch => "two rosters for one epoch",
            Self::NoEnd => "no end",
            Self::Hole => "hole",
            Self::EpochWentBack => "epoch went back",
            Self::TwoUnitsInMotion => "two units in motion",
            Self::BodiesOverlap => "bodies overlap",
            Self::PinForgotten => "pin forgotten",
            Self::NotWhereFrozen => "not where frozen",
            Self::QuorumDenied => "quorum denied",
            Self::SettledElsewhere => "settled elsewhere",
            Self::TwoFormations => "two formations",
        })
    }
}

/// One violation of an invariant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// When it was observed.
    pub at: Duration,
    /// The invariant.
    pub kind: ViolationKind,
    /// The modules and the plan.
    pub detail: String,
}
