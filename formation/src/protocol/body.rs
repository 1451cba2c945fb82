//! The module's body: its pose, its links, and what its drive and ports are doing.

use std::collections::BTreeSet;

use crate::model::{Digest, ModuleId, Pose, Service, SpotId};

/// The spot on which a module has settled, and the target that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct SettledOn {
    pub spot: SpotId,
    pub target: Digest,
}

/// What the module is and has, whatever the protocol decides.
#[derive(Clone, Debug, Hash)]
pub(super) struct Body {
    pub pose: Pose,
    pub links: BTreeSet<ModuleId>,
    pub service: Service,
    pub settled_on: Option<SettledOn>,
    /// Whether the drive has a goal and has reported neither a halt nor its arrival.
    pub moving: bool,
    /// The modules to which it has asked its ports to dock, or from which to undock, without a report so far.
    pub ports_busy: BTreeSet<ModuleId>,
}

impl Body {
    pub fn new(pose: Pose, links: BTreeSet<ModuleId>) -> Self {
        Self {
            pose,
            links,
            service: Service::Active,
            settled_on: None,
            moving: false,
            ports_busy: BTreeSet::new(),
        }
    }

    /// Whether its pose and links stay as they are until the next goal.
    pub fn is_at_rest(&self) -> bool {
        !self.moving && self.ports_busy.is_empty()
    }
}
