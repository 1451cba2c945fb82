//! What a spot is worth and what it costs (paper, "Configuration Formation as Utility Maximization").

mod centrality;
mod utility;

pub use centrality::betweenness;
pub use utility::Utilities;
