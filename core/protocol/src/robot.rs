//! The module's own robot: its pose, its links, and what its drive and ports are doing.

use std::collections::BTreeSet;
use std::time::Duration;

use formation_model::{
    BodyReport, Digest, DriveState, Epoch, MicroUnits, ModuleId, Pose, SenderTime, Service, SpotId,
};

/// The spot on which a module has settled, and the target that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct SettledOn {
    pub spot: SpotId,
    pub target: Digest,
}

/// What the module is and has, whatever the protocol decides.
#[derive(Clone, Debug, Hash)]
pub(super) struct Robot {
    pub pose: Pose,
    /// When a module that moves had this pose.
    pub pose_at: SenderTime,
    /// The standard deviation of its position that its driver states.
    pub deviation: MicroUnits,
    pub links: BTreeSet<ModuleId>,
    pub service: Service,
    pub settled_on: Option<SettledOn>,
    /// Whether the drive has a goal and has reported neither a halt nor its arrival.
    pub moving: bool,
    /// Whether its measured pose is believed: its driver states no doubt, and its locked ports agree with it.
    pub is_localised: bool,
    /// The epoch whose roster lists this module elsewhere than it is measured, and how far off: it was moved after it had frozen.
    pub moved_in: Option<(Epoch, MicroUnits)>,
    /// Whether the drive failed, and has not been measured to stand since.
    pub has_failed: bool,
    /// If it is out of service because it found no path: the absent bodies that it knew then.
    pub kept_by: Option<Vec<BodyReport>>,
    /// The modules to which it has asked its ports to dock, or from which to undock, without a report so far.
    pub ports_busy: BTreeSet<ModuleId>,
    /// The modules from which it was torn: its ports opened unasked. While they still show themselves docked to it, that is no docking.
    pub torn_off: BTreeSet<ModuleId>,
}

impl Robot {
    pub fn new(pose: Pose, links: BTreeSet<ModuleId>) -> Self {
        Self {
            pose,
            pose_at: SenderTime::default(),
            deviation: MicroUnits(0),
            links,
            service: Service::Active,
            settled_on: None,
            moving: false,
            is_localised: true,
            moved_in: None,
            has_failed: false,
            kept_by: None,
            ports_busy: BTreeSet::new(),
            torn_off: BTreeSet::new(),
        }
    }

    /// The drive reports a pose.
    pub fn stand_at(&mut self, pose: Pose, now: Duration) {
        self.pose = pose;
        self.pose_at = SenderTime(now);
    }

    /// Whether a later run takes part in plans: one that found no path finds out again.
    pub fn lasting_service(&self) -> Service {
        match self.kept_by {
            Some(_) => Service::Active,
            None => self.service,
        }
    }

    /// When it had its pose, and what its drive does since then.
    pub fn drive_state(&self, now: Duration) -> (SenderTime, DriveState) {
        match self.moving {
            true => (self.pose_at, DriveState::Moving),
            false => (SenderTime(now), DriveState::Standing),
        }
    }

    /// Whether its pose and links stay as they are until the next goal.
    pub fn is_at_rest(&self) -> bool {
        !self.moving && self.ports_busy.is_empty()
    }
}
