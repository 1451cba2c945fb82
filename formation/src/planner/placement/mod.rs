//! Where a configuration fits into the target: a utility-optimal maximum common subgraph, exact on trees and by branch
//! and bound elsewhere (paper, Algorithm 2).

pub mod common_subgraph;
pub mod common_subtree;
mod matching;
pub(crate) mod small_assignment;

pub use matching::{Matching, MatchingInput};
