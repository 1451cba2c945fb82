//! A physical world: plays the robots of a formation as rigid bodies in the plane.
//!
//! [`World`] is the physics. It computes in units, the pitch of the lattice, with its own time, and has no socket and no clock;
//! on one machine, the same seed and the same inputs at the same times give the same motion. [`process`] is the ROS 2 node
//! around it.

mod contacts;
mod docking;
mod drive;
pub mod options;
mod plane;
pub mod process;
mod random;
mod robot;
mod world;

pub use options::DriveKind;
pub use world::World;
