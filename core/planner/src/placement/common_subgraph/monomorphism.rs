//! The whole configuration in the target, with all its links.

use std::cmp::Reverse;

use super::Budget;
use super::domains::Domains;
use crate::placement::matching::{MatchingInput, Pairs, Weight};

/// The non-induced monomorphism of greatest utility, in ascending order of modules; `None` if there is none, or none was
/// found within the budget.
///
/// Backtracking over the modules in a fixed connected order, each on a spot adjacent to that of an earlier module, after
/// the domains are filtered ([`Domains`]). A branch ends when even the best spots for all later modules would not exceed
/// the best utility found.
pub(super) fn search<W: Weight>(
    input: &MatchingInput<'_, W>,
    budget: &mut Budget,
) -> Option<Pairs> {
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
        best_to_come: best_to_come(input, &domains, &order),
        order: &order,
        image: vec![None; configuration.node_count()],
        is_taken: vec![false; target.node_count()],
        utility: 0,
    };
    let mut best: Option<(i64, Pairs)> = None;
    // For each module of the order, the untried spots, the best last.
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
            // The other spots at this depth have no greater weight.
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

/// All modules, each but the first linked to an earlier one. The next module is the one with the most earlier neighbours,
/// then of greatest degree, then the lowest.
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

/// For each place of the order, a bound on the utility of the modules from there on.
fn best_to_come<W: Weight>(
    input: &MatchingInput<'_, W>,
    domains: &Domains,
    order: &[usize],
) -> Vec<i64> {
    let mut sums = vec![0; order.len() + 1];
    for (place, &node) in order.iter().enumerate().rev() {
        let weights = domains
            .spots(node)
            .filter_map(|spot| (input.weight)(node, spot));
        let best = weights.max().unwrap_or_default();
        sums[place] = sums[place + 1] + best.0;
    }
    sums
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

impl<W: Weight> Search<'_, W> {
    /// The spots that the module at a place of the order can take now with their weights, the best last, the lower of equals
    /// later.
    fn candidates(&self, place: usize) -> Vec<(i64, Reverse<usize>)> {
        let node = self.order[place];
        let around: Vec<usize> = self
            .input
            .configuration
            .neighbours(node)
            .iter()
            .filter_map(|&neighbour| self.image[neighbour])
            .collect();
        let target = self.input.target;
        let rate = |spot: usize| {
            let fits = self.domains.has(node, spot)
                && !self.is_taken[spot]
                && around.iter().all(|&image| target.has_edge(image, spot));
            fits.then(|| (self.weight(node, spot), Reverse(spot)))
        };
        let mut candidates: Vec<(i64, Reverse<usize>)> = match around.first() {
            Some(&image) => target
                .neighbours(image)
                .iter()
                .copied()
                .filter_map(rate)
                .collect(),
            None => self.domains.spots(node).filter_map(rate).collect(),
        };
        candidates.sort_unstable();
        candidates
    }

    fn weight(&self, node: usize, spot: usize) -> i64 {
        (self.input.weight)(node, spot).map_or(0, |weight| weight.0)
    }

    fn take(&mut self, place: usize, spot: usize, weight: i64) {
        self.image[self.order[place]] = Some(spot);
        self.is_taken[spot] = true;
        self.utility += weight;
    }

    /// Removes the module at a place of the order from its spot, if it has one.
    fn release(&mut self, place: usize) {
        let node = self.order[place];
        if let Some(spot) = self.image[node].take() {
            self.is_taken[spot] = false;
            self.utility -= self.weight(node, spot);
        }
    }

    fn pairs(&self) -> Pairs {
        let image = self.image.iter().enumerate();
        image
            .filter_map(|(node, spot)| Some((node, (*spot)?)))
            .collect()
    }
}
