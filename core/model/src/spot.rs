//! Spots of a target.

use crate::{Pose, SpotId};

/// One place for a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Spot {
    /// The spot's identifier.
    pub id: SpotId,
    /// The pose of the module on it.
    pub pose: Pose,
}
