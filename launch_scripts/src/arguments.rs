//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

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
    /// Decide who takes which spot, offline, by the same core as in every module.
    Plan {
        /// The scenario file (YAML).
        scenario: PathBuf,
        /// Print one JSON object instead of a table.
        #[arg(long)]
        json: bool,
    },
    /// Make a random scenario from a seed and print it as YAML.
    ///
    /// Targets and configurations are trees on the unit lattice; leaders and singletons stand uniformly in a box of
    /// 16 x 16 units. The same options give the same scenario.
    Generate(GenerateArguments),
}

/// What to generate.
#[derive(Debug, Args)]
pub struct GenerateArguments {
    /// How many modules.
    #[arg(long, value_name = "N")]
    pub modules: usize,
    /// How many spots.
    #[arg(long, value_name = "N")]
    pub spots: usize,
    /// Dock the modules into configurations of K; those left over stand alone.
    #[arg(long, value_name = "K", conflicts_with = "mixed")]
    pub configuration_size: Option<usize>,
    /// Mix singletons with configurations of 2 to 10 modules.
    #[arg(long)]
    pub mixed: bool,
    /// The most links that one spot or module has: 3 or 4.
    #[arg(long, value_name = "D", default_value_t = 3)]
    pub degree: usize,
    /// The seed of all that is random.
    #[arg(long, value_name = "X")]
    pub seed: u64,
}
