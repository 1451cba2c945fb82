//! The arguments of `formation generate`.

use clap::Args;
use formation_generate::Grouping;
use formation_offline::field_percent;

/// What to generate.
#[derive(Debug, Args)]
pub struct GenerateArguments {
    /// How many modules.
    #[arg(long, value_name = "N")]
    pub modules: usize,
    /// How many spots.
    #[arg(long, value_name = "N")]
    pub spots: usize,
    /// Dock the modules into configurations of K; the modules left over are singletons.
    #[arg(long, value_name = "K", conflicts_with = "mixed")]
    pub configuration_size: Option<usize>,
    /// Dock the modules into K configurations of SIZE; the other modules are singletons.
    #[arg(long, value_name = "KxSIZE", conflicts_with_all = ["mixed", "configuration_size"], value_parser = equal_configurations)]
    pub configurations: Option<Grouping>,
    /// Mix singletons with configurations of 2 to 10 modules.
    #[arg(long)]
    pub mixed: bool,
    /// The most links that one spot or module has: 3 or 4.
    #[arg(long, value_name = "D", default_value_t = 3)]
    pub degree: usize,
    /// Width of the square field about the target in which the modules start, as a multiple of the square root of their number.
    /// They start so far apart that all can move at the same time without contact
    #[arg(
        long, value_name = "F", num_args = 0..=1, default_value = "3", default_missing_value = "3",
        value_parser = field_width
    )]
    pub apart: u32,
    /// Draw the starts as in the paper, in a box of 16 by 16 units: modules of different configurations can overlap, and then none of
    /// them moves. For plans alone
    #[arg(long, conflicts_with = "apart")]
    pub touching: bool,
    /// The seed of the random numbers.
    #[arg(long, value_name = "X")]
    pub seed: u64,
}

/// Reads the width of a field, in hundredths.
fn field_width(text: &str) -> Result<u32, String> {
    field_percent(text.parse().map_err(|_| "not a number")?)
}

/// Reads a number of configurations of one size, such as 3x4.
pub fn equal_configurations(text: &str) -> Result<Grouping, String> {
    let (count, size) = text.split_once('x').unwrap_or_default();
    let number = |text: &str| text.parse::<usize>().ok().filter(|&number| number > 0);
    number(count.trim())
        .zip(number(size.trim()))
        .map(|(count, size)| Grouping::Equal { count, size })
        .ok_or_else(|| "must be KxSIZE, such as 3x4".to_owned())
}
