//! Maximum common subtrees by exhaustive search.

use formation_model::{MicroUnits, Topology};

/// The greatest (size, utility) over all placements of a connected part of a tree in another tree, edges on edges.
///
/// `None` in `weights[node][spot]` forbids the pair.
pub fn best_common_subtree(
    configuration: &Topology,
    target: &Topology,
    weights: &[Vec<Option<MicroUnits>>],
) -> (usize, MicroUnits) {
    let mut search = Search {
        configuration,
        target,
        weights,
        image: vec![None; configuration.node_count()],
        used: vec![false; target.node_count()],
        best: (0, MicroUnits::ZERO),
    };
    search.assign(0);
    search.best
}

struct Search<'a> {
    configuration: &'a Topology,
    target: &'a Topology,
    weights: &'a [Vec<Option<MicroUnits>>],
    image: Vec<Option<usize>>,
    used: Vec<bool>,
    best: (usize, MicroUnits),
}

impl Search<'_> {
    /// Tries every image of `node`, and none, with those of all lower nodes fixed.
    fn assign(&mut self, node: usize) {
        if node == self.image.len() {
            self.judge();
            return;
        }
        self.assign(node + 1);
        for spot in 0..self.used.len() {
            let breaks_a_link = self
                .configuration
                .neighbours(node)
                .iter()
                .filter(|&&other| other < node)
                .filter_map(|&other| self.image[other])
                .any(|other| !self.target.has_edge(spot, other));
            if self.used[spot] || breaks_a_link || self.weights[node][spot].is_none() {
                continue;
            }
            self.used[spot] = true;
            self.image[node] = Some(spot);
            self.assign(node + 1);
            self.image[node] = None;
            self.used[spot] = false;
        }
    }

    fn judge(&mut self) {
        let matched = |node: usize| self.image[node].is_some();
        if self.configuration.components_within(matched).len() > 1 {
            return;
        }
        let mut score = (0, MicroUnits::ZERO);
        for (node, spot) in self.image.iter().enumerate() {
            if let Some(weight) = spot.and_then(|spot| self.weights[node][spot]) {
                score.0 += 1;
                score.1 += weight;
            }
        }
        self.best = self.best.max(score);
    }
}
