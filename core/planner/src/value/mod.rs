//! The value of a spot and the cost of taking it (paper, "Configuration Formation as Utility Maximization Problem").

mod centrality;
mod detours;
mod distance_cost;
mod path_shares;
mod utility;

pub use centrality::betweenness;
pub use path_shares::share_of_shortest_paths;
pub use utility::Utilities;
