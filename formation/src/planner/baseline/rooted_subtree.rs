//! The paper's candidates: the first subtrees of the target that equal a configuration, or its largest part that fits.

use std::collections::BTreeSet;

use crate::model::Topology;
use crate::planner::placement::{DirectedEdges, NO_COLUMN, Pairs, Score, SmallAssignment};
use crate::planner::rooted_tree::RootedTree;

/// Finds up to `limit` common subtrees of greatest size of two trees, no two on the same set of spots. Each pairs nodes of
/// the configuration with spots, in ascending order of nodes.
///
/// For every spot in the given order, and every node of the configuration on it as the root, one common subtree is tried.
/// The paper, section "Experimental Evaluation", stops in the same way at the first MAX = 20. The sizes come from the
/// dynamic programme of Edmonds and Matula over pairs of directed edges, unweighted.
pub(super) fn largest_common(
    configuration: &Topology,
    target: &Topology,
    spot_order: &[usize],
    limit: usize,
) -> Vec<Pairs> {
    let mut programme = Programme::new(configuration, target);
    let node_count = configuration.node_count();
    let mut roots: Vec<(Score, usize, usize)> = Vec::with_capacity(node_count * spot_order.len());
    for &spot in spot_order {
        for node in 0..node_count {
            let score = programme.score(Branch::whole(node), Branch::whole(spot));
            roots.push((score, node, spot));
        }
    }
    let largest = roots.iter().map(|root| root.0).max();
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    for (score, node, spot) in roots {
        if found.len() >= limit {
            break;
        }
        if Some(score) != largest {
            continue;
        }
        let pairs = programme.reconstruct(node, spot);
        let spots: BTreeSet<usize> = pairs.iter().map(|&(_, spot)| spot).collect();
        if seen.insert(spots) {
            found.push(pairs);
        }
    }
    found
}

/// A tree rooted at a node, without the branch beyond one of the node's edges.
#[derive(Clone, Copy)]
struct Branch {
    node: usize,
    /// The directed edge from the node to its parent; `None` for the whole tree.
    upward: Option<usize>,
}

impl Branch {
    fn whole(node: usize) -> Self {
        Self { node, upward: None }
    }

    /// The branch on the tail's side of a directed edge.
    fn below(edges: &DirectedEdges, upward: usize) -> Self {
        Self {
            node: edges.tail(upward),
            upward: Some(upward),
        }
    }

    /// The branches below the node, each as the directed edge from its root to the node.
    fn children(self, edges: &DirectedEdges) -> impl Iterator<Item = usize> + Clone + '_ {
        (edges.first[self.node]..edges.first[self.node + 1])
            .filter(move |&edge| Some(edge) != self.upward)
            .map(|edge| edges.reverse[edge])
    }
}

struct Programme {
    configuration: DirectedEdges,
    target: DirectedEdges,
    /// The score of the largest common subtree for each pair of directed edges, those of the configuration first.
    table: Vec<Score>,
    assignment: SmallAssignment,
}

impl Programme {
    /// Fills the table, smaller branches first.
    fn new(configuration: &Topology, target: &Topology) -> Self {
        let mut programme = Self {
            configuration: DirectedEdges::of(configuration),
            target: DirectedEdges::of(target),
            table: Vec::new(),
            assignment: SmallAssignment::default(),
        };
        let (branches, places) = (
            programme.configuration.head.len(),
            programme.target.head.len(),
        );
        programme.table = vec![Score::NOTHING; branches * places];
        for branch in branches_by_size(configuration, &programme.configuration) {
            for place in 0..places {
                programme.table[branch * places + place] = programme.score(
                    Branch::below(&programme.configuration, branch),
                    Branch::below(&programme.target, place),
                );
            }
        }
        programme
    }

    /// The score of the largest common subtree with one root on the other, from the table's entries for smaller branches.
    fn score(&mut self, branch: Branch, place: Branch) -> Score {
        let row_count = branch.children(&self.configuration).count();
        let column_count = place.children(&self.target).count();
        if row_count == 0 || column_count == 0 {
            return Score::of_one(0);
        }
        let scores = branch.children(&self.configuration).flat_map(|child| {
            let row = &self.table[child * self.target.head.len()..];
            place.children(&self.target).map(move |spot| row[spot])
        });
        self.assignment.solve(row_count, column_count, scores);
        Score::of_one(0) + self.assignment.score()
    }

    fn reconstruct(&mut self, node: usize, spot: usize) -> Pairs {
        let mut pairs = Vec::new();
        let mut open = vec![(Branch::whole(node), Branch::whole(spot))];
        while let Some((branch, place)) = open.pop() {
            pairs.push((branch.node, place.node));
            let spots: Vec<usize> = place.children(&self.target).collect();
            if spots.is_empty() || branch.children(&self.configuration).next().is_none() {
                continue;
            }
            self.score(branch, place);
            let children = branch.children(&self.configuration);
            for (child, &column) in children.zip(self.assignment.columns()) {
                if column != NO_COLUMN {
                    open.push((
                        Branch::below(&self.configuration, child),
                        Branch::below(&self.target, spots[usize::from(column)]),
                    ));
                }
            }
        }
        pairs.sort_unstable();
        pairs
    }
}

/// All branches of a tree, each as the directed edge from its root upward, smaller branches first.
fn branches_by_size(topology: &Topology, edges: &DirectedEdges) -> Vec<usize> {
    let tree = RootedTree::new(topology, 0);
    let mut branches: Vec<usize> = (0..edges.head.len()).collect();
    branches.sort_by_key(|&edge| {
        let (root, parent) = (edges.tail(edge), edges.head[edge]);
        if tree.parents[root] == Some(parent) {
            tree.sizes[root]
        } else {
            topology.node_count() - tree.sizes[parent]
        }
    });
    branches
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::random::Random;
    use crate::model::MicroUnits;
    use crate::planner::placement::MatchingInput;

    fn random_tree(node_count: usize, random: &mut Random) -> Topology {
        let edges: Vec<(usize, usize)> = (1..node_count)
            .map(|node| (random.index(node), node))
            .collect();
        Topology::new(node_count, &edges)
    }

    #[test]
    fn each_candidate_is_as_large_as_the_exact_programme_says() {
        let mut random = Random::from_seed(11);
        for _ in 0..300 {
            let (nodes, spots) = (1 + random.index(9), 1 + random.index(12));
            let configuration = random_tree(nodes, &mut random);
            let target = random_tree(spots, &mut random);
            let input = MatchingInput {
                configuration: &configuration,
                target: &target,
                weight: |_, _| Some(MicroUnits::ZERO),
            };
            let size = crate::planner::placement::common_subtree::solve(&input)
                .pairs
                .len();
            let order: Vec<usize> = (0..spots).rev().collect();
            let found = largest_common(&configuration, &target, &order, 20);
            assert!(!found.is_empty() && found.len() <= 20);
            let mut spot_sets = BTreeSet::new();
            for embedding in &found {
                assert_eq!(embedding.len(), size);
                assert_eq!(input.kept_links(embedding), size - 1);
                let set: BTreeSet<usize> = embedding.iter().map(|&(_, spot)| spot).collect();
                assert_eq!(set.len(), size);
                assert!(spot_sets.insert(set));
            }
        }
    }

    #[test]
    fn candidates_come_in_the_order_of_the_spots() {
        let path = |count: usize| {
            let edges: Vec<(usize, usize)> = (1..count).map(|node| (node - 1, node)).collect();
            Topology::new(count, &edges)
        };
        let spots_of = |limit: usize| -> Vec<Vec<usize>> {
            largest_common(&path(2), &path(5), &[4, 0, 1, 2, 3], limit)
                .into_iter()
                .map(|embedding| {
                    let mut spots: Vec<usize> = embedding.into_iter().map(|pair| pair.1).collect();
                    spots.sort_unstable();
                    spots
                })
                .collect()
        };
        assert_eq!(spots_of(2), [[3, 4], [0, 1]]);
        assert_eq!(spots_of(20).len(), 4);
    }
}
