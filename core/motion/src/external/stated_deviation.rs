//! How exact a driver says that its poses are.

use formation_model::MicroUnits;

/// The standard deviation that comes with the poses of a driver. Many drivers state one value whatever they know, so it counts only
/// once two have differed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StatedDeviation {
    first: Option<MicroUnits>,
    counts: bool,
    last: MicroUnits,
}

impl StatedDeviation {
    /// Takes in what came with a pose, `None` if nothing did. Returns it if it counts and differs from the last.
    pub fn next(&mut self, stated: Option<MicroUnits>) -> Option<MicroUnits> {
        if let Some(stated) = stated {
            self.counts |= *self.first.get_or_insert(stated) != stated;
        }
        let stated = stated.unwrap_or_default();
        let last = std::mem::replace(&mut self.last, stated);
        (self.counts && stated != last).then_some(stated)
    }
}
