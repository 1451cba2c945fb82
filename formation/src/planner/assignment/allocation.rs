//! The spot table: who holds which spot while units take their turns.
//!
//! The paper's set of (spot, selector) pairs. Modules and spots are named by their position in ascending order of
//! identifiers.

/// Who holds a spot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Holder {
    /// Nobody.
    #[default]
    Nobody,
    /// A module on its own, which may be evicted.
    Singleton(usize),
    /// A module of a block, or one that has settled already; neither is ever evicted.
    Fixed(usize),
    /// Nobody, and nobody may: there are too few modules to fill it.
    Closed,
}

/// Who holds which spot. No module holds two spots, no spot has two holders.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SpotTable {
    holders: Vec<Holder>,
    spot_of: Vec<Option<usize>>,
    free_count: usize,
}

impl SpotTable {
    /// A table in which all spots are free.
    #[must_use]
    pub fn new(module_count: usize, spot_count: usize) -> Self {
        Self {
            holders: vec![Holder::Nobody; spot_count],
            spot_of: vec![None; module_count],
            free_count: spot_count,
        }
    }

    /// Who holds a spot.
    #[must_use]
    pub fn holder(&self, spot: usize) -> Holder {
        self.holders[spot]
    }

    /// Who holds each spot.
    #[must_use]
    pub fn holders(&self) -> &[Holder] {
        &self.holders
    }

    /// The spot that a module holds.
    #[must_use]
    pub fn spot_of(&self, module: usize) -> Option<usize> {
        self.spot_of[module]
    }

    /// How many spots nobody holds.
    #[must_use]
    pub fn free_count(&self) -> usize {
        self.free_count
    }

    /// The spots that nobody holds, ascending.
    pub fn free_spots(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.holders.len()).filter(|&spot| self.holders[spot] == Holder::Nobody)
    }

    /// Becomes a copy of another table, in the memory at hand.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.holders.clone_from(&other.holders);
        self.spot_of.clone_from(&other.spot_of);
        self.free_count = other.free_count;
    }

    /// Keeps a free spot from being filled.
    pub(crate) fn close(&mut self, spot: usize) {
        if self.holders[spot] == Holder::Nobody {
            self.holders[spot] = Holder::Closed;
            self.free_count -= 1;
        }
    }

    /// Lets a module give up its spot, if it holds one.
    pub(crate) fn release(&mut self, module: usize) {
        if let Some(spot) = self.spot_of[module].take() {
            self.holders[spot] = Holder::Nobody;
            self.free_count += 1;
        }
    }

    /// Gives a free spot to a module without one.
    pub(crate) fn give(&mut self, spot: usize, holder: Holder) {
        debug_assert_eq!(self.holders[spot], Holder::Nobody, "spot {spot} is held");
        if let Holder::Singleton(module) | Holder::Fixed(module) = holder {
            debug_assert_eq!(self.spot_of[module], None, "module {module} holds a spot");
            self.holders[spot] = holder;
            self.spot_of[module] = Some(spot);
            self.free_count -= 1;
        }
    }
}
