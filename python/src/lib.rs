//! The extension module `formation._native`: the pure core for Python.
//!
//! *Invariant*: nothing is computed here. Each class holds a value of the core or of `formation_offline`, and gives it out as the
//! JSON that the launcher prints, so that both give the same numbers. While Rust computes, the interpreter is released.
//! The classes that people use are written in Python, in `python/formation`.

mod arrays;
mod errors;
mod generator;
mod plan;
mod scenario;
mod simulation;
mod trace;

use pyo3::prelude::*;

/// What the Python package computes in Rust.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::generator::{generate, import_map, map_bytes_max};
    #[pymodule_export]
    use super::plan::NativePlan;
    #[pymodule_export]
    use super::scenario::NativeScenario;
    #[pymodule_export]
    use super::simulation::{NativeSimulation, fault_kinds, simulate};
    #[pymodule_export]
    use super::trace::verify_json;
}
