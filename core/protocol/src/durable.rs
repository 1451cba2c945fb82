//! What a module must not forget when its process ends, and when it must be in the store.
//!
//! The rule is that of a write-ahead log: whatever an agent publishes or does as a result of an input leaves the agent only
//! after its store holds what the result depends on (compare the `HardState` of raft). So the module never denies, after a
//! restart, an epoch that it entered, a digest that it showed, or a retirement that it confirmed, and a simulated module stands
//! where the others last saw it stand, docked to the same modules. Halting needs no store, and heartbeats go on meanwhile: they
//! repeat what was shown before.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use formation_model::{
    BodyReport, Digest, Epoch, Incarnation, ModuleId, Pose, Service, SpotId, Stop, Voters,
};

use super::robot::SettledOn;

/// What the store of a module holds.
///
/// What grows with the number of modules (voters, bodies) is the same for most modules of a process. A host keeps it
/// once for all of them, so it is not serialised here.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DurableState {
    /// The latest epoch that it entered.
    pub entered: Option<Epoch>,
    /// The highest epoch that it knows of.
    pub highest: Option<Epoch>,
    /// Whether it has forgotten nothing that it agreed on.
    pub knows: bool,
    /// The voters of the session.
    #[serde(skip)]
    pub voters: Voters,
    /// Whether it takes part in plans.
    pub service: Service,
    /// The spot on which it has settled, and the digest of the target of that spot.
    pub settled_on: Option<(SpotId, Digest)>,
    /// Its pose when this was written.
    pub pose: Pose,
    /// The modules that it was docked to then.
    pub links: BTreeSet<ModuleId>,
    /// Where the bodies of other modules may be, and which were removed; ascending by module.
    #[serde(skip)]
    pub bodies: Arc<[BodyReport]>,
    /// The latest command to stop or to resume.
    pub stop: Stop,
}

/// The part of a durable state without which nothing may be published.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct SyncKey {
    pub incarnation: Incarnation,
    pub entered: Option<Epoch>,
    pub shows_digest: bool,
    pub knows: bool,
    /// The numbers of votes that were removed, and that rosters list as removed.
    pub votes_removed: (usize, usize),
    pub service: Service,
    pub settled_on: Option<SettledOn>,
    /// Where the module stands; `None` on its way.
    pub stands_at: Option<Pose>,
    pub links: BTreeSet<ModuleId>,
    /// Whether all members have done their parts of the plan, so that nobody is on the way any more.
    pub is_carried_out: bool,
    /// Rises whenever a removal is over. One that a roster lists is written before the digest of the plan is shown.
    pub removals: u64,
    pub stop: Stop,
}

/// The part of a key on which the bodies in a durable state depend.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BodiesKey {
    pub entered: Option<Epoch>,
    pub shows_digest: bool,
    pub service: Service,
    pub is_carried_out: bool,
    pub removals: u64,
}

/// The bodies that were given to the store last.
#[derive(Clone, Debug)]
pub(super) struct StoredBodies {
    pub key: BodiesKey,
    pub bodies: Arc<[BodyReport]>,
}

impl SyncKey {
    /// The part on which the bodies depend.
    pub fn of_bodies(&self) -> BodiesKey {
        BodiesKey {
            entered: self.entered,
            shows_digest: self.shows_digest,
            service: self.service,
            is_carried_out: self.is_carried_out,
            removals: self.removals,
        }
    }

    /// Whether a plan for this epoch is shown.
    pub fn shows_plan_of(&self, epoch: Epoch) -> bool {
        self.shows_digest && self.entered == Some(epoch)
    }
}
