//! `formation import`: walls from the map of a robot or of a benchmark as obstacles of a scenario, and instances of a contest.

mod cgshop;
mod grid;
mod grid_map;
mod occupancy_map;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use anyhow::{anyhow, ensure};
use formation_generate::{LatticeCell, on_cells};
use formation_model::{DRAWN_BOXES_MAX, ModuleSize};
use thiserror::Error;

use crate::scenario_text::to_yaml;
use grid::{CELLS_MAX, Grid, Run};

/// What to import of a map, and for which modules.
#[derive(Clone, Debug)]
pub struct ImportOptions {
    /// The size of a module in metres, which is a unit of the scenario; without meaning for a map of MovingAI.
    pub module_size: f64,
    /// How many spots, and as many single modules, to draw; `None` for the walls alone.
    pub modules: Option<usize>,
    /// The seed of the random numbers.
    pub seed: u64,
    /// Whether modules may enter what the map does not know.
    pub unknown_is_free: bool,
}

/// Why a map was refused.
#[derive(Debug, Error)]
#[error("{0:#}")]
pub struct ImportError(anyhow::Error);

/// The longest text of a map at this path, in bytes.
#[must_use]
pub fn map_bytes_max(path: &Path) -> u64 {
    match is_grid_map(path) || is_instance(path) {
        true => 2 * CELLS_MAX as u64,
        false => 1 << 20,
    }
}

/// Whether a file is an instance of CG:SHOP, by its name.
fn is_instance(path: &Path) -> bool {
    path.extension().is_some_and(|end| end == "json")
}

fn is_grid_map(path: &Path) -> bool {
    path.extension().is_some_and(|end| end == "map")
}

/// The walls of a map, and with `modules` a scenario between them, as the text of a scenario file; of an instance of CG:SHOP its
/// whole scenario. The name of the file says what its text is, and where its image lies.
///
/// # Errors
/// Names what is wrong with the text, with its image, or with an option.
pub fn import(path: &Path, text: &str, options: &ImportOptions) -> Result<String, ImportError> {
    imported(path, text, options).map_err(ImportError)
}

fn imported(path: &Path, text: &str, options: &ImportOptions) -> anyhow::Result<String> {
    if is_instance(path) {
        return instance(path, text, options);
    }
    let is_grid_map = is_grid_map(path);
    let size = ModuleSize::from_metres(options.module_size)
        .map_err(|error| anyhow!("--module-size: {error}"))?;
    let grid = match is_grid_map {
        true => grid_map::read(text)?,
        false => occupancy_map::read(path, text, size, options.unknown_is_free)?,
    };
    let runs = grid.closed_runs();
    ensure!(
        runs.len() <= DRAWN_BOXES_MAX,
        "has {} walls, and a scenario at most {DRAWN_BOXES_MAX}; a larger --module-size makes fewer cells",
        runs.len()
    );
    let mut text = match options.modules {
        Some(count) => scenario(&grid, count, options.seed, path)?,
        None => String::new(),
    };
    if !is_grid_map {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "module_size: {:?}", options.module_size);
    }
    write_walls(&mut text, &runs);
    let _ = writeln!(
        text,
        "arena: {}",
        area(grid.low.0, grid.low.1, (grid.width, grid.height))
    );
    Ok(text)
}

/// An instance of CG:SHOP, in which it is given who goes where.
fn instance(path: &Path, text: &str, options: &ImportOptions) -> anyhow::Result<String> {
    ensure!(
        options.modules.is_none(),
        "--modules: an instance has robots of its own"
    );
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = stem.strip_suffix(".instance").unwrap_or(&stem);
    let (scenario, runs) = cgshop::read(text, name)?;
    ensure!(
        runs.len() <= DRAWN_BOXES_MAX,
        "has {} obstacles, and a scenario at most {DRAWN_BOXES_MAX}",
        runs.len()
    );
    let mut text = to_yaml(&scenario);
    let keeps = match scenario.planner.keep_all_spots {
        true => ", keep_all_spots: true",
        false => "",
    };
    // Writing to a string cannot fail.
    let _ = writeln!(text, "planner: {{policy: given{keeps}}}");
    write_walls(&mut text, &runs);
    Ok(text)
}

/// A target and as many modules on free cells.
fn scenario(grid: &Grid, count: usize, seed: u64, path: &Path) -> anyhow::Result<String> {
    let free: BTreeSet<LatticeCell> = grid.free_cells().collect();
    let mut scenario = on_cells(&free, count, seed).ok_or_else(|| {
        anyhow!(
            "--modules {count}: the largest connected part of the {} free cells has no room for as many spots and modules",
            free.len()
        )
    })?;
    if let Some(name) = path.file_stem() {
        scenario.name = format!("{}_{count}_{seed}", name.to_string_lossy());
        scenario.name.truncate(255);
    }
    Ok(to_yaml(&scenario))
}

fn write_walls(text: &mut String, runs: &[Run]) {
    if !runs.is_empty() {
        text.push_str("obstacles:\n");
    }
    for run in runs {
        let _ = writeln!(text, "  - {}", area(run.x, run.y, (run.length, 1)));
    }
}

/// A box of cells whose lowest one is given, as a scenario has it.
fn area(x: i64, y: i64, (width, height): (usize, usize)) -> String {
    #[expect(clippy::cast_precision_loss, reason = "maps are bounded")]
    let middle = |low: i64, extent: usize| low as f64 + (extent as f64 - 1.0) / 2.0;
    format!(
        "{{x: {:?}, y: {:?}, width: {width}, height: {height}}}",
        middle(x, width),
        middle(y, height)
    )
}

#[cfg(test)]
mod tests;
