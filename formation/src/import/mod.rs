//! `formation import`: walls from the map of a robot or of a benchmark, as obstacles of a scenario.

mod grid;
mod grid_map;
mod occupancy_map;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, anyhow};
use formation_generate::{LatticeCell, on_cells};
use formation_model::{DRAWN_BOXES_MAX, ModuleSize};
use ros_runtime::exit::Failure;

use crate::arguments::ImportArguments;
use crate::console;
use crate::generate::to_yaml;
use grid::{Grid, Run};

/// Prints the walls of a map, and with `--modules` a scenario between them.
///
/// # Errors
/// Names the file, and what is wrong with it or with an option.
pub fn run(arguments: &ImportArguments) -> Result<(), Failure> {
    let path = arguments.map.as_path();
    let text = import(path, arguments).with_context(|| path.display().to_string());
    console::result_line(text.map_err(Failure::BadInput)?.trim_end())
}

fn import(path: &Path, arguments: &ImportArguments) -> anyhow::Result<String> {
    let is_grid_map = path.extension().is_some_and(|end| end == "map");
    let size = ModuleSize::from_metres(arguments.module_size)
        .map_err(|error| anyhow!("--module-size: {error}"))?;
    let grid = match is_grid_map {
        true => grid_map::read(path)?,
        false => occupancy_map::read(path, size, arguments.unknown_is_free)?,
    };
    let runs = grid.closed_runs();
    if runs.len() > DRAWN_BOXES_MAX {
        return Err(anyhow!(
            "has {} walls, and a scenario at most {DRAWN_BOXES_MAX}; a larger --module-size makes fewer cells",
            runs.len()
        ));
    }
    let mut text = match arguments.modules {
        Some(count) => scenario(&grid, count, arguments.seed, path)?,
        None => String::new(),
    };
    if !is_grid_map {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "module_size: {:?}", arguments.module_size);
    }
    write_walls(&mut text, &grid, &runs);
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

fn write_walls(text: &mut String, grid: &Grid, runs: &[Run]) {
    if !runs.is_empty() {
        text.push_str("obstacles:\n");
    }
    for run in runs {
        let _ = writeln!(text, "  - {}", area(run.x, run.y, (run.length, 1)));
    }
    let _ = writeln!(
        text,
        "arena: {}",
        area(grid.low.0, grid.low.1, (grid.width, grid.height))
    );
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
