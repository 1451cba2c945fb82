//! The value of a spot and the cost of taking it (paper, "Configuration Formation as Utility Maximization Problem").

mod centrality;
mod utility;

pub use centrality::betweenness;
pub use utility::Utilities;
