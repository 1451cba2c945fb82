//! `formation policies`, and a policy that is chosen on the command line.

use formation_model::{Policy, PolicyEntry};
use ros_runtime::exit::Failure;

use crate::console;

/// Prints each policy with what it does and its source.
///
/// # Errors
/// The output is closed.
pub fn list(json: bool) -> Result<(), Failure> {
    let entries: Vec<PolicyEntry> = Policy::all().map(|(_, entry)| entry).collect();
    if json {
        return console::result_json(&entries);
    }
    let lines = entries.iter().map(|entry| {
        let PolicyEntry {
            name,
            sentence,
            source,
        } = entry;
        format!("{name}: {sentence} ({source})")
    });
    console::result_text(&lines.collect::<Vec<_>>().join("\n"))
}

/// The policy of a name, for the command line.
///
/// # Errors
/// Lists the names that there are.
pub fn named(name: &str) -> Result<Policy, String> {
    Policy::named(name)
        .ok_or_else(|| format!("there is no such policy; there are {}", Policy::NAMES))
}
