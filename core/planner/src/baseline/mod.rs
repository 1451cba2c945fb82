//! The paper's own algorithms, to compare with: the policy `paper`.

mod paper;

pub use paper::{CandidateInput, Candidates};
pub(crate) use paper::{Favourites, PaperTurn};
