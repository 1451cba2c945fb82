//! The maximum common connected subgraph, edge-preserving: the most modules, then the most kept links, then utility.

use std::cmp::Reverse;

use super::Budget;
use super::links_bound::LinksBound;
use crate::placement::matching::{MatchingInput, Pairs, Weight};

/// Finds the best matching that its kept links connect, in the order of the search. `incumbent` is a matching to improve
/// on.
///
/// Branch and bound with connected branching, after McSplit (C. McCreesh, P. Prosser, J. Trimble, "A partitioning
/// algorithm for maximum common subgraph problems", IJCAI 2017). The matching grows by a module linked to a matched one, on
/// a spot adjacent to that one's spot. There is a branch for each such spot of one module, and a last branch that forbids
/// all these pairs; another neighbour can still reach the module there. The bound is the lesser of the modules and the spots
/// that growth can still reach, of the links and the edges among them, and of what the cycles of both graphs admit. McSplit's label classes do not help, because
/// modules without a link can take adjacent spots.
pub(super) fn search<W: Weight>(
    input: &MatchingInput<'_, W>,
    bound: &LinksBound,
    incumbent: Pairs,
    budget: &mut Budget,
) -> Pairs {
    let mut search = Search::new(input, bound);
    search.start_from(incumbent);
    let mut stack: Vec<Frame> = Vec::new();
    if budget.take() {
        stack.extend(search.branch());
    }
    while let Some(frame) = stack.last_mut() {
        search.release(frame.module);
        let next = frame.untried.pop();
        // The other spots of a first module have no greater weight.
        if next.is_some_and(|spot| !search.may_begin_at(frame.module, spot)) {
            frame.untried.clear();
            continue;
        }
        if let Some(spot) = next {
            if !budget.take() {
                break;
            }
            search.take(frame.module, spot);
        } else if !frame.is_forbidden {
            if !budget.take() {
                break;
            }
            frame.is_forbidden = true;
            search.forbid(frame.module, &frame.spots);
        } else {
            let Some(frame) = stack.pop() else { break };
            search.allow(frame.module, &frame.spots);
            continue;
        }
        stack.extend(search.branch());
    }
    search.best
}

/// One module on which the search branches.
struct Frame {
    module: usize,
    /// All spots that it can take here.
    spots: Vec<usize>,
    /// The spots that have not been tried, the most promising last.
    untried: Vec<usize>,
    /// Whether the branch that forbids all of them was entered.
    is_forbidden: bool,
}

/// An unmatched module that can be matched next.
struct Opening {
    module: usize,
    matched_neighbours: usize,
    /// The free spots that it can take, each adjacent to the spot of a matched neighbour.
    spots: Vec<usize>,
}

/// The quality of a matching, compared in the order of the fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Score {
    modules: usize,
    links: usize,
    utility: i64,
}

struct Search<'a, W> {
    input: &'a MatchingInput<'a, W>,
    bound: &'a LinksBound,
    /// The greatest weight of each module on any spot; `None` if all are forbidden.
    best_weight: Vec<Option<i64>>,
    image: Vec<Option<usize>>,
    is_taken: Vec<bool>,
    /// For each module, the spots that branches above this node forbid; a spot is listed once for each such branch.
    forbidden: Vec<Vec<usize>>,
    /// The matched modules in the order in which they were matched.
    matched: Vec<usize>,
    score: Score,
    best_score: Score,
    best: Pairs,
}

impl<'a, W: Weight> Search<'a, W> {
    fn new(input: &'a MatchingInput<'a, W>, bound: &'a LinksBound) -> Self {
        let (module_count, spot_count) =
            (input.configuration.node_count(), input.target.node_count());
        let best_weight = (0..module_count)
            .map(|module| {
                (0..spot_count)
                    .filter_map(|spot| Some((input.weight)(module, spot)?.0))
                    .max()
            })
            .collect();
        Self {
            input,
            bound,
            best_weight,
            image: vec![None; module_count],
            is_taken: vec![false; spot_count],
            forbidden: vec![Vec::new(); module_count],
            matched: Vec::new(),
            score: Score::default(),
            best_score: Score::default(),
            best: Vec::new(),
        }
    }

    fn start_from(&mut self, incumbent: Pairs) {
        self.best_score = Score {
            modules: incumbent.len(),
            links: self.input.kept_links(&incumbent),
            utility: self.input.utility(&incumbent).0,
        };
        self.best = incumbent;
    }

    fn weight(&self, module: usize, spot: usize) -> i64 {
        (self.input.weight)(module, spot).map_or(0, |weight| weight.0)
    }

    fn kept_links(&self, module: usize, spot: usize) -> usize {
        self.input
            .configuration
            .neighbours(module)
            .iter()
            .filter_map(|&neighbour| self.image[neighbour])
            .filter(|&image| self.input.target.has_edge(image, spot))
            .count()
    }

    fn take(&mut self, module: usize, spot: usize) {
        self.score.modules += 1;
        self.score.links += self.kept_links(module, spot);
        self.score.utility += self.weight(module, spot);
        self.image[module] = Some(spot);
        self.is_taken[spot] = true;
        self.matched.push(module);
        if self.score > self.best_score || self.best.is_empty() {
            self.best_score = self.score;
            self.best = self
                .matched
                .iter()
                .filter_map(|&module| Some((module, self.image[module]?)))
                .collect();
        }
    }

    /// Removes a module from its spot, if it has one; it must be the last matched.
    fn release(&mut self, module: usize) {
        if let Some(spot) = self.image[module].take() {
            self.matched.pop();
            self.is_taken[spot] = false;
            self.score.modules -= 1;
            self.score.links -= self.kept_links(module, spot);
            self.score.utility -= self.weight(module, spot);
        }
    }

    fn forbid(&mut self, module: usize, spots: &[usize]) {
        self.forbidden[module].extend_from_slice(spots);
    }

    fn allow(&mut self, module: usize, spots: &[usize]) {
        let kept = self.forbidden[module].len() - spots.len();
        self.forbidden[module].truncate(kept);
    }

    /// The next module to branch on; `None` if no matching below this node is better.
    fn branch(&self) -> Option<Frame> {
        if self.matched.is_empty() {
            let (module, spots) = self.first_module()?;
            return Some(self.frame(module, spots));
        }
        let openings = self.openings();
        if !self.may_improve(&openings) {
            return None;
        }
        // The module with the fewest spots, then the most matched neighbours, then the most neighbours, then the lowest.
        let opening = openings.into_iter().min_by_key(|opening| {
            (
                opening.spots.len(),
                Reverse(opening.matched_neighbours),
                Reverse(self.input.configuration.degree(opening.module)),
                opening.module,
            )
        })?;
        Some(self.frame(opening.module, opening.spots))
    }

    fn frame(&self, module: usize, spots: Vec<usize>) -> Frame {
        let mut untried = spots.clone();
        untried.sort_by_cached_key(|&spot| {
            (
                self.kept_links(module, spot),
                self.weight(module, spot),
                Reverse(spot),
            )
        });
        Frame {
            module,
            spots,
            untried,
            is_forbidden: false,
        }
    }

    /// The module of greatest degree (the lowest of equals) that is not given up, and every spot that it can take; `None` if
    /// no matching of the modules that are not given up is better.
    fn first_module(&self) -> Option<(usize, Vec<usize>)> {
        let configuration = self.input.configuration;
        let (module_count, spot_count) =
            (configuration.node_count(), self.input.target.node_count());
        let components = configuration.components_within(|module| self.may_begin(module));
        let hopeful: Vec<Vec<usize>> = components
            .into_iter()
            .filter(|component| {
                let mut reached = vec![false; module_count];
                for &module in component {
                    reached[module] = true;
                }
                let count = component.len().min(spot_count);
                self.may_improve_by(&reached, count, self.input.target.edges().len())
            })
            .collect();
        let module = hopeful
            .into_iter()
            .flatten()
            .max_by_key(|&module| (configuration.degree(module), Reverse(module)))?;
        let spots = (0..spot_count)
            .filter(|&spot| (self.input.weight)(module, spot).is_some())
            .collect();
        Some((module, spots))
    }

    /// Whether a module can be the first of a matching: forbidding it as the first gives it up altogether.
    fn may_begin(&self, module: usize) -> bool {
        self.best_weight[module].is_some() && self.forbidden[module].is_empty()
    }

    /// Whether the bound admits a better matching with this first module on a spot; true unless nothing is matched.
    fn may_begin_at(&self, module: usize, spot: usize) -> bool {
        if !self.matched.is_empty() {
            return true;
        }
        let configuration = self.input.configuration;
        let mut reached = vec![false; configuration.node_count()];
        reached[module] = true;
        let mut waiting = vec![module];
        let mut others = Vec::new();
        while let Some(module) = waiting.pop() {
            for &neighbour in configuration.neighbours(module) {
                if !reached[neighbour] && self.may_begin(neighbour) {
                    reached[neighbour] = true;
                    waiting.push(neighbour);
                    others.extend(self.best_weight[neighbour]);
                }
            }
        }
        let modules = (1 + others.len()).min(self.input.target.node_count());
        let edges = configuration.edges().iter();
        let within = edges.filter(|&&(first, second)| reached[first] && reached[second]);
        let links = within.count().min(self.bound.for_modules(modules));
        others.sort_unstable_by_key(|&weight| Reverse(weight));
        let others = others.iter().take(modules - 1);
        let hope = Score {
            modules,
            links,
            utility: self.weight(module, spot) + others.sum::<i64>(),
        };
        hope > self.best_score || self.best.is_empty()
    }

    /// The unmatched modules that can take a spot adjacent to that of a matched neighbour.
    fn openings(&self) -> Vec<Opening> {
        let mut adjacent: Vec<usize> = self
            .matched
            .iter()
            .flat_map(|&module| self.input.configuration.neighbours(module))
            .copied()
            .filter(|&module| self.image[module].is_none() && self.best_weight[module].is_some())
            .collect();
        adjacent.sort_unstable();
        adjacent
            .chunk_by(|one, other| one == other)
            .map(|same| Opening {
                module: same[0],
                matched_neighbours: same.len(),
                spots: self.spots_next_to(same[0]),
            })
            .filter(|opening| !opening.spots.is_empty())
            .collect()
    }

    /// The free spots that a module can take adjacent to the images of its neighbours, ascending.
    fn spots_next_to(&self, module: usize) -> Vec<usize> {
        let mut spots: Vec<usize> = self
            .input
            .configuration
            .neighbours(module)
            .iter()
            .filter_map(|&neighbour| self.image[neighbour])
            .flat_map(|image| self.input.target.neighbours(image))
            .copied()
            .filter(|&spot| {
                !self.is_taken[spot]
                    && !self.forbidden[module].contains(&spot)
                    && (self.input.weight)(module, spot).is_some()
            })
            .collect();
        spots.sort_unstable();
        spots.dedup();
        spots
    }

    /// Whether the bound admits a better matching below this node.
    fn may_improve(&self, openings: &[Opening]) -> bool {
        let reached = self.modules_within_reach(openings);
        let module_count = reached.iter().filter(|&&is_reached| is_reached).count();
        let (spot_count, edge_count) = self.spots_within_reach(module_count);
        self.may_improve_by(&reached, module_count.min(spot_count), edge_count)
    }

    /// Whether matching `count` of the modules within reach, with `edge_count` edges for their links, can give a better
    /// score. Computes each part of the score only if the parts before it tie.
    fn may_improve_by(&self, reached: &[bool], count: usize, edge_count: usize) -> bool {
        let best = &self.best_score;
        let modules = self.score.modules + count;
        if modules != best.modules || self.best.is_empty() {
            return modules > best.modules || self.best.is_empty();
        }
        let within = self.input.configuration.edges().iter();
        let link_count = within
            .filter(|&&(first, second)| {
                (reached[first] && (reached[second] || self.image[second].is_some()))
                    || (reached[second] && self.image[first].is_some())
            })
            .count();
        let links = self.score.links + link_count.min(edge_count);
        let links = links.min(self.bound.for_modules(modules));
        if links != best.links {
            return links > best.links;
        }
        let mut weights: Vec<i64> = (0..reached.len())
            .filter(|&module| reached[module])
            .filter_map(|module| self.best_weight[module])
            .collect();
        weights.sort_unstable_by_key(|&weight| Reverse(weight));
        let utility = self.score.utility + weights.iter().take(count).sum::<i64>();
        utility > best.utility
    }

    /// For each unmatched module, whether growth can still reach it.
    fn modules_within_reach(&self, openings: &[Opening]) -> Vec<bool> {
        let mut reached = vec![false; self.image.len()];
        let mut modules: Vec<usize> = openings.iter().map(|opening| opening.module).collect();
        for &module in &modules {
            reached[module] = true;
        }
        while let Some(module) = modules.pop() {
            for &neighbour in self.input.configuration.neighbours(module) {
                if !reached[neighbour]
                    && self.image[neighbour].is_none()
                    && self.best_weight[neighbour].is_some()
                {
                    reached[neighbour] = true;
                    modules.push(neighbour);
                }
            }
        }
        reached
    }

    /// The number of free spots that growth can still reach, and a bound on the number of target edges that end there; both
    /// `usize::MAX` once there are `enough` spots.
    fn spots_within_reach(&self, enough: usize) -> (usize, usize) {
        let target = self.input.target;
        let mut seen = self.is_taken.clone();
        let mut waiting: Vec<usize> = self
            .matched
            .iter()
            .filter_map(|&module| self.image[module])
            .collect();
        let (mut count, mut edge_ends) = (0, 0);
        while let Some(spot) = waiting.pop() {
            for &neighbour in target.neighbours(spot) {
                if !seen[neighbour] {
                    seen[neighbour] = true;
                    waiting.push(neighbour);
                    count += 1;
                    edge_ends += target.degree(neighbour);
                    if count >= enough {
                        return (usize::MAX, usize::MAX);
                    }
                }
            }
        }
        (count, edge_ends)
    }
}
