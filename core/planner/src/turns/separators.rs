//! The nodes whose removal parts a connected graph, while nodes are removed one by one.
//!
//! A full search for articulation points after each removal ([`formation_model::cut_nodes`]) makes peeling a target
//! quadratic. Here a node is examined only when it is the next to be removed. It parts the graph if its neighbours are not
//! connected without it, and a search from all of them at once finds that after as many steps as the smallest part has
//! nodes, or after the way round the node. A node that parts the graph does so as long as two of its neighbours in
//! different parts are left, because removals keep the rest connected and never join parts. So it is examined again only
//! when one of these two is removed, which happens at most as often as it has neighbours.

use std::collections::VecDeque;

use formation_model::Topology;

/// A search from the neighbours of one node, by the number of the search; other entries are void.
#[derive(Clone, Copy, Debug, Default)]
struct Visit {
    search: usize,
    /// The neighbour from which the search came.
    from: usize,
}

/// Answers for a graph from which nodes are removed.
pub(super) struct Separators<'a> {
    topology: &'a Topology,
    /// For each node, those that part the graph while it is left.
    dependents: Vec<Vec<usize>>,
    /// Whether the node is known to part the graph.
    is_known: Vec<bool>,
    visits: Vec<Visit>,
    searches: usize,
}

impl<'a> Separators<'a> {
    pub(super) fn new(topology: &'a Topology) -> Self {
        let count = topology.node_count();
        Self {
            topology,
            dependents: vec![Vec::new(); count],
            is_known: vec![false; count],
            visits: vec![Visit::default(); count],
            searches: 0,
        }
    }

    /// Whether the removal of a node would part the graph of the nodes in `is_left`, which must be connected. If so,
    /// [`Self::remove`] names the node when that may have changed.
    pub(super) fn is_separator(&mut self, node: usize, is_left: &[bool]) -> bool {
        let Some((one, other)) = self.parted_by(node, is_left) else {
            return false;
        };
        self.is_known[node] = true;
        self.dependents[one].push(node);
        self.dependents[other].push(node);
        true
    }

    /// Removes a node. Returns the separators that may no longer be separators.
    pub(super) fn remove(&mut self, node: usize) -> Vec<usize> {
        let mut freed = std::mem::take(&mut self.dependents[node]);
        freed.retain(|&dependent| std::mem::replace(&mut self.is_known[dependent], false));
        freed
    }

    /// Two neighbours of a node that are connected through it alone.
    fn parted_by(&mut self, node: usize, is_left: &[bool]) -> Option<(usize, usize)> {
        let neighbours = self.topology.neighbours(node).iter().copied();
        let starts: Vec<usize> = neighbours.filter(|&start| is_left[start]).collect();
        self.searches += 1;
        let search = self.searches;
        self.visits[node] = Visit { search, from: 0 };
        // The searches by the index of their start; those that meet become one.
        let mut joined_to: Vec<usize> = (0..starts.len()).collect();
        let mut fronts: Vec<VecDeque<usize>> = Vec::with_capacity(starts.len());
        for (from, &start) in starts.iter().enumerate() {
            self.visits[start] = Visit { search, from };
            fronts.push(VecDeque::from([start]));
        }
        let mut apart = starts.len();
        while apart > 1 {
            for index in 0..starts.len() {
                if joined_to[index] != index {
                    continue;
                }
                let Some(reached) = fronts[index].pop_front() else {
                    // This part is searched; any other start lies in another part.
                    let other =
                        (0..starts.len()).find(|&other| root_of(&joined_to, other) != index)?;
                    return Some((starts[index], starts[other]));
                };
                for &next in self.topology.neighbours(reached) {
                    if !is_left[next] {
                        continue;
                    }
                    let visit = &mut self.visits[next];
                    if visit.search != search {
                        *visit = Visit {
                            search,
                            from: index,
                        };
                        fronts[index].push_back(next);
                        continue;
                    }
                    let other = root_of(&joined_to, visit.from);
                    if next != node && other != index {
                        joined_to[other] = index;
                        let mut front = std::mem::take(&mut fronts[other]);
                        fronts[index].append(&mut front);
                        apart -= 1;
                    }
                }
            }
        }
        None
    }
}

fn root_of(joined_to: &[usize], mut index: usize) -> usize {
    while joined_to[index] != index {
        index = joined_to[index];
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_generate::Random;
    use formation_model::cut_nodes;

    /// A connected graph: a random tree, and some more edges.
    fn drawn(random: &mut Random, count: usize) -> Topology {
        let below = |random: &mut Random, bound: usize| {
            usize::try_from(random.below(bound as u64)).unwrap()
        };
        let mut edges: Vec<(usize, usize)> = (1..count)
            .map(|node| (node, node - 1 - below(random, node.min(4))))
            .collect();
        for _ in 0..below(random, 2 * count) {
            let (one, other) = (below(random, count), below(random, count));
            let known = |edge: &(usize, usize)| *edge == (one, other) || *edge == (other, one);
            if one != other && !edges.iter().any(known) {
                edges.push((one, other));
            }
        }
        Topology::new(count, &edges)
    }

    #[test]
    fn answers_equal_those_of_a_full_search_after_each_removal() {
        let mut random = Random::from_seed(5);
        for _ in 0..300 {
            let count = usize::try_from(2 + random.below(40)).unwrap();
            let graph = drawn(&mut random, count);
            let mut separators = Separators::new(&graph);
            let mut is_left = vec![true; count];
            let mut parked = vec![false; count];
            for _ in 1..count {
                let neighbour_at =
                    |node: usize, index: usize| graph.neighbours(node).get(index).copied();
                let is_cut = cut_nodes(count, |node| is_left[node], neighbour_at);
                let mut removable = None;
                for node in (0..count).filter(|&node| is_left[node]) {
                    let found = parked[node] || separators.is_separator(node, &is_left);
                    assert_eq!(found, is_cut[node], "node {node} of {:?}", graph.edges());
                    parked[node] = found;
                    if !found && random.below(3) == 0 {
                        removable = Some(node);
                    }
                }
                let Some(node) = removable else { continue };
                is_left[node] = false;
                for freed in separators.remove(node) {
                    parked[freed] = false;
                }
            }
        }
    }
}
