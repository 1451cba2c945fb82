//! Docking by a driver outside the process: requests and answers.

use std::fmt;

use crate::ModuleId;

/// An action of one of a module's docking ports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DockingAction {
    /// Dock to the other module.
    Dock,
    /// Undock from the other module.
    Undock,
}

/// A request of a module to its driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DockingRequest {
    /// Distinct from all other requests of the module, those of its earlier processes included.
    pub request: u64,
    /// The action.
    pub action: DockingAction,
    /// The other module.
    pub other: ModuleId,
}

impl fmt::Display for DockingRequest {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.action {
            DockingAction::Dock => write!(formatter, "dock to {}", self.other),
            DockingAction::Undock => write!(formatter, "undock from {}", self.other),
        }
    }
}

/// The answer of a driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DockingResult {
    /// The request that it answers.
    pub request: u64,
    /// Success, or the reason of the failure.
    pub outcome: Result<(), String>,
}
