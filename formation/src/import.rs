//! `formation import`.

use anyhow::Context;
use formation_offline::{ImportOptions, import, map_bytes_max};
use ros_runtime::arguments::read_bounded;
use ros_runtime::exit::Failure;

use crate::arguments::ImportArguments;
use crate::console;

/// Prints the walls of a map, and with `--modules` a scenario between them.
///
/// # Errors
/// Names the file, and what is wrong with it or with an option.
pub fn run(arguments: &ImportArguments) -> Result<(), Failure> {
    let path = arguments.map.as_path();
    let options = ImportOptions {
        module_size: arguments.module_size,
        modules: arguments.modules,
        seed: arguments.seed,
        unknown_is_free: arguments.unknown_is_free,
    };
    let text = read_bounded(path, map_bytes_max(path)).map_err(anyhow::Error::from);
    let text = text.and_then(|text| Ok(import(path, &text, &options)?));
    let text = text.with_context(|| path.display().to_string());
    console::result_line(text.map_err(Failure::BadInput)?.trim_end())
}
