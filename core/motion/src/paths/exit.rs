//! The way of a unit off the lattice.

use formation_model::{Pose, StepKind};

/// One step of an exit.
#[derive(Clone, Debug)]
pub(super) struct ExitStep {
    pub kind: StepKind,
    /// Where each member is afterwards.
    pub poses: Vec<Pose>,
}

/// The way of a unit off the lattice. It has at least two steps.
#[derive(Clone, Debug)]
pub(super) struct Exit {
    /// The cell under the middle of the unit from which it leaves in its last layout.
    pub cell: usize,
    pub steps: Vec<ExitStep>,
    /// The cells that it reaches into, but for those into which bodies reach that rest before.
    pub swept: Vec<usize>,
    /// Those of them into which it reaches at rest.
    pub rest: Vec<usize>,
    /// The units near it that have to rest before.
    pub after: Vec<usize>,
}
