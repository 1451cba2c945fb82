//! The arguments of `formation manual`.

use std::path::PathBuf;

use clap::Args;

/// Where the manual goes.
#[derive(Debug, Args)]
pub struct ManualArguments {
    /// Write the pages, formation.1 and one for each command, into this directory.
    #[arg(value_name = "DIR", required_unless_present = "markdown")]
    pub directory: Option<PathBuf>,
    /// Print one page of Markdown instead.
    #[arg(long, conflicts_with = "directory")]
    pub markdown: bool,
}
