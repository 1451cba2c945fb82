//! Parameters: what people can tune, at the start and while a process runs.
//!
//! A node declares its parameters as a table of [`Tunable`]s, one row a parameter: its name, meaning, type, range, when
//! it can change, and the field that holds it. The option of the command line, the declaration for ROS 2 and the
//! reading of its value all come from that row. The command line and parameter files assign values on top of the
//! defaults. While the process runs, `ros2 param` reaches the parameters through the six parameter services.

mod declaration;
mod node_parameters;
mod services;
mod store;
mod tunable;

pub use declaration::{Change, Declaration, Range};
pub use node_parameters::NodeParameters;
pub use ros2_client::ParameterValue;
pub(crate) use services::{ParameterRequest, serve};
pub use store::{ParameterError, Parameters, Values};
pub use tunable::{
    Tunable, Tunables, Tuned, ValueType, as_number, choice, milliseconds, number, seconds, switch,
    text, whole_number,
};
