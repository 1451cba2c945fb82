//! The paper's candidates: the first subtrees of the target that equal a configuration, or as much of it as can be.

use std::collections::BTreeSet;

use crate::model::Topology;
use crate::planner::placement::small_assignment::{NO_COLUMN, Score, SmallAssignment};

/// A configuration's node and the spot that it takes, ascending by node.
pub(super) type Embedding = Vec<(usize, usize)>;

/// Finds up to `limit` common subtrees of greatest size of two trees, each on spots of its own.
///
/// Every spot in the given order, with every node of the configuration laid on it as the root, is tried for one common
/// subtree. The paper, section "Experimental Evaluation", stops in the same way at the first MAX = 20. Sizes come from
/// the programme of Edmonds and Matula over pairs of directed edges, unweighted.
pub(super) fn largest_common(
    configuration: &Topology,
    target: &Topology,
    spot_order: &[usize],
    limit: usize,
) -> Vec<Embedding> {
    let mut programme = Programme::new(configuration, target);
    programme.fill();
    let node_count = configuration.node_count();
    let mut roots: Vec<(Score, usize, usize)> = Vec::with_capacity(node_count * spot_order.len());
    for &spot in spot_order {
        for node in 0..node_count {
            let score = programme.rooted(Rooted::whole(node), Rooted::whole(spot));
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
        let embedding = programme.reconstruct(node, spot);
        let mut spots: Vec<usize> = embedding.iter().map(|&(_, spot)| spot).collect();
        spots.sort_unstable();
        if seen.insert(spots) {
            found.push(embedding);
        }
    }
    found
}

/// A tree hung up at a node, without the branch towards `parent`.
#[derive(Clone, Copy)]
struct Rooted {
    node: usize,
    parent: Option<usize>,
}

impl Rooted {
    fn whole(node: usize) -> Self {
        Self { node, parent: None }
    }

    fn children(self, topology: &Topology) -> impl Iterator<Item = Self> + Clone + '_ {
        topology
            .neighbours(self.node)
            .iter()
            .copied()
            .filter(move |&child| Some(child) != self.parent)
            .map(move |child| Self {
                node: child,
                parent: Some(self.node),
            })
    }
}

/// Numbers the directed edges of a tree, by the node at the lower end and the place of its parent in its list.
struct DirectedEdges {
    offsets: Vec<usize>,
    count: usize,
}

impl DirectedEdges {
    fn new(topology: &Topology) -> Self {
        let mut count = 0;
        let offsets = (0..topology.node_count())
            .map(|node| {
                let offset = count;
                count += topology.degree(node);
                offset
            })
            .collect();
        Self { offsets, count }
    }

    fn number(&self, topology: &Topology, node: usize, parent: usize) -> usize {
        let place = topology.neighbours(node).binary_search(&parent);
        self.offsets[node] + place.unwrap_or_default()
    }
}

struct Programme<'a> {
    configuration: &'a Topology,
    target: &'a Topology,
    configuration_edges: DirectedEdges,
    target_edges: DirectedEdges,
    /// The size of the largest common subtree for each pair of directed edges.
    table: Vec<Score>,
    assignment: SmallAssignment,
}

impl<'a> Programme<'a> {
    fn new(configuration: &'a Topology, target: &'a Topology) -> Self {
        let configuration_edges = DirectedEdges::new(configuration);
        let target_edges = DirectedEdges::new(target);
        Self {
            table: vec![Score::NOTHING; configuration_edges.count * target_edges.count],
            configuration,
            target,
            configuration_edges,
            target_edges,
            assignment: SmallAssignment::default(),
        }
    }

    fn entry(&self, branch: Rooted, place: Rooted) -> usize {
        let number = |edges: &DirectedEdges, topology: &Topology, rooted: Rooted| {
            let parent = rooted.parent.unwrap_or_default();
            edges.number(topology, rooted.node, parent)
        };
        number(&self.configuration_edges, self.configuration, branch) * self.target_edges.count
            + number(&self.target_edges, self.target, place)
    }

    /// Fills the table, smaller branches first.
    fn fill(&mut self) {
        for branch in branches_by_size(self.configuration) {
            for spot in 0..self.target.node_count() {
                for &parent in self.target.neighbours(spot) {
                    let place = Rooted {
                        node: spot,
                        parent: Some(parent),
                    };
                    let entry = self.entry(branch, place);
                    self.table[entry] = self.rooted(branch, place);
                }
            }
        }
    }

    /// The size of the largest common subtree with one root on the other; the branches below must be in the table.
    fn rooted(&mut self, branch: Rooted, place: Rooted) -> Score {
        let row_count = branch.children(self.configuration).count();
        let column_count = place.children(self.target).count();
        if row_count == 0 || column_count == 0 {
            return Score::of_one(0);
        }
        let scores: Vec<Score> = branch
            .children(self.configuration)
            .flat_map(|child| place.children(self.target).map(move |spot| (child, spot)))
            .map(|(child, spot)| self.table[self.entry(child, spot)])
            .collect();
        self.assignment
            .solve(row_count, column_count, scores.into_iter());
        Score::of_one(0) + self.assignment.score()
    }

    fn reconstruct(&mut self, node: usize, spot: usize) -> Embedding {
        let mut embedding = Vec::new();
        let mut open = vec![(Rooted::whole(node), Rooted::whole(spot))];
        while let Some((branch, place)) = open.pop() {
            embedding.push((branch.node, place.node));
            let spots: Vec<Rooted> = place.children(self.target).collect();
            if spots.is_empty() || branch.children(self.configuration).next().is_none() {
                continue;
            }
            self.rooted(branch, place);
            let children = branch.children(self.configuration);
            open.extend(
                children
                    .zip(self.assignment.columns())
                    .filter(|&(_, &column)| column != NO_COLUMN)
                    .map(|(child, &column)| (child, spots[usize::from(column)])),
            );
        }
        embedding.sort_unstable();
        embedding
    }
}

/// All branches of a tree, smaller ones first, so that a branch comes after those below it.
fn branches_by_size(tree: &Topology) -> Vec<Rooted> {
    let mut order = vec![Rooted::whole(0)];
    let mut next = 0;
    while let Some(&rooted) = order.get(next) {
        order.extend(rooted.children(tree));
        next += 1;
    }
    let mut sizes = vec![1_usize; tree.node_count()];
    for rooted in order.iter().rev() {
        if let Some(parent) = rooted.parent {
            sizes[parent] += sizes[rooted.node];
        }
    }
    let mut branches: Vec<(usize, Rooted)> = order
        .iter()
        .filter_map(|&rooted| Some((rooted, rooted.parent?)))
        .flat_map(|(downward, parent)| {
            let size = sizes[downward.node];
            let upward = Rooted {
                node: parent,
                parent: Some(downward.node),
            };
            [(size, downward), (tree.node_count() - size, upward)]
        })
        .collect();
    branches.sort_by_key(|&(size, _)| size);
    branches.into_iter().map(|(_, branch)| branch).collect()
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
        Topology::new(node_count, &edges).unwrap()
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
            Topology::new(count, &edges).unwrap()
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
