//! The spots that each module can take if a configuration is to keep all its links.

use fixedbitset::FixedBitSet;

use crate::placement::matching::{MatchingInput, Weight};

/// The greatest number of pairs that the filter checks. Pairs that it has not ruled out by then are left to the search.
const CHECKS_MAX: usize = 4_000_000;

/// The possible pairs. A pair is possible only while the module's neighbours can take different neighbours of the spot in
/// possible pairs (the local all-different filter of C. Solnon, "AllDifferent-based filtering for subgraph isomorphism",
/// Artificial Intelligence 174, 2010).
pub(super) struct Domains {
    /// A bit for each pair, a row for each module.
    bits: FixedBitSet,
    spot_count: usize,
}

impl Domains {
    /// `None` if some module has no possible spot.
    pub(super) fn filtered<W: Weight>(input: &MatchingInput<'_, W>) -> Option<Self> {
        let (configuration, target) = (input.configuration, input.target);
        let (module_count, spot_count) = (configuration.node_count(), target.node_count());
        let mut domains = Self {
            bits: FixedBitSet::with_capacity(module_count * spot_count),
            spot_count,
        };
        for node in 0..module_count {
            for spot in 0..spot_count {
                if target.degree(spot) >= configuration.degree(node)
                    && (input.weight)(node, spot).is_some()
                {
                    domains.bits.insert(node * spot_count + spot);
                }
            }
        }
        let mut waiting: Vec<usize> = (0..module_count).rev().collect();
        let mut is_waiting = vec![true; module_count];
        let mut checks = 0;
        while let Some(node) = waiting.pop() {
            is_waiting[node] = false;
            let domain: Vec<usize> = domains.spots(node).collect();
            checks += domain.len();
            if checks > CHECKS_MAX {
                break;
            }
            let mut left = domain.len();
            for &spot in &domain {
                if !domains.neighbours_fit(input, node, spot) {
                    domains.bits.remove(node * spot_count + spot);
                    left -= 1;
                }
            }
            if left == 0 {
                return None;
            }
            if left == domain.len() {
                continue;
            }
            for &neighbour in configuration.neighbours(node) {
                if !is_waiting[neighbour] {
                    is_waiting[neighbour] = true;
                    waiting.push(neighbour);
                }
            }
        }
        Some(domains)
    }

    /// Whether the pair is possible.
    pub(super) fn has(&self, node: usize, spot: usize) -> bool {
        self.bits.contains(node * self.spot_count + spot)
    }

    /// The possible spots of a module, ascending.
    pub(super) fn spots(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.spot_count).filter(move |&spot| self.has(node, spot))
    }

    /// Whether the neighbours of a module can take different neighbours of a spot: a bipartite matching.
    fn neighbours_fit<W>(&self, input: &MatchingInput<'_, W>, node: usize, spot: usize) -> bool {
        let modules = input.configuration.neighbours(node);
        let spots = input.target.neighbours(spot);
        // The module that takes each of the spots.
        let mut taken_by: Vec<Option<usize>> = vec![None; spots.len()];
        modules.iter().all(|&module| {
            let mut is_reached = vec![false; spots.len()];
            self.augment(module, spots, &mut taken_by, &mut is_reached)
        })
    }

    /// Gives a module one of the spots, if need be by moving the holders of others along an augmenting path.
    fn augment(
        &self,
        module: usize,
        spots: &[usize],
        taken_by: &mut [Option<usize>],
        is_reached: &mut [bool],
    ) -> bool {
        for (index, &spot) in spots.iter().enumerate() {
            if is_reached[index] || !self.has(module, spot) {
                continue;
            }
            is_reached[index] = true;
            let holder = taken_by[index];
            if holder.is_none_or(|holder| self.augment(holder, spots, taken_by, is_reached)) {
                taken_by[index] = Some(module);
                return true;
            }
        }
        false
    }
}
