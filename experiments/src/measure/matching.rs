//! The time to find where one configuration fits into one target.

use formation_model::PlanningProblem;
use formation_planner::assignment::Instance;
use formation_planner::baseline::CandidateInput;
use formation_planner::placement::{MatchingInput, common_subtree};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::{least_us, rounded};

/// What the search for one configuration's place finds, ours and the paper's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatchingCounts {
    /// The number of modules that ours matches.
    pub ours_size: usize,
    /// The number of modules that each of the paper's matches.
    pub paper_size: usize,
    /// The number of common subtrees that the paper's search found.
    pub candidates: usize,
    /// The utility of ours.
    pub ours_utility: f64,
    /// The utility of the best that the paper's search found.
    pub paper_utility: f64,
}

/// The times of the search in microseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatchingTimes {
    /// Ours: the one common subtree of greatest size and, among those, of greatest utility.
    pub ours_us: f64,
    /// The paper's: the first MAX = 20 common subtrees of greatest size.
    pub paper_us: f64,
}

/// Searches for the place of the only configuration of a problem in its target.
pub(crate) fn measure(
    problem: &Arc<PlanningProblem>,
    timings: u32,
) -> (MatchingCounts, MatchingTimes) {
    let instance = Instance::new(Arc::clone(problem), Arc::clone(problem.target()));
    let configuration = &instance.links;
    let target = instance.target.topology();
    let utilities = &instance.utilities;
    let input = MatchingInput {
        configuration,
        target,
        weight: |node, spot| Some(utilities.of(node, spot)),
    };
    let options = &problem.parameters().paper;
    let search = CandidateInput {
        configuration,
        target,
        value: |spot| utilities.value(spot),
        utility: |node, spot| utilities.of(node, spot),
        embedding: options.embedding,
        // Both are trees, on which nothing is searched.
        nodes_max: 0,
    };
    let candidates_of = || search.candidates(options.max()).embeddings;
    let ours_us = least_us(timings, || {
        std::hint::black_box(common_subtree::solve(&input));
    });
    let paper_us = least_us(timings, || {
        std::hint::black_box(candidates_of());
    });
    let ours = common_subtree::solve(&input);
    let candidates = candidates_of();
    let utility = |pairs: &[(usize, usize)]| {
        let each = pairs
            .iter()
            .map(|&(node, spot)| utilities.of(node, spot).to_units());
        each.sum::<f64>()
    };
    let counts = MatchingCounts {
        ours_size: ours.pairs.len(),
        paper_size: candidates.first().map_or(0, Vec::len),
        candidates: candidates.len(),
        ours_utility: rounded(utility(&ours.pairs)),
        paper_utility: rounded(
            candidates
                .iter()
                .map(|candidate| utility(candidate))
                .fold(f64::NEG_INFINITY, f64::max),
        ),
    };
    (counts, MatchingTimes { ours_us, paper_us })
}
