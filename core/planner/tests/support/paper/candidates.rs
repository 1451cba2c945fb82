//! Candidates of Algorithm 2 by listing every embedding there is.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// The module on each spot, or the spot of each module.
pub type Map = BTreeMap<usize, usize>;

/// An undirected graph over `0..count`.
#[derive(Clone, Debug)]
pub struct Graph {
    pub count: usize,
    pub edges: Vec<(usize, usize)>,
}

impl Graph {
    pub fn joins(&self, one: usize, other: usize) -> bool {
        self.edges.contains(&(one, other)) || self.edges.contains(&(other, one))
    }

    pub fn around(&self, node: usize) -> Vec<usize> {
        (0..self.count)
            .filter(|&other| self.joins(node, other))
            .collect()
    }
}

/// The links that an embedding keeps: both ends are placed, on adjacent spots.
pub fn kept(configuration: &Graph, target: &Graph, spot_of: &Map) -> Vec<(usize, usize)> {
    let links = configuration.edges.iter().copied();
    links
        .filter(
            |(one, other)| match (spot_of.get(one), spot_of.get(other)) {
                (Some(&here), Some(&there)) => target.joins(here, there),
                _ => false,
            },
        )
        .collect()
}

/// Every assignment of modules to spots that is connected by the links that it keeps and has the most modules; of these,
/// those that keep the most links. Grown module by module; what was met is remembered.
pub fn largest_embeddings(configuration: &Graph, target: &Graph) -> Vec<Map> {
    let mut level: BTreeSet<Map> = BTreeSet::new();
    for module in 0..configuration.count {
        level.extend((0..target.count).map(|spot| Map::from([(module, spot)])));
    }
    loop {
        let mut next = BTreeSet::new();
        for embedding in &level {
            for (&module, &spot) in embedding {
                for other in configuration.around(module) {
                    for there in target.around(spot) {
                        let is_new = !embedding.contains_key(&other)
                            && embedding.values().all(|&taken| taken != there);
                        if is_new {
                            let mut grown = embedding.clone();
                            grown.insert(other, there);
                            next.insert(grown);
                        }
                    }
                }
            }
        }
        if next.is_empty() {
            break;
        }
        level = next;
    }
    let links = |embedding: &Map| kept(configuration, target, embedding).len();
    let most = level.iter().map(links).max().unwrap_or(0);
    level.into_iter().filter(|one| links(one) == most).collect()
}

/// The modules on the spots of an embedding, read breadth-first from the most valuable spot, the lowest of equals.
fn reading(target: &Graph, values: &[i64], embedding: &Map) -> Vec<usize> {
    let module_on: Map = embedding
        .iter()
        .map(|(&module, &spot)| (spot, module))
        .collect();
    let top = module_on
        .keys()
        .min_by_key(|&&spot| (Reverse(values[spot]), spot));
    let mut list = vec![*top.unwrap()];
    let mut next = 0;
    while next < list.len() {
        for spot in target.around(list[next]) {
            if module_on.contains_key(&spot) && !list.contains(&spot) {
                list.push(spot);
            }
        }
        next += 1;
    }
    list.into_iter().map(|spot| module_on[&spot]).collect()
}

/// All candidates in order, each with its embedding.
pub fn all_candidates(
    configuration: &Graph,
    target: &Graph,
    values: &[i64],
    utility: &dyn Fn(usize, usize) -> i64,
    takes_best: bool,
) -> Vec<(Vec<usize>, Map)> {
    let mut by_spots: BTreeMap<Vec<usize>, Vec<Map>> = BTreeMap::new();
    for embedding in largest_embeddings(configuration, target) {
        let mut spots: Vec<usize> = embedding.values().copied().collect();
        spots.sort_unstable();
        by_spots.entry(spots).or_default().push(embedding);
    }
    let mut candidates: Vec<(Vec<usize>, Map)> = by_spots
        .into_iter()
        .map(|(spots, embeddings)| {
            let worth = |embedding: &Map| -> i64 {
                let pairs = embedding.iter();
                pairs.map(|(&module, &spot)| utility(module, spot)).sum()
            };
            let key = |embedding: &Map| {
                let worth = if takes_best { worth(embedding) } else { 0 };
                (Reverse(worth), reading(target, values, embedding))
            };
            (spots, embeddings.into_iter().min_by_key(key).unwrap())
        })
        .collect();
    candidates.sort_by_key(|(spots, _)| {
        let highest = spots.iter().map(|&spot| values[spot]).max().unwrap();
        (Reverse(highest), spots.clone())
    });
    candidates
}
