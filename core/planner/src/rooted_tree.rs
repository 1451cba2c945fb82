//! A tree rooted at one of its nodes.

use petgraph::visit::Bfs;

use formation_model::Topology;

/// The nodes of a tree in breadth-first order from its root.
pub(crate) struct RootedTree {
    /// Parents before children, siblings in ascending order.
    pub(crate) order: Vec<usize>,
    /// The parent of each node; `None` for the root.
    pub(crate) parents: Vec<Option<usize>>,
    /// The number of nodes of the subtree below each node, itself included.
    pub(crate) sizes: Vec<usize>,
}

impl RootedTree {
    /// Roots a tree. Of a graph that is no tree, the result holds a spanning tree of the root's component.
    pub(crate) fn new(tree: &Topology, root: usize) -> Self {
        let mut order = Vec::with_capacity(tree.node_count());
        let mut parents = vec![None; tree.node_count()];
        if root < tree.node_count() {
            let graph = tree.as_petgraph();
            let mut walk = Bfs::new(graph, root);
            while let Some(node) = walk.next(graph) {
                order.push(node);
                for &neighbour in tree.neighbours(node) {
                    if neighbour != root && parents[neighbour].is_none() {
                        parents[neighbour] = Some(node);
                    }
                }
            }
        }
        let mut sizes = vec![1; tree.node_count()];
        for &node in order.iter().rev() {
            if let Some(parent) = parents[node] {
                sizes[parent] += sizes[node];
            }
        }
        Self {
            order,
            parents,
            sizes,
        }
    }
}
