//! The time that real processes need to plan over DDS, by `formation run --plan-only --json`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use formation_model::RawScenario;
use serde::{Deserialize, Serialize};

use crate::error::CellError;

/// The launcher ends a run after this many seconds.
const TIMEOUT_S: u32 = 240;

/// One planning by real processes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProcessMeasurement {
    /// From the roster until the last claim was applied, measured by the verifier, in milliseconds.
    pub planning_ms: u64,
    /// Until all modules were known to the verifier, in milliseconds.
    pub discovery_ms: u64,
    /// The time of the core alone for the same plan, in microseconds.
    pub core_us: u64,
}

#[derive(Deserialize)]
struct Report {
    verdict: String,
    planning_ms: Option<u64>,
    discovery_ms: Option<u64>,
    planning_us: u64,
}

/// Plans a scenario by real processes.
pub(crate) fn measure(
    launcher: &Path,
    scenario: &RawScenario,
    modules_per_process: usize,
) -> Result<ProcessMeasurement, CellError> {
    let options = ["--plan-only".to_owned()];
    let output = run(launcher, scenario, modules_per_process, TIMEOUT_S, &options)?;
    if !output.status.success() {
        return Err(CellError::Planning(reason_of(&output)));
    }
    let report: Report =
        serde_json::from_slice(&output.stdout).map_err(|error| unusable(&error.to_string()))?;
    if report.verdict != "AGREED" {
        let verdict = report.verdict;
        return Err(unusable(&format!(
            "the verdict is {verdict} instead of AGREED"
        )));
    }
    let missing = |name: &str| unusable(&format!("{name} is missing"));
    Ok(ProcessMeasurement {
        planning_ms: report.planning_ms.ok_or_else(|| missing("planning_ms"))?,
        discovery_ms: report.discovery_ms.ok_or_else(|| missing("discovery_ms"))?,
        core_us: report.planning_us,
    })
}

/// Runs a scenario with `formation run --json` and these options.
pub(super) fn run(
    launcher: &Path,
    scenario: &RawScenario,
    modules_per_process: usize,
    timeout_s: u32,
    options: &[String],
) -> Result<Output, CellError> {
    let directory = tempfile::tempdir().map_err(|source| CellError::Io {
        what: "cannot make a temporary directory",
        source,
    })?;
    let path = write_scenario(directory.path(), scenario)?;
    Command::new(launcher)
        .arg("run")
        .arg(&path)
        .arg("--json")
        .args(["--timeout", &timeout_s.to_string()])
        .args(["--modules-per-process", &modules_per_process.to_string()])
        .args(options)
        .stdin(Stdio::null())
        .output()
        .map_err(|source| CellError::Io {
            what: "cannot start `formation run`",
            source,
        })
}

/// Writes a scenario for the launcher, and returns the path of the file.
fn write_scenario(directory: &Path, scenario: &RawScenario) -> Result<PathBuf, CellError> {
    let path = directory.join("scenario.yaml");
    // JSON is YAML.
    let text = serde_json::to_string(scenario).map_err(io::Error::from);
    text.and_then(|text| fs::write(&path, text))
        .map_err(|source| CellError::Io {
            what: "cannot write a scenario file",
            source,
        })?;
    Ok(path)
}

/// How the launcher ended, with its last words.
pub(super) fn reason_of(output: &Output) -> String {
    let errors = String::from_utf8_lossy(&output.stderr);
    let last = errors.lines().last().unwrap_or("no output");
    format!("`formation run` ended with {}: {last}", output.status)
}

pub(super) fn unusable(reason: &str) -> CellError {
    CellError::Planning(format!(
        "the report of `formation run` cannot be used: {reason}"
    ))
}
