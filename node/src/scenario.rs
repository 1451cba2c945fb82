//! Reading scenario files.

use std::path::Path;

use formation::model::Scenario;

use ros_runtime::arguments::read_bounded;
use ros_runtime::exit::Failure;

/// The largest scenario, of as many modules and spots as are supported, takes a few megabytes.
const BYTES_MAX: u64 = 64 << 20;

/// Reads and validates a scenario file.
///
/// # Errors
/// Names the file, the line or field, and what is wrong.
pub fn read_scenario(path: &Path) -> Result<Scenario, Failure> {
    let refuse = |reason: &dyn std::fmt::Display| {
        Failure::bad_input(format_args!("{}: {reason}", path.display()))
    };
    let text = read_bounded(path, BYTES_MAX).map_err(|error| refuse(&error))?;
    Scenario::from_yaml(&text).map_err(|error| refuse(&error))
}
