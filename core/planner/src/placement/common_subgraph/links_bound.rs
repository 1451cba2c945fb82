//! How many links of a configuration a target can keep at all, from the cycles of both.

use std::collections::VecDeque;

use formation_model::Topology;

/// The most odd cycles that are looked for; each costs a walk through the configuration.
const ODD_CYCLES_MAX: usize = 1_000;

/// A bound on the links that any matching keeps.
pub(super) struct LinksBound {
    /// For the whole configuration.
    links_max: usize,
    /// The independent cycles of the target: what a matching keeps has at most as many.
    cycles: usize,
}

impl LinksBound {
    /// A target without odd cycles, such as a grid, breaks a link of each odd cycle of the configuration, such as a square
    /// with a diagonal. Odd cycles that share no link break as many links.
    pub(super) fn of(configuration: &Topology, target: &Topology) -> Self {
        let broken = match odd_cycle(target.node_count(), target.edges()) {
            None => disjoint_odd_cycles(configuration),
            Some(_) => 0,
        };
        Self {
            links_max: configuration.edges().len() - broken,
            cycles: (target.edges().len() + 1).saturating_sub(target.node_count()),
        }
    }

    /// For matchings of a number of modules.
    pub(super) fn for_modules(&self, modules: usize) -> usize {
        self.links_max
            .min((modules + self.cycles).saturating_sub(1))
    }
}

/// The number of odd cycles that share no edge, chosen one after the other.
fn disjoint_odd_cycles(graph: &Topology) -> usize {
    let mut edges = graph.edges().to_vec();
    let mut count = 0;
    while count < ODD_CYCLES_MAX {
        let Some(cycle) = odd_cycle(graph.node_count(), &edges) else {
            break;
        };
        edges.retain(|edge| !cycle.contains(edge));
        count += 1;
    }
    count
}

/// The edges of an odd cycle; `None` if the graph is bipartite.
fn odd_cycle(node_count: usize, edges: &[(usize, usize)]) -> Option<Vec<(usize, usize)>> {
    let graph = Topology::new(node_count, edges);
    // The depth of each node in a breadth-first tree, and its parent; a root is its own.
    let mut reached: Vec<Option<(usize, usize)>> = vec![None; node_count];
    for root in 0..node_count {
        if reached[root].is_some() {
            continue;
        }
        reached[root] = Some((0, root));
        let mut waiting = VecDeque::from([root]);
        while let Some(node) = waiting.pop_front() {
            let depth = reached[node]?.0;
            for &other in graph.neighbours(node) {
                match reached[other] {
                    None => {
                        reached[other] = Some((depth + 1, node));
                        waiting.push_back(other);
                    }
                    Some((of_other, _)) if of_other == depth => {
                        return closed_through_tree(&reached, node, other);
                    }
                    Some(_) => {}
                }
            }
        }
    }
    None
}

/// The cycle of an edge between two nodes of one depth, and the ways of both up the tree to where these meet.
fn closed_through_tree(
    reached: &[Option<(usize, usize)>],
    one: usize,
    other: usize,
) -> Option<Vec<(usize, usize)>> {
    let edge = |one: usize, other: usize| (one.min(other), one.max(other));
    let mut cycle = vec![edge(one, other)];
    let (mut one, mut other) = (one, other);
    while one != other {
        for end in [&mut one, &mut other] {
            let parent = reached[*end]?.1;
            cycle.push(edge(*end, parent));
            *end = parent;
        }
    }
    Some(cycle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_breaks_a_link_of_each_odd_cycle() {
        let square = [(0, 1), (1, 2), (2, 3), (0, 3)];
        let grid = Topology::new(6, &[(0, 1), (1, 2), (3, 4), (4, 5), (0, 3), (1, 4), (2, 5)]);
        let diagonal = [&square[..], &[(0, 2)]].concat();
        let bound = |edges: &[(usize, usize)], target: &Topology| {
            LinksBound::of(&Topology::new(4, edges), target).for_modules(4)
        };
        assert_eq!(bound(&square, &grid), 4);
        assert_eq!(bound(&diagonal, &grid), 4);
        // All six links of four modules: two triangles would share one.
        assert_eq!(bound(&[&diagonal[..], &[(1, 3)]].concat(), &grid), 5);
        let with_diagonal = Topology::new(4, &diagonal);
        assert_eq!(bound(&diagonal, &with_diagonal), 5);
        // A tree keeps no cycle.
        let path = Topology::new(5, &[(0, 1), (1, 2), (2, 3), (3, 4)]);
        assert_eq!(bound(&diagonal, &path), 3);
        // Two triangles with one module in common.
        let bow_tie = Topology::new(5, &[(0, 1), (1, 2), (0, 2), (2, 3), (3, 4), (2, 4)]);
        let wide = Topology::new(
            8,
            &[
                (0, 1),
                (1, 2),
                (2, 3),
                (4, 5),
                (5, 6),
                (6, 7),
                (0, 4),
                (1, 5),
                (2, 6),
                (3, 7),
            ],
        );
        assert_eq!(LinksBound::of(&bow_tie, &wide).for_modules(5), 4);
    }
}
