//! Commands that this build lacks.

use clap::Args;

/// The arguments of a command that this build lacks, taken as they come: the answer is about the build, whatever they are.
#[derive(Debug, Args)]
pub struct AnyArguments {
    #[arg(hide = true, allow_hyphen_values = true, trailing_var_arg = true)]
    _ignored: Vec<std::ffi::OsString>,
}
