//! The pure core of the formation suite.
//!
//! The modules of a self-reconfigurable robot decide among themselves who takes which spot of a target
//! configuration, in which order they move, and when it is safe to move. This crate takes every such
//! decision; it knows no socket, thread, clock, random number or file, so that each run can be replayed.
//!
//! The algorithms follow A. Dutta, P. Dasgupta and C. Nelson, "A Graph Isomorphism-based Decentralized
//! Algorithm for Modular Robot Configuration Formation" ("the paper"), and say where they leave it.

pub mod agent;
pub mod allocation;
pub mod assembly;
pub mod baseline;
mod block_allocation;
mod bounded_eviction;
pub mod centrality;
pub mod chronicle;
pub mod common_subgraph;
pub mod common_subtree;
pub mod digest;
mod eviction;
mod exact_finish;
pub mod fixed;
mod frontier;
pub mod generate;
pub mod geometry;
pub mod id;
pub mod instance;
pub mod matching;
pub mod message;
pub mod motion;
pub mod parameters;
pub mod plan;
pub mod planning;
pub mod problem;
pub mod scenario;
mod small_assignment;
mod spot_allocation;
mod spot_tree;
pub mod statistics;
pub mod target;
pub mod topology;
mod trimming;
mod turn_order;
pub mod utility;
pub mod verify;

/// At most this many modules take part in one formation.
pub const MODULES_MAX: usize = 10_000;
/// At most this many spots make one target.
pub const SPOTS_MAX: usize = 10_000;
/// At most this many edges make one target.
pub const EDGES_MAX: usize = 40_000;
/// At most this many modules are docked to one module.
pub const LINKS_MAX: usize = 64;
/// At most this many bytes make the name of a formation or of a frame.
pub const NAME_BYTES_MAX: usize = 255;
