//! The candidates of a configuration: the subgraphs of the target that equal it, or else its largest part that fits
//! (Algorithm 2, lines 1 to 4, and the paper's section "Experimental Evaluation" for MAX).
//!
//! A candidate is a set of spots. It carries an *embedding*: an assignment of that many modules of the configuration to
//! the spots, one each, such that the links that it keeps, those whose ends take adjacent spots, connect these modules. Its
//! size is the greatest that any set has: all modules if the target has an isomorphic subgraph. With cycles in the
//! configuration, an embedding also keeps as many links as any of this size can; all of them in an isomorphic subgraph. The
//! subgraph need not be induced: spots can be adjacent though their modules are not docked.
//!
//! **Order of candidates.** By the value of their most valuable spot, the greater first; among equals by their spots in
//! ascending order of identifiers, compared like words. The first MAX of this order are the candidates of a turn.
//!
//! **Embedding.** The spots of a candidate are listed breadth-first from the most valuable one (the lowest of equals),
//! neighbours in ascending order of identifier, along the edges between spots of the candidate. An embedding is read as the
//! modules on these spots, and two embeddings are compared like words. The `first` embedding is the least of all; the `best`
//! one has the greatest utility, and is the least among equals.
//!
//! The sets come one after another (`enumeration`), each after at most two questions for each spot: is there a candidate
//! that has these spots and not those? If both graphs are trees, a dynamic programme answers (`on_trees`), so the delay
//! between two candidates is polynomial. With cycles the question is NP-hard; a search answers under a budget of search
//! nodes (`on_graphs`), and if it ends early, the result is not `proven`.

mod enumeration;
mod on_graphs;
mod on_trees;

use std::cmp::Reverse;

use crate::placement::Pairs;
use enumeration::Enumeration;
use formation_model::{Embedding, MicroUnits, Topology};
use on_graphs::GraphSearch;
use on_trees::TreeProgramme;

/// The candidates of a configuration, in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Candidates {
    /// Each pairs nodes of the configuration with spots, ascending by the former.
    pub embeddings: Vec<Pairs>,
    /// Whether these are the candidates asked for, each with the embedding asked for. Always true if both graphs are
    /// trees.
    pub proven: bool,
    /// The search nodes that were spent, 0 on trees.
    pub nodes: u64,
}

/// A configuration, a target, and what decides between candidates. Both graphs are connected; nodes are named by their
/// positions in ascending order of identifier.
#[derive(Clone, Copy, Debug)]
pub struct CandidateInput<'a, V, U> {
    /// The links of the modules.
    pub configuration: &'a Topology,
    /// The edges of the spots.
    pub target: &'a Topology,
    /// The value of each spot.
    pub value: V,
    /// The utility of each node of the configuration (first) for each spot.
    pub utility: U,
    /// Which embedding of a candidate counts.
    pub embedding: Embedding,
    /// The search nodes that may be spent on graphs with cycles.
    pub nodes_max: u64,
}

impl<V, U> CandidateInput<'_, V, U>
where
    V: Fn(usize) -> MicroUnits,
    U: Fn(usize, usize) -> MicroUnits,
{
    /// The first `limit` candidates.
    pub fn candidates(&self, limit: usize) -> Candidates {
        if self.configuration.is_tree() && self.target.is_tree() {
            self.on_trees(limit)
        } else {
            self.on_graphs(limit)
        }
    }

    fn on_trees(&self, limit: usize) -> Candidates {
        let programme = TreeProgramme::new(self.configuration, self.target);
        let size = programme.greatest_size();
        let sets = Enumeration::new(&programme, self.classes(), size);
        let embeddings = sets.take(limit).map(|(top, spots)| {
            programme.embedding(top, &spots, |node, spot| self.weight(node, spot))
        });
        Candidates {
            embeddings: embeddings.collect(),
            proven: true,
            nodes: 0,
        }
    }

    fn on_graphs(&self, limit: usize) -> Candidates {
        let search = GraphSearch::new(self.configuration, self.target, self.nodes_max);
        let sets = Enumeration::new(&search, self.classes(), search.size());
        let found = sets.take(limit).filter_map(|(top, spots)| {
            search.embedding(top, &spots, |node, spot| self.weight(node, spot))
        });
        let mut embeddings: Vec<Pairs> = found.collect();
        if embeddings.is_empty() && limit > 0 {
            embeddings.push(search.fallback().to_vec());
        }
        Candidates {
            embeddings,
            proven: search.is_proven(),
            nodes: search.nodes(),
        }
    }

    /// What a pair adds to the worth of an embedding.
    fn weight(&self, node: usize, spot: usize) -> i64 {
        match self.embedding {
            Embedding::First => 0,
            Embedding::Best => (self.utility)(node, spot).0,
        }
    }

    /// The spots of equal value together, ascending; greater values first.
    fn classes(&self) -> Vec<Vec<usize>> {
        let mut spots: Vec<(MicroUnits, usize)> = (0..self.target.node_count())
            .map(|spot| ((self.value)(spot), spot))
            .collect();
        spots.sort_unstable_by_key(|&(value, spot)| (Reverse(value), spot));
        spots
            .chunk_by(|one, other| one.0 == other.0)
            .map(|class| class.iter().map(|&(_, spot)| spot).collect())
            .collect()
    }
}

/// The spots of a candidate breadth-first from its top, as positions in `spots`, which ascend. Spots that are not connected
/// to the top are left out.
fn listed_from(target: &Topology, top: usize, spots: &[usize]) -> Vec<usize> {
    let mut is_listed = vec![false; spots.len()];
    let mut list: Vec<usize> = spots.binary_search(&top).into_iter().collect();
    for &first in &list {
        is_listed[first] = true;
    }
    let mut next = 0;
    while let Some(&position) = list.get(next) {
        for neighbour in target.neighbours(spots[position]) {
            if let Ok(other) = spots.binary_search(neighbour)
                && !is_listed[other]
            {
                is_listed[other] = true;
                list.push(other);
            }
        }
        next += 1;
    }
    list
}
