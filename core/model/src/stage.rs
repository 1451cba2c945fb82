//! The part of its work that a formation as a whole is doing.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The stages of a formation, in their order.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum FormationStage {
    /// No target was announced, or it was withdrawn.
    #[serde(rename = "waiting for a target")]
    WaitingForTarget,
    /// Modules announce themselves; there is no roster yet.
    #[default]
    Gathering,
    /// Units take turns.
    Planning,
    /// Every turn is claimed; some member has not shown the plan's digest.
    Agreeing,
    /// Units move.
    Acting,
    /// The end state is reached.
    Done,
}

impl FormationStage {
    /// All stages, in their order.
    pub const ALL: [Self; 6] = [
        Self::WaitingForTarget,
        Self::Gathering,
        Self::Planning,
        Self::Agreeing,
        Self::Acting,
        Self::Done,
    ];
}

impl fmt::Display for FormationStage {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(formatter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_and_people_read_the_same_names() {
        for stage in FormationStage::ALL {
            let json = serde_json::to_string(&stage).unwrap();
            assert_eq!(json, format!("\"{stage}\""));
        }
    }
}
