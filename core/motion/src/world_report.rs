//! What a physical world counts, for programs.

use std::fmt;

use serde::{Deserialize, Serialize};

use formation_model::text::counted;

/// Counts of a physical world since its start. Lengths are in units. A world prints them as one JSON object a line, whenever
/// they change.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WorldReport {
    /// How often two modules that were not docked to one body met.
    pub contacts: u64,
    /// How many of these contacts were more than a touch: faster than [`Self::TOUCH_SPEED`] or deeper than
    /// [`Self::TOUCH_DEPTH`].
    pub contacts_above_touch: u64,
    /// The greatest speed at which two of them came closer when they met, in units a second.
    pub fastest_contact: f64,
    /// The deepest overlap of two of them, in units.
    pub deepest_overlap: f64,
    /// How often a module met an obstacle or a wall.
    pub wall_contacts: u64,
    /// Attempts to dock.
    pub docking_attempts: u64,
    /// Attempts to dock that failed.
    pub docking_failures: u64,
    /// How often two docked modules began to fold, which the world does without forces.
    pub folds: u64,
    /// Poses that were lost.
    pub lost_poses: u64,
}

impl WorldReport {
    /// The greatest speed of a touch, in units a second.
    pub const TOUCH_SPEED: f64 = 0.2;
    /// The greatest depth of a touch, in units.
    pub const TOUCH_DEPTH: f64 = 0.01;
}

impl fmt::Display for WorldReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let contacts = usize::try_from(self.contacts).unwrap_or(usize::MAX);
        write!(formatter, "{}", counted(contacts, "contact"))?;
        if self.contacts > 0 {
            write!(
                formatter,
                " between modules that are not docked, {} above a touch (fastest {:.2} units/s, deepest {:.3} units)",
                self.contacts_above_touch, self.fastest_contact, self.deepest_overlap
            )?;
        }
        write!(
            formatter,
            "; {} of {} attempts to dock failed",
            self.docking_failures, self.docking_attempts
        )
    }
}
