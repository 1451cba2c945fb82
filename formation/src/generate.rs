//! `formation generate`.

use anyhow::anyhow;
use formation_generate::{GenerateError, GeneratorParameters, Grouping};
use formation_offline::{generated, to_yaml};
use ros_runtime::exit::Failure;

use crate::arguments::GenerateArguments;
use crate::console;

/// Generates a scenario and prints it as a scenario file.
///
/// # Errors
/// Names the option that is out of its range.
pub fn run(arguments: &GenerateArguments) -> Result<(), Failure> {
    let grouping = match (arguments.configurations, arguments.configuration_size) {
        (Some(equal), _) => equal,
        (None, Some(size)) => Grouping::Configurations(size),
        (None, None) if arguments.mixed => Grouping::Mixed,
        (None, None) => Grouping::Singletons,
    };
    let parameters = GeneratorParameters {
        degree_max: arguments.degree,
        ..GeneratorParameters::new(arguments.modules, arguments.spots, arguments.seed)
    }
    .grouped(grouping);
    let apart = (!arguments.touching).then_some(arguments.apart);
    let scenario = generated(&parameters, apart).map_err(|error| {
        Failure::BadInput(match error {
            GenerateError::OutOfRange { .. } => anyhow!("--{error}"),
            GenerateError::NoTreeFound { .. } => anyhow!(error),
        })
    })?;
    console::result_line(to_yaml(&scenario).trim_end())
}
