//! Candidates on graphs of which at least one has a cycle, by a search under a budget.
//!
//! An embedding grows from a module on the top by a module docked to a placed one, on a spot adjacent to that one's spot.
//! There is a branch for each such spot of one module, and a last branch that forbids all these pairs; another neighbour can
//! still bring the module there. So each embedding is met once.

use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::VecDeque;

use fixedbitset::FixedBitSet;

use super::enumeration::{Mark, Oracle, Oracles};
use super::listed_from;
use crate::placement::{Matching, MatchingInput, Pairs, best_matching};
use formation_model::{MicroUnits, Topology};

/// The greatest number of search nodes for the candidates of one turn, beyond the search for their size.
const NODES_MAX: u64 = 300_000;
/// The greatest number for one question, and for the embedding of one candidate.
const NODES_MAX_EACH: u64 = 20_000;

/// A configuration and a target of which at least one has a cycle, and the budget.
pub(super) struct GraphSearch<'a> {
    configuration: &'a Topology,
    target: &'a Topology,
    /// A largest matching; one of those that keep the most links.
    largest: Matching,
    /// The number of links that an embedding keeps.
    kept_links: usize,
    /// How far a spot of an embedding can be from that of each module.
    reach_of: Vec<usize>,
    budget: RefCell<Budget>,
}

struct Budget {
    left: u64,
    spent: u64,
    /// Whether a search ended at its budget.
    is_spent: bool,
}

impl<'a> GraphSearch<'a> {
    /// Finds the size of candidates. All searches together spend at most `nodes_max` nodes.
    pub(super) fn new(configuration: &'a Topology, target: &'a Topology, nodes_max: u64) -> Self {
        let weight = |_, _| Some(MicroUnits::ZERO);
        let largest = best_matching(target, configuration, weight, nodes_max);
        let input = MatchingInput {
            configuration,
            target,
            weight,
        };
        let kept_links = input.kept_links(&largest.pairs);
        let reach_of = |module: usize| {
            let is_whole = kept_links == configuration.edges().len();
            if is_whole || configuration.is_tree() {
                let distances = distances_within(configuration, module, |_| true);
                distances.into_iter().max().unwrap_or(0)
            } else {
                largest.pairs.len()
            }
        };
        let reach_of = (0..configuration.node_count()).map(reach_of).collect();
        let budget = RefCell::new(Budget {
            left: NODES_MAX.min(nodes_max.saturating_sub(largest.nodes)),
            spent: largest.nodes,
            is_spent: !largest.proven,
        });
        Self {
            configuration,
            target,
            largest,
            kept_links,
            reach_of,
            budget,
        }
    }

    /// The search nodes that were spent.
    pub(super) fn nodes(&self) -> u64 {
        self.budget.borrow().spent
    }

    /// The number of modules of a candidate.
    pub(super) fn size(&self) -> usize {
        self.largest.pairs.len()
    }

    /// Whether every link is kept.
    fn is_whole(&self) -> bool {
        self.kept_links == self.configuration.edges().len()
    }

    /// A candidate for a search that has ended before it found one.
    pub(super) fn fallback(&self) -> &[(usize, usize)] {
        &self.largest.pairs
    }

    /// Whether no search has ended at its budget.
    pub(super) fn is_proven(&self) -> bool {
        !self.budget.borrow().is_spent
    }

    /// The least of the embeddings of greatest weight on the spots of a candidate; `None` if the budget ends before one is
    /// found.
    pub(super) fn embedding(
        &self,
        top: usize,
        spots: &[usize],
        weight: impl Fn(usize, usize) -> i64,
    ) -> Option<Pairs> {
        let list: Vec<usize> = listed_from(self.target, top, spots)
            .into_iter()
            .map(|position| spots[position])
            .collect();
        let mut marks = vec![Mark::Excluded; self.target.node_count()];
        for &spot in spots {
            marks[spot] = Mark::Chosen;
        }
        let nodes = 0..self.configuration.node_count();
        let mut worth = Worth {
            most: marks.iter().map(|_| 0).collect(),
            weight: &weight,
            best: None,
            list,
        };
        for &spot in spots {
            let weights = nodes.clone().map(|node| weight(node, spot));
            worth.most[spot] = weights.max().unwrap_or(0);
        }
        self.search(top, &marks, &mut worth);
        let (_, modules) = worth.best?;
        let mut pairs: Pairs = modules.into_iter().zip(worth.list).collect();
        pairs.sort_unstable();
        Some(pairs)
    }

    /// Runs through the embeddings with a module on the top, until one is enough or the budget ends.
    fn search(&self, top: usize, marks: &[Mark], goal: &mut impl Goal) {
        let distances = distances_within(self.target, top, |spot| marks[spot] != Mark::Excluded);
        let chosen = (0..marks.len()).filter(|&spot| marks[spot] == Mark::Chosen);
        let Some(farthest) = chosen.map(|spot| distances[spot]).max() else {
            return;
        };
        let mut budget = self.budget.borrow_mut();
        let each = budget.left.min(NODES_MAX_EACH);
        let mut growth = Growth::new(self, marks, each);
        for module in 0..self.configuration.node_count() {
            if farthest > self.reach_of[module] {
                continue;
            }
            growth.take(module, top);
            let flow = growth.grow(goal);
            growth.release(module);
            if flow == Flow::Enough {
                break;
            }
            if flow == Flow::Spent {
                budget.is_spent = true;
                break;
            }
        }
        let spent = each - growth.nodes_left;
        budget.left -= spent;
        budget.spent += spent;
    }
}

/// The number of edges from a node to each other one on the shortest path through admitted nodes; `usize::MAX` without one.
fn distances_within(
    graph: &Topology,
    from: usize,
    is_admitted: impl Fn(usize) -> bool,
) -> Vec<usize> {
    let mut distances = vec![usize::MAX; graph.node_count()];
    distances[from] = 0;
    let mut open = VecDeque::from([from]);
    while let Some(node) = open.pop_front() {
        for &neighbour in graph.neighbours(node) {
            if distances[neighbour] == usize::MAX && is_admitted(neighbour) {
                distances[neighbour] = distances[node] + 1;
                open.push_back(neighbour);
            }
        }
    }
    distances
}

impl Oracles for GraphSearch<'_> {
    type Oracle<'s>
        = GraphOracle<'s>
    where
        Self: 's;

    fn oracle<'s>(&'s self, top: usize, _marks: &[Mark]) -> GraphOracle<'s> {
        GraphOracle { search: self, top }
    }
}

/// Answers for one top.
pub(super) struct GraphOracle<'s> {
    search: &'s GraphSearch<'s>,
    top: usize,
}

impl Oracle for GraphOracle<'_> {
    fn complete(&mut self, marks: &[Mark]) -> Option<FixedBitSet> {
        let mut found = Found(None);
        self.search.search(self.top, marks, &mut found);
        found.0
    }
}

/// What a search looks for.
trait Goal {
    /// Whether a better embedding than those met so far may follow.
    fn may_improve(&self, growth: &Growth<'_>) -> bool;

    /// Takes note of an embedding; true if no more are needed.
    fn meet(&mut self, growth: &Growth<'_>) -> bool;
}

/// The spots of any one embedding.
struct Found(Option<FixedBitSet>);

impl Goal for Found {
    fn may_improve(&self, _growth: &Growth<'_>) -> bool {
        true
    }

    fn meet(&mut self, growth: &Growth<'_>) -> bool {
        self.0 = Some(growth.taken.clone());
        true
    }
}

/// The embedding of greatest weight on some spots; the least of equals.
struct Worth<'a, W> {
    weight: &'a W,
    /// The greatest weight of any module on each of the spots; zero elsewhere.
    most: Vec<i64>,
    /// The spots in the order in which embeddings are read.
    list: Vec<usize>,
    best: Option<(i64, Vec<usize>)>,
}

impl<W: Fn(usize, usize) -> i64> Worth<'_, W> {
    fn of(&self, growth: &Growth<'_>) -> i64 {
        growth
            .pairs()
            .map(|(node, spot)| (self.weight)(node, spot))
            .sum()
    }
}

impl<W: Fn(usize, usize) -> i64> Goal for Worth<'_, W> {
    fn may_improve(&self, growth: &Growth<'_>) -> bool {
        let Some((best, _)) = &self.best else {
            return true;
        };
        let open = self
            .list
            .iter()
            .filter(|&&spot| !growth.taken.contains(spot));
        let hope: i64 = open.map(|&spot| self.most[spot]).sum();
        self.of(growth) + hope >= *best
    }

    fn meet(&mut self, growth: &Growth<'_>) -> bool {
        let mut on_spot = vec![0; self.most.len()];
        for (node, spot) in growth.pairs() {
            on_spot[spot] = node;
        }
        let modules: Vec<usize> = self.list.iter().map(|&spot| on_spot[spot]).collect();
        let weight = self.of(growth);
        let is_better = match &self.best {
            None => true,
            Some((best, least)) => (Reverse(weight), &modules) < (Reverse(*best), least),
        };
        if is_better {
            self.best = Some((weight, modules));
        }
        false
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Flow {
    /// Every embedding below was met or could not improve.
    Done,
    /// No more embeddings are needed.
    Enough,
    /// The budget has ended.
    Spent,
}

/// An unmatched module that can be matched next.
struct Opening {
    module: usize,
    spots: Vec<usize>,
}

/// An embedding while it grows.
struct Growth<'a> {
    search: &'a GraphSearch<'a>,
    marks: &'a [Mark],
    image: Vec<Option<usize>>,
    taken: FixedBitSet,
    /// The matched modules in the order in which they were matched.
    matched: Vec<usize>,
    /// The chosen spots that no module has taken.
    uncovered: usize,
    kept_links: usize,
    lost_links: usize,
    /// For each module, the spots that branches above forbid.
    forbidden: Vec<Vec<usize>>,
    nodes_left: u64,
}

impl<'a> Growth<'a> {
    fn new(search: &'a GraphSearch<'a>, marks: &'a [Mark], nodes_left: u64) -> Self {
        let module_count = search.configuration.node_count();
        Self {
            search,
            marks,
            image: vec![None; module_count],
            taken: FixedBitSet::with_capacity(marks.len()),
            matched: Vec::new(),
            uncovered: marks.iter().filter(|&&mark| mark == Mark::Chosen).count(),
            kept_links: 0,
            lost_links: 0,
            forbidden: vec![Vec::new(); module_count],
            nodes_left,
        }
    }

    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let matched = self.matched.iter();
        matched.filter_map(|&module| Some((module, self.image[module]?)))
    }

    /// The numbers of links from a module on a spot to matched ones that are kept and lost.
    fn links_on(&self, module: usize, spot: usize) -> (usize, usize) {
        let neighbours = self.search.configuration.neighbours(module).iter();
        let images = neighbours.filter_map(|&neighbour| self.image[neighbour]);
        let (mut kept, mut lost) = (0, 0);
        for image in images {
            if self.search.target.has_edge(image, spot) {
                kept += 1;
            } else {
                lost += 1;
            }
        }
        (kept, lost)
    }

    fn take(&mut self, module: usize, spot: usize) {
        let (kept, lost) = self.links_on(module, spot);
        self.kept_links += kept;
        self.lost_links += lost;
        self.uncovered -= usize::from(self.marks[spot] == Mark::Chosen);
        self.image[module] = Some(spot);
        self.taken.insert(spot);
        self.matched.push(module);
    }

    /// Takes back the last match.
    fn release(&mut self, module: usize) {
        let Some(spot) = self.image[module].take() else {
            return;
        };
        self.matched.pop();
        self.taken.remove(spot);
        self.uncovered += usize::from(self.marks[spot] == Mark::Chosen);
        let (kept, lost) = self.links_on(module, spot);
        self.kept_links -= kept;
        self.lost_links -= lost;
    }

    /// Runs through the embeddings that hold all matches so far.
    fn grow(&mut self, goal: &mut impl Goal) -> Flow {
        if self.matched.len() == self.search.size() {
            let is_embedding = self.uncovered == 0 && self.kept_links >= self.search.kept_links;
            let is_enough = is_embedding && goal.meet(self);
            return if is_enough { Flow::Enough } else { Flow::Done };
        }
        let mut forbidden_here: Vec<(usize, usize)> = Vec::new();
        let mut flow = Flow::Done;
        while let Some(opening) = self.opening() {
            if !goal.may_improve(self) {
                break;
            }
            flow = self.branch(&opening, goal);
            if flow != Flow::Done || self.search.is_whole() {
                break;
            }
            forbidden_here.push((opening.module, self.forbidden[opening.module].len()));
            self.forbidden[opening.module].extend(opening.spots);
        }
        for (module, before) in forbidden_here.into_iter().rev() {
            self.forbidden[module].truncate(before);
        }
        flow
    }

    fn branch(&mut self, opening: &Opening, goal: &mut impl Goal) -> Flow {
        for &spot in &opening.spots {
            if self.nodes_left == 0 {
                return Flow::Spent;
            }
            self.nodes_left -= 1;
            self.take(opening.module, spot);
            let flow = self.grow(goal);
            self.release(opening.module);
            if flow != Flow::Done {
                return flow;
            }
        }
        Flow::Done
    }

    /// The module to match next, the one with the fewest spots, then the lowest; `None` if no embedding holds the matches
    /// so far.
    fn opening(&self) -> Option<Opening> {
        let configuration = self.search.configuration;
        let is_next = |module: usize| {
            let mut neighbours = configuration.neighbours(module).iter();
            self.image[module].is_none()
                && neighbours.any(|&neighbour| self.image[neighbour].is_some())
        };
        let modules = (0..self.image.len()).filter(|&module| is_next(module));
        let openings: Vec<Opening> = modules
            .map(|module| Opening {
                module,
                spots: self.spots_for(module),
            })
            .filter(|opening| self.search.is_whole() || !opening.spots.is_empty())
            .collect();
        if !self.is_possible(&openings) {
            return None;
        }
        let fewest = openings.into_iter();
        fewest.min_by_key(|opening| (opening.spots.len(), opening.module))
    }

    /// The spots that a module can take next to those of matched neighbours, ascending.
    fn spots_for(&self, module: usize) -> Vec<usize> {
        let neighbours = self.search.configuration.neighbours(module).iter();
        let images = neighbours.filter_map(|&neighbour| self.image[neighbour]);
        let mut spots: Vec<usize> = images
            .flat_map(|image| self.search.target.neighbours(image))
            .copied()
            .filter(|&spot| {
                self.marks[spot] != Mark::Excluded
                    && !self.taken.contains(spot)
                    && !self.forbidden[module].contains(&spot)
                    && (!self.search.is_whole() || self.links_on(module, spot).1 == 0)
            })
            .collect();
        spots.sort_unstable();
        spots.dedup();
        spots
    }

    /// Whether enough modules, spots and links are left, and every chosen spot is within reach.
    fn is_possible(&self, openings: &[Opening]) -> bool {
        let missing = self.search.size() - self.matched.len();
        self.uncovered <= missing
            && self.has_links_and_modules(openings, missing)
            && self.has_spots(missing)
    }

    fn has_links_and_modules(&self, openings: &[Opening], missing: usize) -> bool {
        let configuration = self.search.configuration;
        let mut open: Vec<usize> = openings.iter().map(|opening| opening.module).collect();
        let mut is_reached = vec![false; self.image.len()];
        for &module in &open {
            is_reached[module] = true;
        }
        let mut count = open.len();
        while let Some(module) = open.pop() {
            for &neighbour in configuration.neighbours(module) {
                if self.image[neighbour].is_none() && !is_reached[neighbour] {
                    is_reached[neighbour] = true;
                    count += 1;
                    open.push(neighbour);
                }
            }
        }
        let may_hold = |module: usize| is_reached[module] || self.image[module].is_some();
        let links = configuration.edges().iter();
        let possible = links.filter(|&&(first, second)| may_hold(first) && may_hold(second));
        count >= missing && possible.count() - self.lost_links >= self.search.kept_links
    }

    fn has_spots(&self, missing: usize) -> bool {
        let target = self.search.target;
        let mut seen = self.taken.clone();
        let mut layer: Vec<usize> = self.taken.ones().collect();
        let (mut count, mut uncovered) = (0, self.uncovered);
        for _ in 0..missing {
            let mut next = Vec::new();
            for &spot in &layer {
                for &neighbour in target.neighbours(spot) {
                    if self.marks[neighbour] != Mark::Excluded && !seen.put(neighbour) {
                        count += 1;
                        uncovered -= usize::from(self.marks[neighbour] == Mark::Chosen);
                        next.push(neighbour);
                    }
                }
            }
            if count >= missing && uncovered == 0 {
                return true;
            }
            layer = next;
        }
        false
    }
}
