//! Which module holds which spot while units take their turns: the paper's set of (spot, selector) pairs.
//!
//! Modules and spots are named by their position in ascending order of identifier.

/// The state of one spot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Holder {
    /// No module holds the spot.
    #[default]
    Free,
    /// A module outside blocks holds the spot and can be evicted.
    Singleton(usize),
    /// A member of a block or a pinned module holds the spot and is never evicted.
    Fixed(usize),
    /// The spot stays empty, because there are too few modules to fill it.
    Closed,
}

/// One step of a chain: a module leaves its spot, if it holds one, for another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reassignment {
    /// The module that moves.
    pub(crate) module: usize,
    /// The spot that it takes; `None` leaves it without a spot.
    pub(crate) to: Option<usize>,
}

/// One module losing its spot to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Displacement {
    /// The module that loses its spot.
    pub(crate) evicted: usize,
    /// The module that takes it.
    pub(crate) by: usize,
    /// The spot that changes hands.
    pub(crate) from: usize,
    /// The spot that the evicted module takes instead; `None` leaves it without a spot.
    pub(crate) to: Option<usize>,
}

/// The evictions that a chain makes, in its order. The last step of a ring makes none, as its spot has been left.
pub(crate) fn displacements_of(chain: &[Reassignment]) -> impl Iterator<Item = Displacement> + '_ {
    chain.windows(2).filter_map(|pair| {
        Some(Displacement {
            evicted: pair[1].module,
            by: pair[0].module,
            from: pair[0].to?,
            to: pair[1].to,
        })
    })
}

/// The holder of each spot. A module holds at most one spot, and a spot has at most one holder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct SpotTable {
    holders: Vec<Holder>,
    spot_of: Vec<Option<usize>>,
    free_count: usize,
}

impl SpotTable {
    /// A table in which all spots are free.
    pub(crate) fn new(module_count: usize, spot_count: usize) -> Self {
        Self {
            holders: vec![Holder::Free; spot_count],
            spot_of: vec![None; module_count],
            free_count: spot_count,
        }
    }

    pub(crate) fn holder(&self, spot: usize) -> Holder {
        self.holders[spot]
    }

    /// The holders in ascending order of spot.
    pub(crate) fn holders(&self) -> &[Holder] {
        &self.holders
    }

    pub(crate) fn spot_of(&self, module: usize) -> Option<usize> {
        self.spot_of[module]
    }

    pub(crate) fn free_count(&self) -> usize {
        self.free_count
    }

    /// The free spots in ascending order.
    pub(crate) fn free_spots(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.holders.len()).filter(|&spot| self.holders[spot] == Holder::Free)
    }

    /// The spots that singletons hold, in ascending order, each with its holder.
    pub(crate) fn singletons(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let holders = self.holders.iter().enumerate();
        holders.filter_map(|(spot, holder)| match *holder {
            Holder::Singleton(module) => Some((spot, module)),
            _ => None,
        })
    }

    /// Closes a free spot; does nothing to any other.
    pub(crate) fn close(&mut self, spot: usize) {
        if self.holders[spot] == Holder::Free {
            self.holders[spot] = Holder::Closed;
            self.free_count -= 1;
        }
    }

    /// Frees the spot that a module holds, if it holds one.
    pub(crate) fn release(&mut self, module: usize) {
        if let Some(spot) = self.spot_of[module].take() {
            self.holders[spot] = Holder::Free;
            self.free_count += 1;
        }
    }

    /// Gives a free spot to a module that holds none.
    pub(crate) fn give(&mut self, spot: usize, holder: Holder) {
        debug_assert_eq!(self.holders[spot], Holder::Free, "spot {spot} is held");
        if let Holder::Singleton(module) | Holder::Fixed(module) = holder {
            debug_assert_eq!(self.spot_of[module], None, "module {module} holds a spot");
            self.holders[spot] = holder;
            self.spot_of[module] = Some(spot);
            self.free_count -= 1;
        }
    }

    /// Carries out the steps of chains. All modules leave their spots before the first takes its new one, since a chain
    /// may be a ring.
    pub(crate) fn carry_out<'a>(&mut self, steps: impl Iterator<Item = &'a Reassignment> + Clone) {
        for step in steps.clone() {
            self.release(step.module);
        }
        for step in steps {
            if let Some(spot) = step.to {
                self.give(spot, Holder::Singleton(step.module));
            }
        }
    }
}

/// The spot table with the dual potentials that prove the singletons' allocation optimal.
///
/// With minus its utility as the cost of a pair, the reduced cost `cost - of_module - of_spot` is never negative, and zero
/// for a singleton and the spot that it holds; `of_spot` is zero for free spots and never positive.
#[derive(Clone, Debug, Default)]
pub(crate) struct Allocation {
    pub(crate) table: SpotTable,
    pub(super) of_module: Vec<i64>,
    pub(super) of_spot: Vec<i64>,
    /// What leaving a module without a spot costs before its potential is subtracted: the least value for which no
    /// reduced cost is negative. Fixed when the first module enters with no spot free.
    of_dropping: Option<i64>,
    /// Whether `d_max` cut a chain short. From then on the allocation may not be optimal, and the potentials are void.
    pub(super) cut_short: bool,
}

impl Allocation {
    /// An allocation in which all spots are free.
    pub(crate) fn new(module_count: usize, spot_count: usize) -> Self {
        Self {
            table: SpotTable::new(module_count, spot_count),
            of_module: vec![0; module_count],
            of_spot: vec![0; spot_count],
            of_dropping: None,
            cut_short: false,
        }
    }

    /// What leaving a module without a spot costs, before its potential is subtracted; for use once no spot is free.
    pub(super) fn cost_of_dropping(&mut self) -> i64 {
        *self.of_dropping.get_or_insert_with(|| {
            let singletons = self.table.singletons();
            let potentials = singletons.map(|(_, module)| self.of_module[module]);
            potentials.max().unwrap_or(0)
        })
    }
}
