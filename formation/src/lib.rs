//! The pure core of the formation suite.
//!
//! Modular robots decide for themselves which module takes which spot of a target configuration, in which order they
//! move, and when it is safe to move. This crate takes every such decision. It uses no sockets, threads, clocks, random
//! numbers or files, so every run can be replayed.
//!
//! The algorithms follow A. Dutta, P. Dasgupta and C. Nelson, "A Graph Isomorphism-based Decentralized
//! Algorithm for Modular Robot Configuration Formation" ("the paper"). The documentation of each module states where
//! they leave it.

pub mod event_log;
pub mod generate;
pub mod model;
pub mod motion;
pub mod planner;
pub mod protocol;
pub mod verify;
