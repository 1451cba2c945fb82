//! The edges of a graph, each in both directions and with a number for each direction.

use formation_model::Topology;

/// The directed edges that leave node `n` have the numbers `first[n]..first[n + 1]`, in ascending order of their heads.
pub(crate) struct DirectedEdges {
    pub(crate) first: Vec<usize>,
    /// The node to which each directed edge leads.
    pub(crate) head: Vec<usize>,
    /// The number of the same edge in the other direction.
    pub(crate) reverse: Vec<usize>,
}

impl DirectedEdges {
    pub(crate) fn of(topology: &Topology) -> Self {
        let mut first = Vec::with_capacity(topology.node_count() + 1);
        let mut head = Vec::with_capacity(2 * topology.edges().len());
        for node in 0..topology.node_count() {
            first.push(head.len());
            head.extend_from_slice(topology.neighbours(node));
        }
        first.push(head.len());
        // Neighbours ascend, so the edges into a node are met in the order of that node's own list.
        let mut met = first.clone();
        let reverse = head
            .iter()
            .map(|&node| {
                met[node] += 1;
                met[node] - 1
            })
            .collect();
        Self {
            first,
            head,
            reverse,
        }
    }

    /// The node from which a directed edge leads.
    pub(crate) fn tail(&self, edge: usize) -> usize {
        self.head[self.reverse[edge]]
    }

    pub(crate) fn node_count(&self) -> usize {
        self.first.len() - 1
    }
}
