//! A formation of real processes in the physical world, by `formation run --world --json`.

use std::path::Path;

use formation_model::RawScenario;
use serde::{Deserialize, Serialize};

use super::processes::{reason_of, run, unusable};
use crate::error::CellError;

/// A physical world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct World {
    /// How much of its velocity a robot loses at most.
    pub slip_percent: u32,
    /// The noise of poses, in thousandths of a unit and of a radian.
    pub noise_thousandths: u32,
    pub seed: u64,
}

impl World {
    pub(crate) fn slip(self) -> f64 {
        f64::from(self.slip_percent) / 100.0
    }

    pub(crate) fn noise(self) -> f64 {
        f64::from(self.noise_thousandths) / 1000.0
    }
}

/// The launcher ends a run after this many seconds.
const TIMEOUT_S: u32 = 60;

/// One formation in the physical world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldMeasurement {
    /// Whether the verdict was COMPLETE.
    pub complete: bool,
    /// The number of spots.
    pub spots: usize,
    /// The number of spots without a module at the end.
    pub open_spots: usize,
    /// From the first motion to the end, in milliseconds; none without motion.
    pub acting_ms: Option<u64>,
    /// Contacts of modules that were not docked.
    pub contacts: u64,
    /// Those of them that were more than a touch.
    pub contacts_above_touch: u64,
}

#[derive(Deserialize)]
struct Report {
    verdict: String,
    acting_ms: Option<u64>,
    assignments: Vec<serde_json::Value>,
    open_spots: Vec<serde_json::Value>,
    world: Contacts,
}

#[derive(Deserialize)]
struct Contacts {
    contacts: u64,
    contacts_above_touch: u64,
}

/// Forms a scenario in the physical world. A run that ends FAILED is a result too.
pub(crate) fn measure(
    launcher: &Path,
    scenario: &RawScenario,
    modules_per_process: usize,
    world: World,
) -> Result<WorldMeasurement, CellError> {
    let options = [
        "--world".to_owned(),
        format!("--slip={}", world.slip()),
        format!("--noise={}", world.noise()),
        format!("--world-option=--seed={}", world.seed),
    ];
    let output = run(launcher, scenario, modules_per_process, TIMEOUT_S, &options)?;
    let report: Report = serde_json::from_slice(&output.stdout)
        .map_err(|error| unusable(&format!("{error}; {}", reason_of(&output))))?;
    Ok(WorldMeasurement {
        complete: report.verdict == "COMPLETE",
        spots: report.assignments.len() + report.open_spots.len(),
        open_spots: report.open_spots.len(),
        acting_ms: report.acting_ms,
        contacts: report.world.contacts,
        contacts_above_touch: report.world.contacts_above_touch,
    })
}
