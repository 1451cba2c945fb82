//! The value of a spot: its normalised betweenness centrality in the target.
//!
//! The paper, section "Configuration Formation as Utility Maximization Problem": a spot on many shortest paths is worth
//! more. For undirected graphs, divided by the number of pairs of other spots, so between 0 and 1.

use crate::rooted_tree::RootedTree;
use formation_model::{MICRO_PER_UNIT, MicroUnits, Topology};

/// The betweenness centrality of every node of a connected graph, in ascending order of nodes.
///
/// All zero for fewer than three nodes. On trees the paths are counted in whole numbers. On other graphs the algorithm is
/// that of U. Brandes, "A faster algorithm for betweenness centrality" (Journal of Mathematical Sociology 25, 2001). It
/// uses floats, but only the four basic operations in a fixed order, and rounds once at the end, so every replica gets the
/// same bits.
#[must_use]
pub fn betweenness(topology: &Topology) -> Vec<MicroUnits> {
    let node_count = topology.node_count();
    if node_count < 3 {
        return vec![MicroUnits::ZERO; node_count];
    }
    if topology.is_tree() {
        tree_betweenness(topology)
    } else {
        general_betweenness(topology)
    }
}

/// On a tree, the paths through a node join different parts of the tree without that node.
fn tree_betweenness(topology: &Topology) -> Vec<MicroUnits> {
    let node_count = topology.node_count();
    let pairs = |count: usize| count * count.saturating_sub(1) / 2;
    let all_pairs = pairs(node_count - 1);
    let tree = RootedTree::new(topology, 0);
    let mut within_parts = vec![0_usize; node_count];
    for &node in &tree.order {
        within_parts[node] += pairs(node_count - tree.sizes[node]);
        if let Some(parent) = tree.parents[node] {
            within_parts[parent] += pairs(tree.sizes[node]);
        }
    }
    within_parts
        .into_iter()
        .map(|within| ratio(all_pairs - within, all_pairs))
        .collect()
}

/// A ratio of at most 1 in micro-units, rounded half up.
fn ratio(part: usize, whole: usize) -> MicroUnits {
    let wide = |number: usize| i128::try_from(number).unwrap_or(i128::MAX);
    let (part, whole) = (wide(part), wide(whole));
    let rounded = (2 * part * i128::from(MICRO_PER_UNIT) + whole) / (2 * whole);
    MicroUnits(i64::try_from(rounded).unwrap_or(MICRO_PER_UNIT))
}

/// A number of paths, `mantissa * RADIX^exponent`, because there can be more than a float holds. Up to [`RADIX`] it has the
/// same bits as the float.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PathCount {
    pub(super) mantissa: f64,
    pub(super) exponent: u32,
}

/// The base of the exponent of a [`PathCount`].
pub(super) const RADIX: f64 = 1.0e100;

impl PathCount {
    pub(super) const ONE: Self = Self {
        mantissa: 1.0,
        exponent: 0,
    };

    /// The mantissa of this number for a larger or equal exponent.
    fn mantissa_under(self, exponent: u32) -> f64 {
        match exponent - self.exponent {
            0 => self.mantissa,
            1 => self.mantissa / RADIX,
            _ => 0.0,
        }
    }

    pub(super) fn plus(self, other: Self) -> Self {
        let exponent = self.exponent.max(other.exponent);
        let mantissa = self.mantissa_under(exponent) + other.mantissa_under(exponent);
        if mantissa > RADIX {
            Self {
                mantissa: mantissa / RADIX,
                exponent: exponent + 1,
            }
        } else {
            Self { mantissa, exponent }
        }
    }

    /// The ratio of this number to a larger or equal one.
    pub(super) fn share_of(self, whole: Self) -> f64 {
        self.mantissa_under(whole.exponent) / whole.mantissa
    }
}

#[expect(clippy::cast_precision_loss, reason = "node counts are far below 2^53")]
fn general_betweenness(topology: &Topology) -> Vec<MicroUnits> {
    let node_count = topology.node_count();
    let mut total = vec![0.0_f64; node_count];
    let mut search = ShortestPaths::new(node_count);
    for source in 0..node_count {
        search.run(topology, source);
        search.accumulate(topology, source, &mut total);
    }
    let other_nodes = (node_count - 1) as f64;
    // Every pair of ends has been counted from both ends.
    let ordered_pairs = other_nodes * (other_nodes - 1.0);
    total
        .into_iter()
        .map(|sum| MicroUnits::from_units(sum / ordered_pairs).unwrap_or(MicroUnits::ZERO))
        .collect()
}

/// What a search knows of one node; together, because the search reads them together.
#[derive(Clone, Copy, Debug)]
struct Reached {
    /// The number of shortest paths to the node.
    paths: PathCount,
    dependency: f64,
    distance: u32,
}

/// All shortest paths from one source.
struct ShortestPaths {
    /// The nodes by distance from the source.
    order: Vec<usize>,
    nodes: Vec<Reached>,
}

impl ShortestPaths {
    fn new(node_count: usize) -> Self {
        Self {
            order: Vec::with_capacity(node_count),
            nodes: vec![Self::not_reached(); node_count],
        }
    }

    fn not_reached() -> Reached {
        Reached {
            paths: PathCount::default(),
            dependency: 0.0,
            distance: u32::MAX,
        }
    }

    fn run(&mut self, topology: &Topology, source: usize) {
        self.order.clear();
        self.nodes.fill(Self::not_reached());
        self.nodes[source].distance = 0;
        self.nodes[source].paths = PathCount::ONE;
        self.order.push(source);
        let mut next = 0;
        while let Some(&node) = self.order.get(next) {
            let Reached {
                paths, distance, ..
            } = self.nodes[node];
            for &neighbour in topology.neighbours(node) {
                let reached = &mut self.nodes[neighbour];
                if reached.distance == u32::MAX {
                    reached.distance = distance + 1;
                    self.order.push(neighbour);
                }
                if reached.distance == distance + 1 {
                    reached.paths = reached.paths.plus(paths);
                }
            }
            next += 1;
        }
    }

    /// Adds, for each node, the share of the shortest paths to all others that run through it, from the farthest node on.
    fn accumulate(&mut self, topology: &Topology, source: usize, total: &mut [f64]) {
        for &node in self.order.iter().rev() {
            if node == source {
                continue;
            }
            let Reached {
                paths,
                dependency,
                distance,
            } = self.nodes[node];
            total[node] += dependency;
            let carried = 1.0 + dependency;
            for &neighbour in topology.neighbours(node) {
                let nearer = &mut self.nodes[neighbour];
                if nearer.distance == distance - 1 {
                    nearer.dependency += nearer.paths.share_of(paths) * carried;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn micro(values: &[i64]) -> Vec<MicroUnits> {
        values.iter().copied().map(MicroUnits).collect()
    }

    #[test]
    fn small_graphs_have_no_centre() {
        assert_eq!(betweenness(&Topology::new(0, &[])), []);
        let pair = Topology::new(2, &[(0, 1)]);
        assert_eq!(betweenness(&pair), micro(&[0, 0]));
    }

    #[test]
    fn a_path_and_a_star() {
        let path = Topology::new(5, &[(0, 1), (1, 2), (2, 3), (3, 4)]);
        assert_eq!(
            betweenness(&path),
            micro(&[0, 500_000, 666_667, 500_000, 0])
        );
        let star = Topology::new(4, &[(0, 3), (1, 3), (2, 3)]);
        assert_eq!(betweenness(&star), micro(&[0, 0, 0, 1_000_000]));
    }

    #[test]
    fn both_algorithms_agree_on_trees() {
        let edges: Vec<(usize, usize)> =
            (1..200).map(|node| (node, (node * 7 + 3) % node)).collect();
        let tree = Topology::new(200, &edges);
        for (exact, float) in tree_betweenness(&tree)
            .into_iter()
            .zip(general_betweenness(&tree))
        {
            assert!((exact.0 - float.0).abs() <= 1, "{exact} and {float}");
        }
    }

    #[test]
    fn counts_within_the_range_of_a_float_have_its_bits() {
        let side = 9;
        let along = (0..side * side).filter(|node| node % side + 1 < side);
        let across = (0..side * (side - 1)).map(|node| (node, node + side));
        let mut edges: Vec<_> = along.map(|node| (node, node + 1)).chain(across).collect();
        edges.retain(|&(first, _)| first % 7 != 3);
        edges.push((0, 3));
        edges.extend(
            (1..side * side)
                .filter(|node| node % 7 == 3)
                .map(|node| (node - 1, node)),
        );
        edges.sort_unstable();
        edges.dedup();
        let graph = Topology::new(side * side, &edges);
        let mut search = ShortestPaths::new(graph.node_count());
        for source in 0..graph.node_count() {
            search.run(&graph, source);
            // The same sums of floats, from the nearest nodes on.
            let mut plain = vec![0.0_f64; graph.node_count()];
            plain[source] = 1.0;
            for &node in &search.order {
                let farther = search.nodes[node].distance + 1;
                for &neighbour in graph.neighbours(node) {
                    if search.nodes[neighbour].distance == farther {
                        plain[neighbour] += plain[node];
                    }
                }
            }
            for (count, plain) in search.nodes.iter().zip(&plain) {
                assert_eq!(count.paths.exponent, 0);
                assert_eq!(count.paths.mantissa.to_bits(), plain.to_bits());
                let share = PathCount::ONE.share_of(count.paths);
                assert_eq!(share.to_bits(), (1.0 / plain).to_bits());
            }
        }
    }

    #[test]
    fn path_counts_that_no_float_holds_still_give_shares() {
        // A chain of 2,000 four-rings has 2^2000 shortest paths from end to end.
        let rings = 2_000;
        let mut edges = Vec::new();
        for ring in 0..rings {
            let first = 3 * ring;
            edges.extend([
                (first, first + 1),
                (first, first + 2),
                (first + 1, first + 3),
                (first + 2, first + 3),
            ]);
        }
        let chain = Topology::new(3 * rings + 1, &edges);
        let mut search = ShortestPaths::new(chain.node_count());
        let mut total = vec![0.0; chain.node_count()];
        search.run(&chain, 0);
        search.accumulate(&chain, 0, &mut total);
        // Beyond each joint lie all later nodes; each side of a ring carries half of what is behind it.
        assert!((total[3] - f64::from(3 * 1_999)).abs() < 1.0e-6);
        assert!((total[1] - (f64::from(3 * 1_999) + 1.0) / 2.0).abs() < 1.0e-6);
        // Seen from the far end, the first ring's counts are beyond a float's range.
        let last = chain.node_count() - 1;
        total.fill(0.0);
        search.run(&chain, last);
        search.accumulate(&chain, last, &mut total);
        assert!((total[1] - 0.5).abs() < 1.0e-6);
        assert!((total[3] - 3.0).abs() < 1.0e-6);
    }
}
