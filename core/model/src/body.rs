//! The bodies of modules that take no part in a plan, and the spots that they block.
//!
//! A body stands where it was last seen. That its module is silent, or that its process ended, removes no body; a removal
//! report does. A spot is blocked if a body may reach into its cell.

use std::cmp::Ordering;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::{
    Epoch, Incarnation, MICRO_PER_UNIT, MicroUnits, ModuleId, ModuleRun, Polyline, Pose, SpotId,
    polyline,
};

/// A body that may stand nearer to a place than this is counted there.
pub const COVERING_DISTANCE: MicroUnits = MicroUnits(MICRO_PER_UNIT / 2);

/// A body that stands no farther than this from where a report says that it may stand is where that says: what is measured twice
/// differs a little.
const MEASURED_AGAIN: MicroUnits = MicroUnits(MICRO_PER_UNIT / 50);

/// A longer path is looked at in fewer places: about this many in all.
const SAMPLES: i64 = 1_000;

/// Where a body is. Within one epoch, a later variant supersedes an earlier one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Whereabouts {
    /// It was last seen here, by a module that does not know whether a plan allowed it to move on.
    Seen(Pose),
    /// A plan allowed it to move on along these lines from where it was last seen.
    OnTheWay(Polyline),
    /// The same, as a part of a block or of a group that comes onto the lattice: the others may be where it was, where it is to be, or
    /// above it in a fold.
    InBlock(Polyline),
    /// It stands here: it has settled, stays where it is, or cannot have set off.
    Halted(Pose),
    /// It was reported as removed.
    Removed,
}

impl Whereabouts {
    /// Within one epoch, a higher rank supersedes a lower one. Digests contain the numbers.
    pub(super) fn rank(&self) -> u8 {
        match self {
            Self::Seen(_) => 0,
            Self::OnTheWay(_) => 1,
            Self::InBlock(_) => 2,
            Self::Halted(_) => 3,
            Self::Removed => 4,
        }
    }

    /// Where the body may stand: on the lines from each pose to the next. Empty once it was removed.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        match self {
            Self::Seen(pose) | Self::Halted(pose) => std::slice::from_ref(pose),
            Self::OnTheWay(line) | Self::InBlock(line) => line.poses(),
            Self::Removed => &[],
        }
    }

    /// Whether a body is at the same place, within a limit, in whatever way that is known: what is known of a body that stands changes
    /// its form from epoch to epoch.
    #[must_use]
    pub fn is_near(&self, other: &Self, limit: MicroUnits) -> bool {
        let (one, other) = (self.poses(), other.poses());
        let mut pairs = one.iter().zip(other);
        one.len() == other.len() && pairs.all(|(one, other)| one.distance_to(other) <= limit)
    }
}

/// What is known of the body of one module, or that it was removed.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct BodyReport {
    /// The module.
    pub module: ModuleId,
    /// The run that was last seen, or that was removed.
    pub incarnation: Incarnation,
    /// The epoch in which it was last seen; `None` before its first.
    pub epoch: Option<Epoch>,
    /// The sequence number of the state that showed it; 0 if a roster did.
    pub sequence: u64,
    /// Where it is.
    pub whereabouts: Whereabouts,
}

impl BodyReport {
    /// The run that it is about.
    pub fn run(&self) -> ModuleRun {
        self.module.run(self.incarnation)
    }

    /// Orders reports on one module: a later run supersedes an earlier one, and a removal everything else of its run.
    /// Enforces B1.
    #[must_use]
    pub fn compare_age(&self, other: &Self) -> Ordering {
        fn key(report: &BodyReport) -> impl Ord {
            let whereabouts = &report.whereabouts;
            (
                report.incarnation,
                *whereabouts == Whereabouts::Removed,
                report.epoch,
                whereabouts.rank(),
                report.sequence,
                whereabouts,
            )
        }
        key(self).cmp(&key(other))
    }

    /// Whether it may stand nearer to a pose than half a unit.
    pub fn covers(&self, pose: &Pose) -> bool {
        let distance = polyline::distance(pose, self.whereabouts.poses());
        distance.is_some_and(|distance| distance < COVERING_DISTANCE)
    }
}

/// A spot that a body covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct BlockedSpot {
    /// The spot.
    pub spot: SpotId,
    /// The module whose body covers it, the lowest of several.
    pub module: ModuleId,
}

impl fmt::Display for BlockedSpot {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { spot, module } = self;
        write!(formatter, "{spot} is blocked by the body of {module}")
    }
}

/// Whether these reports, at most one for each module, say of a body that it may stand wherever `known` says.
pub fn account_for(reports: &[BodyReport], known: &BodyReport) -> bool {
    let report = reports.iter().find(|one| one.module == known.module);
    let listed = report.map_or(&[][..], |report| report.whereabouts.poses());
    let is_listed = |pose: &Pose| {
        let distance = polyline::distance(pose, listed);
        distance.is_some_and(|distance| distance <= MEASURED_AGAIN)
    };
    let path = known.whereabouts.poses();
    let spacing = polyline::length(path).0 / SAMPLES + MICRO_PER_UNIT / 2;
    let mut poses = polyline::sampled(path, MicroUnits(spacing));
    poses.all(|pose| is_listed(&pose))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> Pose {
        Pose::from_units(x, 0.0, 0.0).unwrap()
    }

    #[test]
    fn a_body_is_near_where_it_was_in_whatever_way_that_is_known() {
        let limit = MicroUnits::from_units(0.1).unwrap();
        let is_near = |one: &Whereabouts, other| one.is_near(&other, limit);
        let seen = Whereabouts::Seen(at(1.0));
        assert!(is_near(&seen, Whereabouts::Halted(at(1.05))));
        assert!(!is_near(&seen, Whereabouts::Halted(at(1.2))));
        assert!(!is_near(&seen, Whereabouts::Removed));
        let line = |x| Polyline::line(at(1.0), at(x));
        assert!(!is_near(&seen, Whereabouts::OnTheWay(line(2.0))));
        let on_the_way = Whereabouts::OnTheWay(line(2.0));
        assert!(is_near(&on_the_way, Whereabouts::InBlock(line(2.0))));
        assert!(!is_near(&on_the_way, Whereabouts::InBlock(line(3.0))));
    }
}
