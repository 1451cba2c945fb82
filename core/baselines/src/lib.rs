//! Assignments of single modules to spots, to compare the planner with: an auction and the Hungarian method.
//!
//! Both take a matrix of utilities and know nothing of formations. The planner's policies `auction` and `hungarian` use them.

pub mod auction;
pub mod hungarian;
