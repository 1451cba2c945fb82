//! What travels on `verdict`.

#![expect(missing_docs, reason = "the .msg files document fields and constants")]

use formation_model::{ModuleId, SpotId};
use formation_verify::{self as verify, Outcome};
use serde::{Deserialize, Serialize};

use crate::bounds::{MODULES_MAX, SPOTS_MAX, VIOLATION_BYTES_MAX, VIOLATIONS_MAX, shortened};
use crate::check::{self, Checked, FieldError};
use crate::claim::SpotSelection;
use crate::epoch::Epoch;
use crate::error::MessageError;
use crate::standard::Header;
use crate::topic;

/// See `Verdict.msg`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Verdict {
    pub header: Header,
    pub session: u64,
    pub epoch: Epoch,
    pub outcome: u8,
    pub filled_spots: u32,
    pub spots: u32,
    pub open_spots: Vec<u32>,
    pub unassigned_modules: Vec<u32>,
    pub assignments: Vec<SpotSelection>,
    pub blocked_spots: Vec<SpotSelection>,
    pub collision_free: bool,
    pub collision_reason: String,
    pub violations: Vec<String>,
}

impl Verdict {
    pub const OUTCOME_COMPLETE: u8 = 1;
    pub const OUTCOME_PARTIAL: u8 = 2;
    pub const OUTCOME_FAILED: u8 = 3;
    /// Done, but bodies overlapped by less than the tolerances of their poses; see `collision_reason`.
    pub const OUTCOME_NOT_JUDGED: u8 = 4;

    /// The outcome of a verdict that is within its bounds.
    ///
    /// # Errors
    /// Names the field that is wrong.
    pub fn judgement(&self) -> Result<Outcome, MessageError> {
        self.checked().map_err(|error| error.on(topic::VERDICT))
    }

    fn checked(&self) -> Checked<Outcome> {
        check::count("open_spots", self.open_spots.len(), SPOTS_MAX)?;
        check::count(
            "unassigned_modules",
            self.unassigned_modules.len(),
            MODULES_MAX,
        )?;
        check::count("assignments", self.assignments.len(), SPOTS_MAX)?;
        check::count("blocked_spots", self.blocked_spots.len(), SPOTS_MAX)?;
        check::count("violations", self.violations.len(), VIOLATIONS_MAX)?;
        for sentence in self.violations.iter().chain([&self.collision_reason]) {
            check::length("violations", sentence, VIOLATION_BYTES_MAX)?;
        }
        match self.outcome {
            Self::OUTCOME_COMPLETE => Ok(Outcome::Complete),
            Self::OUTCOME_PARTIAL => Ok(Outcome::Partial),
            Self::OUTCOME_FAILED => Ok(Outcome::Failed),
            Self::OUTCOME_NOT_JUDGED => Ok(Outcome::NotJudged),
            unknown => Err(FieldError::unknown(
                "outcome",
                unknown,
                "COMPLETE 1, PARTIAL 2, FAILED 3, NOT_JUDGED 4",
            )),
        }
    }
}

/// Why it is not known, or known not to be so, that bodies did not meet; empty if they did not.
fn collision_reason(verdict: &verify::Verdict) -> String {
    let unjudged = verdict.unjudged.iter();
    let unjudged: Vec<String> = unjudged
        .map(|(module, time)| format!("{module}, {:.1} s", time.as_secs_f64()))
        .collect();
    match verdict.collision_risk {
        Some(risk) => risk.to_string(),
        None if unjudged.is_empty() => String::new(),
        None => format!("not judged ({})", unjudged.join("; ")),
    }
}

impl From<&verify::Verdict> for Verdict {
    /// The header and the session stay empty, for the sender to fill.
    fn from(verdict: &verify::Verdict) -> Self {
        let mut placed: Vec<(SpotId, ModuleId)> = verdict
            .assignments
            .iter()
            .map(|(&module, &spot)| (spot, module))
            .collect();
        placed.sort_unstable();
        let spots = verdict
            .filled_spots
            .saturating_add(verdict.open_spots.len());
        Self {
            header: Header::default(),
            session: 0,
            epoch: verdict.epoch.as_ref().into(),
            outcome: match verdict.outcome {
                Outcome::Complete => Self::OUTCOME_COMPLETE,
                Outcome::Partial => Self::OUTCOME_PARTIAL,
                Outcome::Failed => Self::OUTCOME_FAILED,
                Outcome::NotJudged => Self::OUTCOME_NOT_JUDGED,
            },
            filled_spots: u32::try_from(verdict.filled_spots).unwrap_or(u32::MAX),
            spots: u32::try_from(spots).unwrap_or(u32::MAX),
            open_spots: verdict.open_spots.iter().map(|spot| spot.0).collect(),
            unassigned_modules: verdict.unassigned.iter().map(|module| module.0).collect(),
            assignments: placed
                .into_iter()
                .map(|(spot, module)| SpotSelection::new(spot, module))
                .collect(),
            blocked_spots: verdict
                .blocked_spots
                .iter()
                .map(|blocked| SpotSelection::new(blocked.spot, blocked.module))
                .collect(),
            collision_free: verdict.collision_risk.is_none() && verdict.unjudged.is_empty(),
            collision_reason: shortened(collision_reason(verdict), VIOLATION_BYTES_MAX),
            violations: bounded(
                verdict
                    .violations
                    .iter()
                    .map(ToString::to_string)
                    .chain(verdict.missing.iter().map(ToString::to_string)),
            ),
        }
    }
}

/// At most `VIOLATIONS_MAX` sentences, each cut to its bound; if there are more, the last one gives the number left out.
fn bounded(sentences: impl Iterator<Item = String>) -> Vec<String> {
    let mut sentences = sentences.map(|sentence| shortened(sentence, VIOLATION_BYTES_MAX));
    let mut kept: Vec<String> = sentences.by_ref().take(VIOLATIONS_MAX).collect();
    let more = sentences.count();
    if more > 0
        && let Some(last) = kept.last_mut()
    {
        *last = format!("and {} more", more + 1);
    }
    kept
}
