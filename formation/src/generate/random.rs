//! A seeded stream of random numbers whose values never change between versions or machines.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// A stream of random numbers. All sampling is done here in integers, so that a seed means the same scenario everywhere.
pub struct Random {
    generator: Pcg64,
}

impl Random {
    /// A stream that is the same for the same seed, everywhere and always.
    #[must_use]
    pub fn from_seed(seed: u64) -> Self {
        Self {
            generator: Pcg64::seed_from_u64(seed),
        }
    }

    /// A number below `bound`, which must not be 0; 0 gives 0.
    ///
    /// Takes the upper half of a 128-bit product (Lemire, "Fast Random Integer Generation in an Interval", 2019, without
    /// the rejection step): the bias is below `bound / 2^64`, which no experiment can see.
    pub fn below(&mut self, bound: u64) -> u64 {
        let product = u128::from(self.generator.next_u64()) * u128::from(bound);
        u64::try_from(product >> 64).unwrap_or_default()
    }

    /// A position in a list of `length` entries.
    pub fn index(&mut self, length: usize) -> usize {
        usize::try_from(self.below(length as u64)).unwrap_or_default()
    }

    /// Puts a list into a uniformly random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for last in (1..list.len()).rev() {
            list.swap(last, self.index(last + 1));
        }
    }
}
