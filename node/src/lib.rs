//! What the nodes of the suite share: the table of topics, the conversion of samples, and the arguments of all of them.

pub mod inlet;
pub mod scenario;
pub mod source_guard;
pub mod stamp;
pub mod topics;
