//! Random numbers from a seed, the same in every version and on every machine.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// A stream of random numbers. All sampling is in integers, so that a seed gives the same scenario everywhere.
#[derive(Debug)]
pub struct Random {
    generator: Pcg64,
}

impl Random {
    /// The stream of a seed.
    pub fn from_seed(seed: u64) -> Self {
        Self {
            generator: Pcg64::seed_from_u64(seed),
        }
    }

    /// A number below `bound`; 0 if `bound` is 0.
    ///
    /// The upper half of a 128-bit product (D. Lemire, "Fast random integer generation in an interval", 2019, without the
    /// rejection step): the bias is below `bound / 2^64`.
    pub fn below(&mut self, bound: u64) -> u64 {
        let product = u128::from(self.generator.next_u64()) * u128::from(bound);
        u64::try_from(product >> 64).unwrap_or_default()
    }

    /// A position in a list of `length` entries.
    pub fn index(&mut self, length: usize) -> usize {
        usize::try_from(self.below(length as u64)).unwrap_or_default()
    }

    /// Shuffles a list uniformly (Fisher and Yates).
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for last in (1..list.len()).rev() {
            list.swap(last, self.index(last + 1));
        }
    }
}
