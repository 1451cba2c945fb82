use super::*;
use crate::placement::{best_matching, common_subtree};
use formation_generate::Random;
use formation_model::{MicroUnits, Topology};

/// More than all searches together can spend.
const PLENTY: u64 = 10_000_000;

/// A connected graph: a random tree and up to `more` edges.
fn graph(random: &mut Random, count: usize, more: usize) -> Topology {
    let mut edges = Vec::new();
    for node in 1..count {
        edges.push((random.index(node), node));
    }
    for _ in 0..more {
        let (first, second) = (random.index(count), random.index(count));
        let edge = (first.min(second), first.max(second));
        if first != second && !edges.contains(&edge) {
            edges.push(edge);
        }
    }
    Topology::new(count, &edges)
}

#[derive(Debug)]
struct Case {
    configuration: Topology,
    target: Topology,
    weights: Vec<Vec<Option<i64>>>,
}

impl Case {
    /// Random weights, of which `forbidden` in 100 are none; a narrow range makes ties.
    fn new(
        random: &mut Random,
        configuration: Topology,
        target: Topology,
        forbidden: usize,
    ) -> Self {
        let range = if random.index(3) == 0 { 3 } else { 1_000 };
        let weights = (0..configuration.node_count())
            .map(|_| {
                (0..target.node_count())
                    .map(|_| {
                        (random.index(100) >= forbidden)
                            .then(|| i64::try_from(random.index(range)).unwrap() - 100)
                    })
                    .collect()
            })
            .collect();
        Self {
            configuration,
            target,
            weights,
        }
    }

    fn input(&self) -> MatchingInput<'_, impl Fn(usize, usize) -> Option<MicroUnits> + '_> {
        MatchingInput {
            configuration: &self.configuration,
            target: &self.target,
            weight: |module: usize, spot: usize| self.weights[module][spot].map(MicroUnits),
        }
    }

    /// Modules, kept links and utility of a matching; fails if it is no matching or is not connected.
    fn score(&self, matching: &Matching) -> (usize, usize, i64) {
        let input = self.input();
        let pairs = &matching.pairs;
        assert!(pairs.is_sorted());
        let modules: Vec<usize> = pairs.iter().map(|pair| pair.0).collect();
        let mut spots: Vec<usize> = pairs.iter().map(|pair| pair.1).collect();
        spots.sort_unstable();
        spots.dedup();
        assert_eq!(spots.len(), pairs.len(), "a spot is used twice");
        let utility: i64 = pairs
            .iter()
            .map(|&(module, spot)| self.weights[module][spot].expect("a forbidden pair"))
            .sum();
        assert_eq!(matching.utility, MicroUnits(utility));
        let kept: Vec<(usize, usize)> = self
            .configuration
            .edges()
            .iter()
            .filter_map(|(first, second)| {
                let places = (
                    modules.binary_search(first).ok()?,
                    modules.binary_search(second).ok()?,
                );
                self.target
                    .has_edge(pairs[places.0].1, pairs[places.1].1)
                    .then_some(places)
            })
            .collect();
        assert_eq!(kept.len(), input.kept_links(pairs));
        let graph = Topology::new(pairs.len(), &kept);
        assert!(graph.components().len() <= 1);
        (pairs.len(), kept.len(), utility)
    }

    /// The best score over all partial injective maps.
    fn best_of_all(&self) -> (usize, usize, i64) {
        let mut image = vec![None; self.configuration.node_count()];
        let mut is_taken = vec![false; self.target.node_count()];
        let mut best = (0, 0, 0);
        self.try_all(0, &mut image, &mut is_taken, &mut best);
        best
    }

    fn try_all(
        &self,
        module: usize,
        image: &mut Vec<Option<usize>>,
        is_taken: &mut Vec<bool>,
        best: &mut (usize, usize, i64),
    ) {
        let Some(weights) = self.weights.get(module) else {
            let kept: Vec<(usize, usize)> = self
                .configuration
                .edges()
                .iter()
                .copied()
                .filter(|&(first, second)| {
                    matches!((image[first], image[second]), (Some(one), Some(other)) if self.target.has_edge(one, other))
                })
                .collect();
            let size = image.iter().flatten().count();
            let utility = (0..image.len())
                .filter_map(|module| self.weights[module][image[module]?])
                .sum::<i64>();
            let score = (size, kept.len(), utility);
            let better = size > 0 && (score > *best || best.0 == 0);
            if better
                && Topology::new(image.len(), &kept)
                    .components_within(|module| image[module].is_some())
                    .len()
                    == 1
            {
                *best = score;
            }
            return;
        };
        self.try_all(module + 1, image, is_taken, best);
        for spot in 0..is_taken.len() {
            if !is_taken[spot] && weights[spot].is_some() {
                is_taken[spot] = true;
                image[module] = Some(spot);
                self.try_all(module + 1, image, is_taken, best);
                image[module] = None;
                is_taken[spot] = false;
            }
        }
    }

    fn check_against_all(&self) -> (usize, usize, i64) {
        let matching = solve(&self.input(), PLENTY);
        assert!(matching.proven);
        let score = self.score(&matching);
        assert_eq!(score, self.best_of_all(), "{self:?}");
        assert_eq!(solve(&self.input(), PLENTY), matching);
        score
    }
}

#[test]
fn small_graphs_equal_brute_force() {
    let (mut whole, mut partial) = (0, 0);
    for seed in 0..2_000 {
        let mut random = Random::from_seed(seed);
        let (modules, spots) = (1 + random.index(6), 1 + random.index(7));
        let (more_links, more_edges) = (random.index(5), random.index(7));
        let configuration = graph(&mut random, modules, more_links);
        let target = graph(&mut random, spots, more_edges);
        let forbidden = [0, 15, 40][random.index(3)];
        let case = Case::new(&mut random, configuration, target, forbidden);
        let (size, kept, _) = case.check_against_all();
        if size == modules && kept == case.configuration.edges().len() {
            whole += 1;
        } else {
            partial += 1;
        }
    }
    assert!(whole > 300 && partial > 300, "{whole} {partial}");
}

#[test]
fn graphs_of_seven_nodes_equal_brute_force() {
    for seed in 0..60 {
        let mut random = Random::from_seed(1_000_000 + seed);
        let (more_links, more_edges) = (random.index(5), random.index(7));
        let configuration = graph(&mut random, 7, more_links);
        let target = graph(&mut random, 7, more_edges);
        let forbidden = [0, 15, 40][random.index(3)];
        Case::new(&mut random, configuration, target, forbidden).check_against_all();
    }
}

/// A grid of columns and rows; a ladder with rungs if there are two rows.
fn grid(columns: usize, rows: usize) -> Topology {
    let mut edges = Vec::new();
    for node in 0..columns * rows {
        if node % columns + 1 < columns {
            edges.push((node, node + 1));
        }
        if node + columns < columns * rows {
            edges.push((node, node + columns));
        }
    }
    Topology::new(columns * rows, &edges)
}

fn ring(count: usize) -> Topology {
    let edges: Vec<(usize, usize)> = (0..count).map(|node| (node, (node + 1) % count)).collect();
    Topology::new(count, &edges)
}

fn path(count: usize) -> Topology {
    let edges: Vec<(usize, usize)> = (1..count).map(|node| (node - 1, node)).collect();
    Topology::new(count, &edges)
}

/// Size and kept links of what is found with random weights, which must be proven.
fn found(configuration: &Topology, target: &Topology, seed: u64) -> (usize, usize) {
    let mut random = Random::from_seed(seed);
    let case = Case::new(&mut random, configuration.clone(), target.clone(), 0);
    let matching = solve(&case.input(), PLENTY);
    assert!(matching.proven);
    let (size, kept, _) = case.score(&matching);
    (size, kept)
}

#[test]
fn rings_ladders_and_grids_are_placed_whole_where_they_fit() {
    for (configuration, target, kept) in [
        (ring(6), grid(4, 3), 6),
        (ring(12), grid(10, 10), 12),
        (grid(5, 2), grid(10, 10), 13),
        (grid(3, 3), grid(10, 10), 12),
        (grid(4, 2), grid(30, 2), 10),
        (path(10), grid(10, 10), 9),
        (ring(20), ring(20), 20),
    ] {
        let size = configuration.node_count();
        assert_eq!(found(&configuration, &target, 1), (size, kept));
    }
}

#[test]
fn what_does_not_fit_whole_keeps_the_most_modules_before_the_most_links() {
    // A ring into a path loses one link, a cycle of odd length into a grid too.
    assert_eq!(found(&ring(6), &path(9), 1), (6, 5));
    assert_eq!(found(&ring(5), &grid(3, 3), 1), (5, 4));
    // A ladder of three rungs becomes one path along a ring.
    assert_eq!(found(&grid(3, 2), &ring(12), 1), (6, 5));
    // A ring of four with a tail opens into a path; a path lies along such a ring.
    let kite = Topology::new(5, &[(0, 1), (1, 2), (2, 3), (0, 3), (3, 4)]);
    assert_eq!(found(&kite, &path(5), 1), (5, 4));
    assert_eq!(found(&path(5), &kite, 1), (5, 4));
    // More modules than spots.
    assert_eq!(found(&grid(3, 3), &ring(4), 1), (4, 4));
}

#[test]
fn a_ring_with_a_tail_keeps_all_its_links_on_a_cyclic_target() {
    let mut edges: Vec<(usize, usize)> = ring(6).edges().to_vec();
    edges.extend([(2, 6), (6, 7)]);
    let tailed = Topology::new(8, &edges);
    assert_eq!(found(&tailed, &grid(4, 4), 1), (8, 8));
}

#[test]
fn forbidden_spots_are_never_used() {
    let mut random = Random::from_seed(3);
    let mut case = Case::new(&mut random, ring(4), grid(4, 4), 0);
    for weights in &mut case.weights {
        // Only the cells of the rightmost two columns of the lowest two rows are left.
        for (spot, weight) in weights.iter_mut().enumerate() {
            if ![2, 3, 6, 7].contains(&spot) {
                *weight = None;
            }
        }
    }
    let matching = solve(&case.input(), PLENTY);
    assert_eq!(case.score(&matching).1, 4);
    for weights in &mut case.weights {
        weights.fill(None);
    }
    let matching = solve(&case.input(), PLENTY);
    assert_eq!((matching.pairs.len(), matching.proven), (0, true));
}

#[test]
fn a_search_that_ends_at_its_budget_gives_its_best_matching_unproven() {
    let mut random = Random::from_seed(8);
    for (configuration, target) in [(path(20), grid(10, 10)), (grid(4, 3), grid(20, 2))] {
        let case = Case::new(&mut random, configuration, target, 0);
        let mut last = (0, 0, i64::MIN);
        for nodes_max in [0, 1, 50, 500, 5_000] {
            let matching = solve(&case.input(), nodes_max);
            assert!(!matching.proven);
            assert_eq!(matching, solve(&case.input(), nodes_max));
            let score = case.score(&matching);
            assert!(nodes_max < 50 || score.0 > 1, "{score:?}");
            assert!(score.0 >= last.0, "{score:?} after {last:?}");
            last = score;
        }
    }
}

#[test]
fn climbing_improves_a_matching_and_keeps_it_valid() {
    let mut improved = 0;
    for seed in 0..40 {
        let mut random = Random::from_seed(seed);
        let (configuration, target) = (graph(&mut random, 30, 6), graph(&mut random, 60, 15));
        let case = Case::new(&mut random, configuration, target, 20);
        let input = case.input();
        let mut last = (0, 0, i64::MIN);
        let mut pairs = Vec::new();
        for rounds in [1, 10, 40] {
            pairs = spanning_trees::climb(&input, pairs, rounds, rounds).0;
            let score = case.score(&finish(&input, pairs.clone(), true, 0, 0));
            assert!(score >= last, "{score:?} after {last:?} with seed {seed}");
            improved += usize::from(score > last);
            last = score;
        }
    }
    assert!(improved > 60, "{improved}");
    // Along trees one round is exact.
    let mut random = Random::from_seed(99);
    let (configuration, target) = (graph(&mut random, 20, 0), graph(&mut random, 40, 0));
    let case = Case::new(&mut random, configuration, target, 20);
    let exact = common_subtree::solve(&case.input());
    assert_eq!(
        spanning_trees::climb(&case.input(), Vec::new(), 1, 1).0,
        exact.pairs
    );
}

/// A path with teeth: two of these with different distances between the teeth are too hard for the general search.
fn comb(count: usize, every: usize) -> Topology {
    let mut edges = path(count).edges().to_vec();
    for (tooth, node) in (0..count).step_by(every).enumerate() {
        edges.push((node, count + tooth));
    }
    Topology::new(edges.len() + 1, &edges)
}

#[test]
fn trees_are_matched_exactly_however_large() {
    let (target, configuration) = (comb(120, 3), comb(60, 2));
    let weight = |node: usize, spot: usize| {
        (!(node + spot).is_multiple_of(7))
            .then(|| MicroUnits(i64::try_from(node * spot % 101).unwrap()))
    };
    let matching = best_matching(&target, &configuration, weight, 0);
    let input = MatchingInput {
        configuration: &configuration,
        target: &target,
        weight,
    };
    assert_eq!(matching, common_subtree::solve(&input));
    assert!(matching.proven);
    assert!(!solve(&input, PLENTY).proven);
}
