//! Reading scenario files.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use formation::scenario::Scenario;

use crate::outcome::Failure;

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
    let text = read(path).map_err(|error| refuse(&error))?;
    Scenario::from_yaml(&text).map_err(|error| refuse(&error))
}

fn read(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    File::open(path)?
        .take(BYTES_MAX + 1)
        .read_to_string(&mut text)?;
    if text.len() as u64 > BYTES_MAX {
        return Err(io::Error::other(format!(
            "is larger than {BYTES_MAX} bytes"
        )));
    }
    Ok(text)
}
