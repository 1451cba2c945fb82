//! Which spots are possible for which modules if a configuration is to keep all its links.

use crate::model::MicroUnits;
use crate::planner::placement::MatchingInput;

/// How often the filter may ask whether a spot is possible for a module; what it then has not ruled out, a search will.
const CHECKS_MAX: usize = 4_000_000;

/// The possible pairs: a spot stays possible for a module only as long as the module's neighbours can take different
/// neighbours of the spot that are possible for them (the local all-different filter of C. Solnon, "AllDifferent-based
/// filtering for subgraph isomorphism", Artificial Intelligence 174, 2010).
pub(super) struct Domains {
    /// A bit for each pair, a row of whole words for each module.
    bits: Vec<u64>,
    words_per_row: usize,
    spot_count: usize,
}

impl Domains {
    /// None if some module has no spot left.
    pub(super) fn filtered<W: Fn(usize, usize) -> Option<MicroUnits>>(
        input: &MatchingInput<'_, W>,
    ) -> Option<Self> {
        let (configuration, target) = (input.configuration, input.target);
        let (module_count, spot_count) = (configuration.node_count(), target.node_count());
        let words_per_row = spot_count.div_ceil(64);
        let mut domains = Self {
            bits: vec![0; module_count * words_per_row],
            words_per_row,
            spot_count,
        };
        for node in 0..module_count {
            for spot in 0..spot_count {
                if target.degree(spot) >= configuration.degree(node)
                    && (input.weight)(node, spot).is_some()
                {
                    domains.bits[node * words_per_row + spot / 64] |= 1 << (spot % 64);
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
                    domains.bits[node * words_per_row + spot / 64] &= !(1 << (spot % 64));
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

    /// Whether the module may take the spot.
    pub(super) fn has(&self, node: usize, spot: usize) -> bool {
        self.bits[node * self.words_per_row + spot / 64] & (1 << (spot % 64)) != 0
    }

    /// The spots that a module may take, ascending.
    pub(super) fn spots(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.spot_count).filter(move |&spot| self.has(node, spot))
    }

    /// Whether the neighbours of a module can take different neighbours of a spot: a bipartite matching by augmenting
    /// paths.
    fn neighbours_fit<W>(&self, input: &MatchingInput<'_, W>, node: usize, spot: usize) -> bool {
        let modules = input.configuration.neighbours(node);
        let spots = input.target.neighbours(spot);
        // Which of the modules takes each of the spots.
        let mut taken_by: Vec<Option<usize>> = vec![None; spots.len()];
        (0..modules.len()).all(|start| {
            // From which module each spot was reached.
            let mut reached_from: Vec<Option<usize>> = vec![None; spots.len()];
            let mut waiting = vec![start];
            while let Some(module) = waiting.pop() {
                for (index, &neighbour) in spots.iter().enumerate() {
                    if reached_from[index].is_some() || !self.has(modules[module], neighbour) {
                        continue;
                    }
                    reached_from[index] = Some(module);
                    if let Some(holder) = taken_by[index] {
                        waiting.push(holder);
                        continue;
                    }
                    // Every module on the way here moves on by one spot.
                    let mut vacant = index;
                    while let Some(mover) = reached_from[vacant] {
                        let before = taken_by.iter().position(|&holder| holder == Some(mover));
                        taken_by[vacant] = Some(mover);
                        let Some(before) = before else { break };
                        vacant = before;
                    }
                    return true;
                }
            }
            false
        })
    }
}
