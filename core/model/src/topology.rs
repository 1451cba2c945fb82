//! Undirected simple graphs over `0..node_count`, with sorted neighbours.

use petgraph::Directed;
use petgraph::csr::Csr;
use petgraph::unionfind::UnionFind;

/// The graph of a target or a configuration: nodes are positions in ascending order of identifier.
#[derive(Clone, Debug)]
pub struct Topology {
    /// Holds each undirected edge in both directions, so that the neighbours of a node are one sorted slice.
    graph: Csr<(), (), Directed, usize>,
    edges: Vec<(usize, usize)>,
}

impl Topology {
    /// Builds the graph from distinct edges, each between two distinct nodes below `node_count`.
    pub fn new(node_count: usize, edges: &[(usize, usize)]) -> Self {
        let mut ordered: Vec<(usize, usize)> = edges
            .iter()
            .map(|&(first, second)| (first.min(second), first.max(second)))
            .collect();
        ordered.sort_unstable();
        debug_assert!(
            ordered.windows(2).all(|pair| pair[0] != pair[1])
                && ordered
                    .iter()
                    .all(|&(low, high)| low < high && high < node_count),
            "no simple graph of {node_count} nodes: {edges:?}"
        );
        Self::from_ordered(node_count, ordered)
    }

    /// Builds the graph from valid edges, each with its lower node first, in ascending order.
    fn from_ordered(node_count: usize, edges: Vec<(usize, usize)>) -> Self {
        let mut directed: Vec<(usize, usize)> = edges
            .iter()
            .flat_map(|&(first, second)| [(first, second), (second, first)])
            .collect();
        directed.sort_unstable();
        let graph = Csr::from_sorted_edges(&directed);
        debug_assert!(graph.is_ok(), "the edges are sorted and distinct");
        let mut graph = graph.unwrap_or_default();
        // The nodes after the last edge.
        while graph.node_count() < node_count {
            graph.add_node(());
        }
        Self { graph, edges }
    }

    /// The number of nodes.
    pub fn node_count(&self) -> usize {
        self.graph.node_count()
    }

    /// The edges, each once with its lower node first, in ascending order.
    pub fn edges(&self) -> &[(usize, usize)] {
        &self.edges
    }

    /// The neighbours of a node in ascending order.
    pub fn neighbours(&self, node: usize) -> &[usize] {
        self.graph.neighbors_slice(node)
    }

    /// The number of neighbours of a node.
    pub fn degree(&self, node: usize) -> usize {
        self.neighbours(node).len()
    }

    /// Whether an edge joins the two nodes.
    pub fn has_edge(&self, first: usize, second: usize) -> bool {
        self.neighbours(first).binary_search(&second).is_ok()
    }

    /// Whether the graph is connected and has no cycle; false for the empty graph.
    pub fn is_tree(&self) -> bool {
        self.edges.len() + 1 == self.node_count() && self.components().len() == 1
    }

    /// The connected components; each of them, and the list of them, in ascending order.
    pub fn components(&self) -> Vec<Vec<usize>> {
        self.components_within(|_| true)
    }

    /// The connected components of the subgraph of the nodes that `keeps` accepts; each of them, and the list of them, in
    /// ascending order.
    pub fn components_within(&self, keeps: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
        let mut sets = UnionFind::new(self.node_count());
        for &(first, second) in &self.edges {
            if keeps(first) && keeps(second) {
                sets.union(first, second);
            }
        }
        let mut component_of = vec![usize::MAX; self.node_count()];
        let mut components: Vec<Vec<usize>> = Vec::new();
        for node in (0..self.node_count()).filter(|&node| keeps(node)) {
            let component = &mut component_of[sets.find_mut(node)];
            if *component == usize::MAX {
                *component = components.len();
                components.push(Vec::new());
            }
            components[*component].push(node);
        }
        components
    }

    /// The graph for algorithms of petgraph; it holds every edge in both directions.
    pub fn as_petgraph(&self) -> &Csr<(), (), Directed, usize> {
        &self.graph
    }

    /// The subgraph on `nodes` (ascending, distinct); node `i` of the result is `nodes[i]`.
    #[must_use]
    pub fn induced_by(&self, nodes: &[usize]) -> Self {
        let mut edges = Vec::new();
        for (first, &node) in nodes.iter().enumerate() {
            let higher = self.neighbours(node).iter().filter(|&&other| other > node);
            let within = higher.filter_map(|other| nodes.binary_search(other).ok());
            edges.extend(within.map(|second| (first, second)));
        }
        Self::from_ordered(nodes.len(), edges)
    }
}

impl PartialEq for Topology {
    fn eq(&self, other: &Self) -> bool {
        self.node_count() == other.node_count() && self.edges == other.edges
    }
}

impl Eq for Topology {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_and_trees() {
        let path = Topology::new(4, &[(0, 1), (1, 2), (2, 3)]);
        assert!(path.is_tree());
        assert_eq!(
            path.components_within(|node| node != 1),
            [vec![0], vec![2, 3]]
        );
        let ring = Topology::new(3, &[(0, 1), (1, 2), (0, 2)]);
        assert!(ring.components().len() == 1 && !ring.is_tree());
        assert_eq!(ring.neighbours(1), [0, 2]);
        assert_eq!(path.induced_by(&[1, 2]).edges(), [(0, 1)]);
    }
}
