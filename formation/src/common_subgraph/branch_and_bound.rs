//! The maximum common connected subgraph, edge-preserving: most modules, then most kept links, then utility.

use std::cmp::Reverse;

use super::Budget;
use crate::fixed::MicroUnits;
use crate::matching::MatchingInput;

/// Finds the best matching whose kept links connect it, as pairs in the order of the search.
///
/// Branch and bound with connected branching, after McSplit (C. McCreesh, P. Prosser, J. Trimble, "A partitioning
/// algorithm for maximum common subgraph problems", IJCAI 2017): the matching grows by a module beside a matched one onto
/// a spot beside that one's. Each branch is one such spot for one module; the last is none of them, which forbids
/// these pairs from there on, though the module may still be reached by another neighbour. The bound counts the modules and
/// the spots that growth can still reach, and the links and edges among them; the lesser ones count. McSplit's label
/// classes are of no use, as non-linked modules may stand on adjacent spots.
pub(super) fn search<W: Fn(usize, usize) -> Option<MicroUnits>>(
    input: &MatchingInput<'_, W>,
    budget: &mut Budget,
) -> Vec<(usize, usize)> {
    let mut search = Search::new(input);
    let mut stack: Vec<Frame> = Vec::new();
    if budget.take() {
        stack.extend(search.branch());
    }
    while let Some(frame) = stack.last_mut() {
        search.release(frame.module);
        if let Some(spot) = frame.untried.pop() {
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

/// One module to be matched, or not.
struct Frame {
    module: usize,
    /// All spots that it could take here.
    spots: Vec<usize>,
    /// Those that have not been tried, the most promising last.
    untried: Vec<usize>,
    /// Whether the branch without any of them was entered.
    is_forbidden: bool,
}

/// What a matching is judged by, in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Score {
    modules: usize,
    links: usize,
    utility: i64,
}

struct Search<'a, W> {
    input: &'a MatchingInput<'a, W>,
    /// The most that each module can be worth on any spot; none if it may take none.
    best_weight: Vec<Option<i64>>,
    image: Vec<Option<usize>>,
    is_taken: Vec<bool>,
    /// How often each pair was forbidden, by module; pairs that were not are left out.
    forbidden: Vec<Vec<usize>>,
    /// The matched modules in the order of their matching.
    matched: Vec<usize>,
    score: Score,
    best_score: Score,
    best: Vec<(usize, usize)>,
}

impl<'a, W: Fn(usize, usize) -> Option<MicroUnits>> Search<'a, W> {
    fn new(input: &'a MatchingInput<'a, W>) -> Self {
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

    /// Takes a module off its spot, if it has one; it must be the last matched.
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

    /// The next module to branch on; none if nothing better can come of this node.
    fn branch(&self) -> Option<Frame> {
        if self.bound() <= self.best_score && !self.best.is_empty() {
            return None;
        }
        let (module, spots) = if self.matched.is_empty() {
            self.first_module()?
        } else {
            self.next_module()?
        };
        let mut untried = spots.clone();
        untried.sort_by_cached_key(|&spot| {
            (
                self.kept_links(module, spot),
                self.weight(module, spot),
                Reverse(spot),
            )
        });
        Some(Frame {
            module,
            spots,
            untried,
            is_forbidden: false,
        })
    }

    /// The module of greatest degree among those that have not been given up, and every spot that it may take.
    fn first_module(&self) -> Option<(usize, Vec<usize>)> {
        let configuration = self.input.configuration;
        let module = (0..configuration.node_count())
            .filter(|&module| self.may_begin(module))
            .max_by_key(|&module| (configuration.degree(module), Reverse(module)))?;
        let spots = (0..self.input.target.node_count())
            .filter(|&spot| (self.input.weight)(module, spot).is_some())
            .collect();
        Some((module, spots))
    }

    /// Before the first module is matched, forbidding means that a module is given up altogether.
    fn may_begin(&self, module: usize) -> bool {
        self.best_weight[module].is_some() && self.forbidden[module].is_empty()
    }

    /// The module with the fewest spots to take beside a matched one; of equals the one that has more matched
    /// neighbours, then more neighbours, then the lower one.
    fn next_module(&self) -> Option<(usize, Vec<usize>)> {
        let configuration = self.input.configuration;
        let mut best = None;
        for &module in &self.frontier() {
            let spots = self.spots_beside(module);
            if spots.is_empty() {
                continue;
            }
            let neighbours = configuration.neighbours(module);
            let matched = neighbours
                .iter()
                .filter(|&&neighbour| self.image[neighbour].is_some())
                .count();
            let key = (
                spots.len(),
                Reverse(matched),
                Reverse(neighbours.len()),
                module,
            );
            if best.as_ref().is_none_or(|(best_key, _)| key < *best_key) {
                best = Some((key, spots));
            }
        }
        best.map(|((.., module), spots)| (module, spots))
    }

    /// The unmatched modules beside matched ones, ascending.
    fn frontier(&self) -> Vec<usize> {
        let mut frontier: Vec<usize> = self
            .matched
            .iter()
            .flat_map(|&module| self.input.configuration.neighbours(module))
            .copied()
            .filter(|&module| self.image[module].is_none() && self.best_weight[module].is_some())
            .collect();
        frontier.sort_unstable();
        frontier.dedup();
        frontier
    }

    /// The free spots beside the images of a module's neighbours that it may take, ascending.
    fn spots_beside(&self, module: usize) -> Vec<usize> {
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

    /// No matching that comes of this node has a greater score.
    fn bound(&self) -> Score {
        let configuration = self.input.configuration;
        let mut reached = vec![false; configuration.node_count()];
        let (modules, spot_count, edge_count) = if self.matched.is_empty() {
            let components = configuration.components_within(|module| self.may_begin(module));
            let Some(largest) = components.into_iter().max_by_key(Vec::len) else {
                return Score::default();
            };
            (largest, usize::MAX, usize::MAX)
        } else {
            let modules = self.modules_within_reach();
            let (spot_count, edge_count) = self.spots_within_reach(modules.len());
            (modules, spot_count, edge_count)
        };
        // Without a matched module, other components may hold more links or utility than the largest.
        if self.matched.is_empty() {
            for (module, is_reached) in reached.iter_mut().enumerate() {
                *is_reached = self.may_begin(module);
            }
        } else {
            for &module in &modules {
                reached[module] = true;
            }
        }
        let count = modules.len().min(spot_count);
        let links = configuration
            .edges()
            .iter()
            .filter(|&&(first, second)| {
                (reached[first] && (reached[second] || self.image[second].is_some()))
                    || (reached[second] && self.image[first].is_some())
            })
            .count();
        let mut weights: Vec<i64> = (0..reached.len())
            .filter(|&module| reached[module])
            .filter_map(|module| self.best_weight[module])
            .collect();
        weights.sort_unstable_by_key(|&weight| Reverse(weight));
        Score {
            modules: self.score.modules + count,
            links: self.score.links + links.min(edge_count),
            utility: self.score.utility + weights.iter().take(count).sum::<i64>(),
        }
    }

    /// The unmatched modules that growth can still reach.
    fn modules_within_reach(&self) -> Vec<usize> {
        let mut seen = vec![false; self.image.len()];
        let mut modules: Vec<usize> = self
            .frontier()
            .into_iter()
            .filter(|&module| !self.spots_beside(module).is_empty())
            .collect();
        for &module in &modules {
            seen[module] = true;
        }
        let mut next = 0;
        while let Some(&module) = modules.get(next) {
            for &neighbour in self.input.configuration.neighbours(module) {
                if !seen[neighbour]
                    && self.image[neighbour].is_none()
                    && self.best_weight[neighbour].is_some()
                {
                    seen[neighbour] = true;
                    modules.push(neighbour);
                }
            }
            next += 1;
        }
        modules
    }

    /// How many free spots growth can still reach, and how many edges of the target they add; does not
    /// look further once there are more than `enough` spots.
    fn spots_within_reach(&self, enough: usize) -> (usize, usize) {
        let target = self.input.target;
        let mut seen = self.is_taken.clone();
        let mut spots: Vec<usize> = self
            .matched
            .iter()
            .filter_map(|&module| self.image[module])
            .collect();
        let taken = spots.len();
        let mut next = 0;
        while let Some(&spot) = spots.get(next) {
            for &neighbour in target.neighbours(spot) {
                if !seen[neighbour] {
                    seen[neighbour] = true;
                    spots.push(neighbour);
                }
            }
            next += 1;
            if spots.len() - taken > enough {
                return (usize::MAX, usize::MAX);
            }
        }
        let ends: usize = spots[taken..].iter().map(|&spot| target.degree(spot)).sum();
        (spots.len() - taken, ends)
    }
}
