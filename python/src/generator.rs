//! Scenarios that are drawn from a seed, or imported.

use std::path::PathBuf;

use formation_generate::{GeneratorParameters, Grouping};
use formation_offline::{ImportOptions, field_percent, generated, import};
use pyo3::prelude::*;

use crate::errors::option_refused;
use crate::scenario::NativeScenario;

/// Draws the scenario that `formation generate` prints for these options: `sizes` are the numbers of modules and spots, and `apart` is `None` for `--touching`.
#[pyfunction]
#[pyo3(signature = (sizes, configuration_size, mixed, degree, apart, seed))]
pub fn generate(
    py: Python<'_>,
    sizes: (usize, usize),
    configuration_size: Option<usize>,
    mixed: bool,
    degree: usize,
    apart: Option<f64>,
    seed: u64,
) -> PyResult<NativeScenario> {
    let (modules, spots) = sizes;
    let grouping = match configuration_size {
        Some(size) => Grouping::Configurations(size),
        None if mixed => Grouping::Mixed,
        None => Grouping::Singletons,
    };
    let parameters = GeneratorParameters {
        degree_max: degree,
        ..GeneratorParameters::new(modules, spots, seed)
    }
    .grouped(grouping);
    let apart = apart.map(field_percent).transpose();
    let apart = apart.map_err(|reason| option_refused(py, &format!("apart: {reason}")))?;
    let raw = py.detach(|| generated(&parameters, apart));
    let raw = raw.map_err(|error| option_refused(py, &error.to_string()))?;
    NativeScenario::of(py, raw, None)
}

/// The longest text of a map at this path, in bytes.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "Python gives values")]
pub fn map_bytes_max(path: PathBuf) -> u64 {
    formation_offline::map_bytes_max(&path)
}

/// What `formation import` prints for the text of a map.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "Python gives values")]
#[pyo3(signature = (path, text, module_size, modules, seed, unknown_is_free))]
pub fn import_map(
    py: Python<'_>,
    path: PathBuf,
    text: &str,
    module_size: f64,
    modules: Option<usize>,
    seed: u64,
    unknown_is_free: bool,
) -> PyResult<String> {
    let options = ImportOptions {
        module_size,
        modules,
        seed,
        unknown_is_free,
    };
    let imported = py.detach(|| import(&path, text, &options));
    imported.map_err(|error| option_refused(py, &format!("{}: {error}", path.display())))
}
