//! Articulation points of a graph from which nodes are removed one by one.
//!
//! The callers need them after every removal, so this works on plain vectors; `petgraph::algo::articulation_points` builds
//! hash tables at each call.

/// For each node, whether its removal would part its component. `is_left` says which nodes have not been removed, and
/// `neighbour_at` lists the neighbours of a node by index, removed ones included.
///
/// R. Tarjan, "Depth-first search and linear graph algorithms", SIAM Journal on Computing 1, 1972; without recursion, as the
/// depth grows with the graph.
#[must_use]
pub fn cut_nodes(
    node_count: usize,
    is_left: impl Fn(usize) -> bool,
    neighbour_at: impl Fn(usize, usize) -> Option<usize>,
) -> Vec<bool> {
    const NONE: usize = usize::MAX;
    let mut is_cut = vec![false; node_count];
    // For each node, the time of its visit, and the earliest time that it reaches by one back edge below it.
    let mut visited = vec![NONE; node_count];
    let mut lowest = vec![NONE; node_count];
    let mut clock = 0;
    // Each entry: a node, its parent, and the index of the neighbour to look at next.
    let mut stack: Vec<(usize, usize, usize)> = Vec::new();
    for root in (0..node_count).filter(|&node| is_left(node)) {
        if visited[root] != NONE {
            continue;
        }
        let mut root_children = 0;
        let mut entered = Some((root, NONE));
        loop {
            if let Some((node, parent)) = entered.take() {
                visited[node] = clock;
                lowest[node] = clock;
                clock += 1;
                stack.push((node, parent, 0));
            }
            let Some((node, parent, next)) = stack.last_mut() else {
                break;
            };
            let (node, parent) = (*node, *parent);
            if let Some(neighbour) = neighbour_at(node, *next) {
                *next += 1;
                if !is_left(neighbour) || neighbour == parent {
                    continue;
                }
                if visited[neighbour] == NONE {
                    entered = Some((neighbour, node));
                } else {
                    lowest[node] = lowest[node].min(visited[neighbour]);
                }
                continue;
            }
            stack.pop();
            if parent == root {
                root_children += 1;
            } else if parent != NONE && lowest[node] >= visited[parent] {
                is_cut[parent] = true;
            }
            if parent != NONE {
                lowest[parent] = lowest[parent].min(lowest[node]);
            }
        }
        is_cut[root] = root_children > 1;
    }
    is_cut
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Topology;

    #[test]
    fn cut_nodes_are_those_whose_removal_disconnects() {
        let mut edges = vec![
            (0, 1),
            (1, 2),
            (2, 0),
            (2, 3),
            (3, 4),
            (4, 5),
            (5, 3),
            (5, 6),
        ];
        edges.extend([(6, 7), (7, 8), (8, 9), (9, 6), (0, 10)]);
        let graph = Topology::new(11, &edges);
        for missing in [None, Some(10), Some(1), Some(5)] {
            let is_left = |node| Some(node) != missing;
            let parts = graph.components_within(is_left).len();
            let neighbour_at =
                |node: usize, index: usize| graph.neighbours(node).get(index).copied();
            let cut = cut_nodes(11, is_left, neighbour_at);
            for node in (0..11).filter(|&node| is_left(node)) {
                let components = graph.components_within(|other| is_left(other) && other != node);
                assert_eq!(
                    cut[node],
                    components.len() > parts,
                    "node {node} without {missing:?}"
                );
            }
        }
    }
}
