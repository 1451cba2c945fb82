//! The command line.

use std::path::PathBuf;

use clap::{Parser, Subcommand};

/// Forms a target configuration out of robot modules over DDS.
#[derive(Debug, Parser)]
#[command(name = "formation", version, after_help = EXIT_STATUS)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

const EXIT_STATUS: &str = "\
Exit status:
  0  done
  1  the formation failed or was found wrong
  2  bad input or usage";

/// What the launcher can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Validate a scenario file, and name what is wrong and where.
    Check {
        /// The scenario file (YAML).
        scenario: PathBuf,
    },
}
