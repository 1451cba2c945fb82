//! Parameters: what people can tune, at the start and while a process runs.
//!
//! Each is declared with a description, a type, a range and a default. What the command line and parameter files assign
//! comes on top. While the process runs, `ros2 param` and its like reach them through the six parameter services.

mod declaration;
#[cfg(test)]
mod defaults;
mod node_wide;
mod services;
mod store;

pub(crate) use declaration::shown;
pub use declaration::{Change, Declaration, Range};
pub(crate) use node_wide::{NodeWide, node_wide};

pub(crate) use services::{ParameterRequest, ParameterServices};
pub use store::{ParameterError, Parameters, Values};
