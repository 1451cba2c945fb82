//! Random trees of bounded degree, each node with a cell of the unit lattice.

use std::collections::BTreeSet;

use super::GenerateError;
use super::random::Random;

/// A cell of the unit lattice: column and row.
pub(super) type Cell = (i32, i32);

/// A tree whose nodes are drawn on distinct cells.
pub(super) struct DrawnTree {
    pub(super) cells: Vec<Cell>,
    pub(super) edges: Vec<(usize, usize)>,
}

/// Grows a tree on the unit lattice: each new node is on a free cell adjacent to the node to which it is linked.
///
/// Each step picks uniformly among all pairs of a node with a free port and a free cell adjacent to it. Adjacent cells
/// need not be linked, as adjacent modules need not be docked.
pub(super) fn lattice(node_count: usize, degree_max: usize, random: &mut Random) -> DrawnTree {
    let mut tree = DrawnTree {
        cells: vec![(0, 0)],
        edges: Vec::with_capacity(node_count.saturating_sub(1)),
    };
    let mut taken = BTreeSet::from([(0, 0)]);
    let mut degrees = vec![0_usize];
    let mut frontier: Vec<(usize, Cell)> = adjacent((0, 0)).map(|cell| (0, cell)).into();
    // The frontier never becomes empty: the topmost of the leftmost cells has two free neighbours, so it has a free port at
    // any degree of three or more, and its pairs leave the list only when they are used or become impossible.
    while tree.cells.len() < node_count && !frontier.is_empty() {
        let (parent, cell) = frontier.swap_remove(random.index(frontier.len()));
        if degrees[parent] >= degree_max || !taken.insert(cell) {
            continue;
        }
        let node = tree.cells.len();
        tree.cells.push(cell);
        tree.edges.push((parent, node));
        degrees[parent] += 1;
        degrees.push(1);
        frontier.extend(
            adjacent(cell)
                .into_iter()
                .filter(|other| !taken.contains(other))
                .map(|other| (node, other)),
        );
    }
    tree
}

fn adjacent((column, row): Cell) -> [Cell; 4] {
    [
        (column + 1, row),
        (column - 1, row),
        (column, row + 1),
        (column, row - 1),
    ]
}

/// The greatest number of draws of the degrees of a labelled tree. At 10,000 nodes one draw in about 250 fits, at fewer
/// nodes more, so all of them fail with a probability below 1e-170.
const DRAWS_MAX: usize = 100_000;

/// Draws uniformly among all labelled trees of at most this degree.
///
/// Prüfer's bijection maps labelled trees to sequences of `n - 2` labels in which a node of degree `d` occurs `d - 1`
/// times. The number of occurrences of each label is drawn from a Poisson law cut off at the degree; given that they
/// sum to `n - 2`, every sequence is then equally likely once it is shuffled, whatever the law's rate.
///
/// Such a tree need not fit a lattice, so its nodes are placed row by row in a square, whatever their links.
pub(super) fn uniform_labelled(
    node_count: usize,
    degree_max: usize,
    random: &mut Random,
) -> Result<DrawnTree, GenerateError> {
    let side = i32::try_from(node_count.isqrt()).unwrap_or(i32::MAX).max(1);
    let cells = (0..)
        .take(node_count)
        .map(|index| (index % side, index / side))
        .collect();
    let sequence = pruefer_sequence(node_count, degree_max, random)?;
    Ok(DrawnTree {
        cells,
        edges: decode_pruefer(node_count, &sequence),
    })
}

fn pruefer_sequence(
    node_count: usize,
    degree_max: usize,
    random: &mut Random,
) -> Result<Vec<usize>, GenerateError> {
    let length = node_count.saturating_sub(2);
    // The weights of 0, 1, 2, ... occurrences: rate^k / k! in millionths. The rates 1.414 and 1.08 make the mean about 1.
    let weights: &[u64] = if degree_max == 3 {
        &[1_000_000, 1_414_000, 999_698]
    } else {
        &[1_000_000, 1_080_000, 583_200, 209_952]
    };
    let total = weights.iter().sum();
    for _ in 0..DRAWS_MAX {
        let mut sequence = Vec::with_capacity(length + degree_max);
        for label in 0..node_count {
            let mut rest = random.below(total);
            for &weight in weights {
                if rest < weight {
                    break;
                }
                rest -= weight;
                sequence.push(label);
            }
            if sequence.len() > length {
                break;
            }
        }
        if sequence.len() == length {
            random.shuffle(&mut sequence);
            return Ok(sequence);
        }
    }
    Err(GenerateError::NoTreeFound { node_count })
}

/// The edges of the tree with a given Prüfer sequence, in linear time.
fn decode_pruefer(node_count: usize, sequence: &[usize]) -> Vec<(usize, usize)> {
    if node_count < 2 {
        return Vec::new();
    }
    let mut degrees = vec![1_usize; node_count];
    for &label in sequence {
        degrees[label] += 1;
    }
    let mut edges = Vec::with_capacity(node_count - 1);
    let mut lowest_leaf = degrees.iter().position(|&degree| degree == 1).unwrap_or(0);
    let mut leaf = lowest_leaf;
    for &label in sequence {
        edges.push((leaf, label));
        degrees[label] -= 1;
        if degrees[label] == 1 && label < lowest_leaf {
            leaf = label;
        } else {
            lowest_leaf += 1;
            while degrees[lowest_leaf] != 1 {
                lowest_leaf += 1;
            }
            leaf = lowest_leaf;
        }
    }
    // The highest label is never removed, so it ends the last edge.
    edges.push((leaf, node_count - 1));
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use formation_model::Topology;
    use std::collections::BTreeMap;

    fn assert_tree(tree: &DrawnTree, node_count: usize, degree_max: usize) {
        let topology = Topology::new(node_count, &tree.edges);
        assert!(topology.is_tree(), "{node_count} nodes");
        assert!((0..node_count).all(|node| topology.degree(node) <= degree_max));
        let distinct: BTreeSet<_> = tree.cells.iter().collect();
        assert_eq!(distinct.len(), node_count);
    }

    #[test]
    fn both_kinds_are_trees_of_the_degree_asked_for() {
        for degree_max in [3, 4] {
            for node_count in (1..40).chain([100, 3_000]) {
                let mut random = Random::from_seed(node_count as u64);
                let drawn = lattice(node_count, degree_max, &mut random);
                assert_tree(&drawn, node_count, degree_max);
                for &(one, other) in &drawn.edges {
                    assert!(adjacent(drawn.cells[one]).contains(&drawn.cells[other]));
                }
                let labelled = uniform_labelled(node_count, degree_max, &mut random).unwrap();
                assert_tree(&labelled, node_count, degree_max);
            }
        }
    }

    #[test]
    fn lattice_trees_reach_the_degree_allowed() {
        let widest = |degree_max| {
            let tree = lattice(300, degree_max, &mut Random::from_seed(9));
            let topology = Topology::new(300, &tree.edges);
            (0..300).map(|node| topology.degree(node)).max()
        };
        assert_eq!((widest(3), widest(4)), (Some(3), Some(4)));
    }

    /// Cayley's formula counts 125 labelled trees of 5 nodes; the 5 stars have degree 4, the other 120 at most 3.
    #[test]
    fn labelled_trees_are_uniform() {
        let mut random = Random::from_seed(7);
        for (degree_max, trees) in [(4, 125), (3, 120)] {
            let draws = 400 * trees;
            let mut seen: BTreeMap<Vec<(usize, usize)>, usize> = BTreeMap::new();
            for _ in 0..draws {
                let tree = uniform_labelled(5, degree_max, &mut random).unwrap();
                let topology = Topology::new(5, &tree.edges);
                *seen.entry(topology.edges().to_vec()).or_default() += 1;
            }
            assert_eq!(seen.len(), trees);
            // Each count has mean 400 and deviation 20; five deviations leave no room for a biased sampler.
            assert!(seen.values().all(|count| (300..=500).contains(count)));
        }
    }
}
