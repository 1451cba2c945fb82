//! The requests, and their bounds.

use serde::Deserialize;

use crate::Refusal;
use crate::findings::Named;

/// The longest scenario that is read, in bytes.
pub const SCENARIO_BYTES_MAX: usize = 4 * 1024 * 1024;

/// What is drawn.
#[derive(Clone, Debug, Deserialize)]
pub struct Drawn {
    /// The scenario, as YAML or JSON.
    pub text: String,
    /// Another policy than that of the scenario.
    #[serde(default)]
    pub policy: Option<String>,
}

/// What the page asks.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "call", rename_all = "snake_case")]
pub enum EngineRequest {
    /// The shipped scenarios.
    Scenarios,
    /// The policies and the kinds of faults that there are.
    Choices,
    /// A scenario file as lists.
    Read(Drawn),
    /// The scenario file of a drawing.
    Write(Drawn),
    /// The plan, its film, and what is wrong or odd.
    Plan(Drawn),
    /// Four moments of the plan in a row, as SVG.
    Figure(Drawn),
    /// A simulated run with faults.
    Simulate {
        /// What runs.
        #[serde(flatten)]
        drawn: Drawn,
        /// What decides everything that is drawn at random.
        seed: u64,
        /// The name of a kind of faults.
        faults: String,
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
