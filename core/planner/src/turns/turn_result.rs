//! The effects of one turn.

use crate::assignment::{Allocation, Displacement};

/// The effects of one turn that is computed but not applied.
#[derive(Clone, Debug, Default)]
pub(super) struct TurnResult {
    pub(super) allocation: Allocation,
    /// In the order in which they happen.
    pub(super) evictions: Vec<Displacement>,
    /// The groups of modules that stay together from this turn on.
    pub(super) blocks: Vec<Vec<usize>>,
    /// The modules that leave their configuration.
    pub(super) detached: Vec<usize>,
    /// The parts of the configuration that leave it and take turns of their own.
    pub(super) remainder: Vec<Vec<usize>>,
    /// Whether no better place for the block exists.
    pub(super) proven: bool,
    /// The search nodes that the turn has spent.
    pub(super) nodes: u64,
}
