//! Reading scenario files.

use std::path::Path;

use formation_model::{ModuleSize, Scenario};

use ros_runtime::arguments::read_bounded;
use ros_runtime::exit::Failure;
use ros_runtime::settings::Settings;

/// The largest scenario, of as many modules and spots as are supported, takes a few megabytes.
const BYTES_MAX: u64 = 64 << 20;

/// Reads a scenario file whose modules have the size that it gives, unless a parameter of the node gives another.
///
/// # Errors
/// Names the file, the line or field, and what is wrong.
pub fn read_own_scenario(path: &Path, settings: &mut Settings) -> Result<Scenario, Failure> {
    let scenario = read_scenario(path)?;
    settings.module_size = scenario.module_size().map(ModuleSize::metres);
    Ok(scenario)
}

/// Reads and validates a scenario file, whose target modules can form.
///
/// # Errors
/// Names the file, the line or field, and what is wrong.
pub fn read_scenario(path: &Path) -> Result<Scenario, Failure> {
    let refuse = |reason: &dyn std::fmt::Display| {
        Failure::bad_input(format_args!("{}: {reason}", path.display()))
    };
    let text = read_bounded(path, BYTES_MAX).map_err(|error| refuse(&error))?;
    let scenario = Scenario::from_yaml(&text).map_err(|error| refuse(&error))?;
    scenario.check_formable().map_err(|error| refuse(&error))?;
    Ok(scenario)
}
