//! Undirected simple graphs over `0..node_count`, with sorted neighbours.

use petgraph::csr::Csr;
use thiserror::Error;

/// The shape of a target or a configuration: nodes are positions in ascending order of identifier.
#[derive(Clone, Debug)]
pub struct Topology {
    /// Each undirected edge stands in both directions, so that a neighbour list is one sorted slice.
    graph: Csr<(), (), petgraph::Directed, usize>,
    edges: Vec<(usize, usize)>,
}

/// Why a list of edges is no simple graph; both numbers are node positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum TopologyError {
    /// An edge names a node beyond the last.
    #[error("edge {0}-{1} names a node that does not exist")]
    NoSuchNode(usize, usize),
    /// An edge joins a node to itself.
    #[error("edge {0}-{0} joins a node to itself")]
    SelfLoop(usize),
    /// An edge is listed twice, in either direction.
    #[error("edge {0}-{1} is listed twice")]
    Duplicate(usize, usize),
}

impl Topology {
    /// Builds the graph.
    ///
    /// # Errors
    /// Refuses self loops, repeated edges and edges to nodes that do not exist.
    pub fn new(node_count: usize, edges: &[(usize, usize)]) -> Result<Self, TopologyError> {
        let mut ordered = Vec::with_capacity(edges.len());
        for &(first, second) in edges {
            if first >= node_count || second >= node_count {
                return Err(TopologyError::NoSuchNode(first, second));
            }
            if first == second {
                return Err(TopologyError::SelfLoop(first));
            }
            ordered.push((first.min(second), first.max(second)));
        }
        ordered.sort_unstable();
        if let Some(pair) = ordered.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(TopologyError::Duplicate(pair[0].0, pair[0].1));
        }
        let mut both_ways: Vec<(usize, usize)> = ordered
            .iter()
            .flat_map(|&(first, second)| [(first, second), (second, first)])
            .collect();
        both_ways.sort_unstable();
        // The list is sorted and within bounds, so this cannot fail; nodes beyond the last edge follow.
        let mut graph = Csr::from_sorted_edges(&both_ways).unwrap_or_default();
        while graph.node_count() < node_count {
            graph.add_node(());
        }
        Ok(Self {
            graph,
            edges: ordered,
        })
    }

    /// The graph of that many nodes and no edge.
    #[must_use]
    pub fn without_edges(node_count: usize) -> Self {
        Self {
            graph: Csr::with_nodes(node_count),
            edges: Vec::new(),
        }
    }

    /// How many nodes there are.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.graph.node_count()
    }

    /// The edges, each once with its lower node first, in ascending order.
    #[must_use]
    pub fn edges(&self) -> &[(usize, usize)] {
        &self.edges
    }

    /// The neighbours of a node in ascending order.
    #[must_use]
    pub fn neighbours(&self, node: usize) -> &[usize] {
        self.graph.neighbors_slice(node)
    }

    /// How many neighbours a node has.
    #[must_use]
    pub fn degree(&self, node: usize) -> usize {
        self.neighbours(node).len()
    }

    /// Whether an edge joins the two nodes.
    #[must_use]
    pub fn has_edge(&self, first: usize, second: usize) -> bool {
        self.neighbours(first).binary_search(&second).is_ok()
    }

    /// Whether every node can be reached from every other; true for the empty graph.
    #[must_use]
    pub fn is_connected(&self) -> bool {
        self.components_within(|_| true).len() <= 1
    }

    /// Whether the graph is connected and has no cycle.
    #[must_use]
    pub fn is_tree(&self) -> bool {
        self.node_count() > 0 && self.edges.len() + 1 == self.node_count() && self.is_connected()
    }

    /// The connected components of the subgraph of the nodes that `keeps` accepts; each component and
    /// the list of them are in ascending order.
    #[must_use]
    pub fn components_within(&self, keeps: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
        let mut seen = vec![false; self.node_count()];
        let mut components = Vec::new();
        for start in 0..self.node_count() {
            if seen[start] || !keeps(start) {
                continue;
            }
            seen[start] = true;
            let mut component = vec![start];
            let mut next = 0;
            while next < component.len() {
                for &neighbour in self.neighbours(component[next]) {
                    if !seen[neighbour] && keeps(neighbour) {
                        seen[neighbour] = true;
                        component.push(neighbour);
                    }
                }
                next += 1;
            }
            component.sort_unstable();
            components.push(component);
        }
        components
    }

    /// The subgraph on `nodes` (ascending, distinct); node `i` of the result is `nodes[i]`.
    #[must_use]
    pub fn induced_by(&self, nodes: &[usize]) -> Self {
        let edges: Vec<(usize, usize)> = self
            .edges
            .iter()
            .filter_map(|(first, second)| {
                Some((
                    nodes.binary_search(first).ok()?,
                    nodes.binary_search(second).ok()?,
                ))
            })
            .collect();
        Self::new(nodes.len(), &edges).unwrap_or_else(|_| Self::without_edges(nodes.len()))
    }

    /// The graph itself, for petgraph's algorithms; every edge stands in both directions.
    #[must_use]
    pub fn as_petgraph(&self) -> &Csr<(), (), petgraph::Directed, usize> {
        &self.graph
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
    fn refuses_what_is_no_simple_graph() {
        assert_eq!(
            Topology::new(2, &[(0, 2)]),
            Err(TopologyError::NoSuchNode(0, 2))
        );
        assert_eq!(Topology::new(2, &[(1, 1)]), Err(TopologyError::SelfLoop(1)));
        assert_eq!(
            Topology::new(2, &[(0, 1), (1, 0)]),
            Err(TopologyError::Duplicate(0, 1))
        );
    }

    #[test]
    fn components_and_trees() {
        let path = Topology::new(4, &[(0, 1), (1, 2), (2, 3)]).unwrap();
        assert!(path.is_tree());
        assert_eq!(
            path.components_within(|node| node != 1),
            [vec![0], vec![2, 3]]
        );
        let ring = Topology::new(3, &[(0, 1), (1, 2), (0, 2)]).unwrap();
        assert!(ring.is_connected() && !ring.is_tree());
        assert_eq!(ring.neighbours(1), [0, 2]);
        assert_eq!(path.induced_by(&[1, 2]).edges(), [(0, 1)]);
    }
}
