//! Parameters: what people can tune, at the start and while a process runs.
//!
//! Each is declared with a description, a type, a range and a default. What the command line and parameter files assign
//! comes on top. While the process runs, `ros2 param` and its like reach them through the six parameter services.

mod declaration;
mod node_wide;
mod services;
mod store;

pub use declaration::shown;
pub use declaration::{Change, Declaration, Range};
pub use node_wide::{NodeWide, node_wide};

pub use services::{ParameterRequest, ParameterServices};
pub use store::{ParameterError, Parameters, Values};
