//! Which single module takes which spot: chains of evictions as shortest augmenting paths (paper, Algorithm 1).

mod allocation;
mod best_of_spots;
mod bounded_eviction;
mod eviction;
mod exact_finish;
mod frontier;
mod instance;
mod spot_tree;

pub(crate) use allocation::{Allocation, Displacement, Holder, SpotTable};
pub(crate) use best_of_spots::BestOfSpots;
pub(crate) use eviction::ChainSearch;
pub(crate) use exact_finish::finish;
pub use instance::Instance;
