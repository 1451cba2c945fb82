//! The requests, and their bounds.

use serde::Deserialize;

use crate::Refusal;
use crate::findings::Named;

/// The longest scenario that is read, in bytes.
pub const SCENARIO_BYTES_MAX: usize = 4 * 1024 * 1024;

/// What the page asks.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "call", rename_all = "snake_case", deny_unknown_fields)]
pub enum EngineRequest {
    /// The shipped scenarios.
    Scenarios,
    /// The policies, and the kinds of faults.
    Policies,
    /// A scenario file as lists.
    Read {
        /// YAML or JSON.
        text: String,
    },
    /// A drawing as a scenario file.
    Write {
        /// YAML or JSON.
        text: String,
    },
    /// What is wrong with a scenario, or looks like a mistake.
    Check {
        /// YAML or JSON.
        text: String,
    },
    /// The plan of a scenario, with its film.
    Plan {
        /// YAML or JSON.
        text: String,
        /// Another policy than that of the scenario.
        #[serde(default)]
        policy: Option<String>,
    },
    /// A simulated run of a scenario with faults.
    Simulate {
        /// YAML or JSON.
        text: String,
        /// What decides everything that is drawn at random.
        seed: u64,
        /// The name of a kind of faults.
        faults: String,
    },
    /// Pictures of a plan, as SVG.
    Pictures {
        /// YAML or JSON.
        text: String,
        /// Another policy than that of the scenario.
        #[serde(default)]
        policy: Option<String>,
    },
}

impl EngineRequest {
    /// Reads a request.
    ///
    /// # Errors
    /// It is longer than what may be drawn, or none of these.
    pub fn read(request: &str) -> Result<Self, Refusal> {
        if request.len() > 2 * SCENARIO_BYTES_MAX {
            return Err(Refusal {
                text: format!(
                    "the request has {} bytes; a scenario may have {SCENARIO_BYTES_MAX}",
                    request.len()
                ),
                place: Named::default(),
            });
        }
        serde_json::from_str(request).map_err(|error| Refusal {
            text: format!("no request: {error}"),
            place: Named::default(),
        })
    }
}
