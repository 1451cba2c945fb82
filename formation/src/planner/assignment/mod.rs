//! Which single module takes which spot: chains of evictions as shortest augmenting paths (paper, Algorithm 1).

mod allocation;
mod bounded_eviction;
pub(crate) mod eviction;
pub(crate) mod exact_finish;
mod frontier;
mod instance;
pub(crate) mod spot_allocation;
pub(crate) mod spot_tree;

pub(crate) use allocation::{Holder, SpotTable};
pub use instance::Instance;
