//! The arguments of `formation import`.

use std::path::PathBuf;

use clap::Args;

/// What to import.
#[derive(Debug, Args)]
pub struct ImportArguments {
    /// The map: FILE.yaml of ROS 2, which names a PGM or PNG image, or FILE.map of MovingAI; or FILE.json, an instance of CG:SHOP 2021,
    /// which is a whole scenario.
    pub map: PathBuf,
    /// The size of a module in metres, which is a unit of the scenario; without meaning for FILE.map, where a character is a cell.
    #[arg(long, value_name = "METRES", default_value_t = 1.0)]
    pub module_size: f64,
    /// Print a whole scenario: a connected target of N spots, and N single modules, on random free cells of the largest part.
    #[arg(long, value_name = "N")]
    pub modules: Option<usize>,
    /// The seed of the random numbers.
    #[arg(long, value_name = "X", default_value_t = 0, requires = "modules")]
    pub seed: u64,
    /// Leave cells open of which the map does not know whether they are occupied.
    #[arg(long)]
    pub unknown_is_free: bool,
}
