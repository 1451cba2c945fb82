//! The whole configuration laid into the target with all its links.

use std::cmp::Reverse;

use super::Budget;
use crate::fixed::MicroUnits;
use crate::matching::MatchingInput;

/// The greatest number of pairs for which domains are filtered to the end; above it, only once.
const FILTERED_PAIRS_MAX: usize = 1_000_000;

/// The non-induced monomorphism of greatest utility, as pairs in the order of the search; none if there is none, or none
/// was found within the budget.
///
/// Backtracking over the modules in a fixed connected order, each on a spot beside that of a module before it. Before,
/// the domains are filtered: a spot stays possible for a module only as long as the module's neighbours can take
/// different neighbours of the spot that are possible for them (the local all-different filter of Solnon's LAD,
/// Artificial Intelligence 174, 2010). A branch ends when even the best spot for each module to come cannot
/// beat the best found.
pub(super) fn search<W: Fn(usize, usize) -> Option<MicroUnits>>(
    input: &MatchingInput<'_, W>,
    budget: &mut Budget,
) -> Option<Vec<(usize, usize)>> {
    let (configuration, target) = (input.configuration, input.target);
    if configuration.node_count() > target.node_count()
        || configuration.edges().len() > target.edges().len()
    {
        return None;
    }
    if configuration.node_count() == 0 {
        return Some(Vec::new());
    }
    let domains = Domains::filtered(input)?;
    let order = connected_order(input);
    let mut search = Search {
        input,
        domains: &domains,
        best_to_come: best_to_come(&domains, &order),
        order: &order,
        image: vec![None; configuration.node_count()],
        is_taken: vec![false; target.node_count()],
        utility: 0,
    };
    let mut best: Option<(i64, Vec<(usize, usize)>)> = None;
    // For each module of the order: the spots still to be tried, the best last.
    let mut stack: Vec<Vec<(i64, Reverse<usize>)>> = Vec::new();
    if budget.take() {
        stack.push(search.candidates(0));
    }
    while let Some(candidates) = stack.last_mut() {
        let next = candidates.pop();
        let depth = stack.len() - 1;
        search.release(depth);
        let Some((weight, Reverse(spot))) = next else {
            stack.pop();
            continue;
        };
        let hope = search.utility + weight + search.best_to_come[depth + 1];
        if best.as_ref().is_some_and(|(utility, _)| hope <= *utility) {
            // The others at this depth are worth no more.
            stack.pop();
            continue;
        }
        if !budget.take() {
            break;
        }
        search.take(depth, spot, weight);
        if depth + 1 == order.len() {
            best = Some((search.utility, search.pairs()));
        } else {
            let candidates = search.candidates(depth + 1);
            stack.push(candidates);
        }
    }
    best.map(|(_, pairs)| pairs)
}

/// All modules, each but the first beside one before it: the one with the most neighbours among those before, then the
/// one of greatest degree, then the lowest.
fn connected_order<W>(input: &MatchingInput<'_, W>) -> Vec<usize> {
    let configuration = input.configuration;
    let count = configuration.node_count();
    let mut before = vec![0_usize; count];
    let mut is_listed = vec![false; count];
    let mut waiting = std::collections::BinaryHeap::new();
    for node in 0..count {
        waiting.push((0, configuration.degree(node), Reverse(node)));
    }
    let mut order = Vec::with_capacity(count);
    while let Some((_, _, Reverse(node))) = waiting.pop() {
        if is_listed[node] {
            continue;
        }
        is_listed[node] = true;
        order.push(node);
        for &neighbour in configuration.neighbours(node) {
            before[neighbour] += 1;
            waiting.push((
                before[neighbour],
                configuration.degree(neighbour),
                Reverse(neighbour),
            ));
        }
    }
    order
}

/// At each place of the order, the most that the modules from there on can be worth.
fn best_to_come(domains: &Domains, order: &[usize]) -> Vec<i64> {
    let mut sums = vec![0; order.len() + 1];
    for (place, &node) in order.iter().enumerate().rev() {
        let best = domains.of[node].iter().map(|&(_, weight)| weight).max();
        sums[place] = sums[place + 1] + best.unwrap_or_default();
    }
    sums
}

/// For each module the spots that it may take with what they are worth, ascending by spot.
struct Domains {
    of: Vec<Vec<(usize, i64)>>,
}

impl Domains {
    /// None if some module has no spot left.
    fn filtered<W: Fn(usize, usize) -> Option<MicroUnits>>(
        input: &MatchingInput<'_, W>,
    ) -> Option<Self> {
        let (configuration, target) = (input.configuration, input.target);
        let of = (0..configuration.node_count())
            .map(|node| {
                (0..target.node_count())
                    .filter(|&spot| target.degree(spot) >= configuration.degree(node))
                    .filter_map(|spot| Some((spot, (input.weight)(node, spot)?.0)))
                    .collect()
            })
            .collect();
        let mut domains = Self { of };
        let pairs: usize = domains.of.iter().map(Vec::len).sum();
        let mut waiting: Vec<usize> = (0..configuration.node_count()).rev().collect();
        let mut is_waiting = vec![true; configuration.node_count()];
        while let Some(node) = waiting.pop() {
            is_waiting[node] = false;
            let before = domains.of[node].len();
            let mut domain = std::mem::take(&mut domains.of[node]);
            domain.retain(|&(spot, _)| domains.neighbours_fit(input, node, spot));
            let is_smaller = domain.len() < before;
            domains.of[node] = domain;
            if domains.of[node].is_empty() {
                return None;
            }
            if !is_smaller || pairs > FILTERED_PAIRS_MAX {
                continue;
            }
            for &neighbour in configuration.neighbours(node) {
                if !is_waiting[neighbour] {
                    is_waiting[neighbour] = true;
                    waiting.push(neighbour);
                }
            }
        }
        Some(domains)
    }

    fn weight(&self, node: usize, spot: usize) -> Option<i64> {
        let domain = &self.of[node];
        let position = domain.binary_search_by_key(&spot, |&(spot, _)| spot).ok()?;
        Some(domain[position].1)
    }

    /// Whether the neighbours of a module can take different neighbours of a spot: augmenting paths.
    fn neighbours_fit<W>(&self, input: &MatchingInput<'_, W>, node: usize, spot: usize) -> bool {
        let modules = input.configuration.neighbours(node);
        let spots = input.target.neighbours(spot);
        // Which of the modules takes each spot.
        let mut taken_by: Vec<Option<usize>> = vec![None; spots.len()];
        (0..modules.len()).all(|start| {
            // Breadth-first: the module from which each spot was reached.
            let mut reached_from: Vec<Option<usize>> = vec![None; spots.len()];
            let mut queue = vec![start];
            let mut next = 0;
            while let Some(&module) = queue.get(next) {
                next += 1;
                for (index, &neighbour) in spots.iter().enumerate() {
                    if reached_from[index].is_some()
                        || self.weight(modules[module], neighbour).is_none()
                    {
                        continue;
                    }
                    reached_from[index] = Some(module);
                    let Some(holder) = taken_by[index] else {
                        let mut free = Some(index);
                        while let (Some(index), Some(module)) =
                            (free, free.and_then(|index| reached_from[index]))
                        {
                            free = taken_by.iter().position(|&holder| holder == Some(module));
                            taken_by[index] = Some(module);
                        }
                        return true;
                    };
                    queue.push(holder);
                }
            }
            false
        })
    }
}

struct Search<'a, W> {
    input: &'a MatchingInput<'a, W>,
    domains: &'a Domains,
    order: &'a [usize],
    best_to_come: Vec<i64>,
    image: Vec<Option<usize>>,
    is_taken: Vec<bool>,
    utility: i64,
}

impl<W> Search<'_, W> {
    /// The spots that the module at a place of the order can take now, the best last, the lower of equals later.
    fn candidates(&self, place: usize) -> Vec<(i64, Reverse<usize>)> {
        let node = self.order[place];
        let around: Vec<usize> = self
            .input
            .configuration
            .neighbours(node)
            .iter()
            .filter_map(|&neighbour| self.image[neighbour])
            .collect();
        let fits = |spot: usize| {
            !self.is_taken[spot]
                && around
                    .iter()
                    .all(|&image| self.input.target.has_edge(image, spot))
        };
        let mut candidates: Vec<(i64, Reverse<usize>)> = match around.first() {
            Some(&image) => self
                .input
                .target
                .neighbours(image)
                .iter()
                .filter_map(|&spot| Some((self.domains.weight(node, spot)?, Reverse(spot))))
                .filter(|&(_, Reverse(spot))| fits(spot))
                .collect(),
            None => self.domains.of[node]
                .iter()
                .map(|&(spot, weight)| (weight, Reverse(spot)))
                .filter(|&(_, Reverse(spot))| fits(spot))
                .collect(),
        };
        candidates.sort_unstable();
        candidates
    }

    fn take(&mut self, place: usize, spot: usize, weight: i64) {
        self.image[self.order[place]] = Some(spot);
        self.is_taken[spot] = true;
        self.utility += weight;
    }

    /// Takes the module at a place of the order off its spot, if it has one.
    fn release(&mut self, place: usize) {
        let node = self.order[place];
        if let Some(spot) = self.image[node].take() {
            self.is_taken[spot] = false;
            self.utility -= self.domains.weight(node, spot).unwrap_or_default();
        }
    }

    fn pairs(&self) -> Vec<(usize, usize)> {
        let image = self.image.iter().enumerate();
        image
            .filter_map(|(node, spot)| Some((node, (*spot)?)))
            .collect()
    }
}
