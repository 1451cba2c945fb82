//! What a verifier prints for programs: one JSON object a line. The launcher reads the same types.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use formation_event_log::{Entry, milliseconds};
use formation_model::text::joined;
use formation_model::{Assignment, BlockedSpot, Epoch, ModuleId, SpotId};
use formation_verify::{Agreement, Counts, Outcome, Progress, Timings, Verdict};

/// One line: an object with one key, which says what the line is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(
    clippy::large_enum_variant,
    reason = "one line at a time exists, so its size does not matter"
)]
pub enum ReportLine {
    /// The progress, whenever it changes.
    Progress(Progress),
    /// Something that happened, where the verifier was asked for the event log.
    Entry(Entry),
    /// The judgement.
    Verdict(VerdictReport),
    /// The plan on which all members agree, where the verifier was asked for no more.
    Agreement(AgreementReport),
}

/// A [`Verdict`] for programs. Durations are milliseconds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct VerdictReport {
    /// How the formation ended.
    pub outcome: Outcome,
    /// The epoch whose end state was judged.
    pub epoch: Option<Epoch>,
    /// How many spots are filled by a settled module.
    pub filled_spots: usize,
    /// Which module settled on which spot, by module.
    pub assignments: Vec<Assignment>,
    /// The modules that are on no spot, ascending.
    pub unassigned: Vec<ModuleId>,
    /// The spots that are not filled, ascending.
    pub open_spots: Vec<SpotId>,
    /// The spots that bodies block, and the modules of these bodies, ascending by spot.
    #[serde(default)]
    pub blocked_spots: Vec<BlockedSpot>,
    /// What was done wrong, one sentence each.
    pub violations: Vec<String>,
    /// What was not done in time, one sentence each.
    pub missing: Vec<String>,
    /// When the epoch's parts were reached, since the verifier's start.
    pub timings_ms: TimingsReport,
    /// From the roster to the last claim.
    pub planning_ms: Option<u64>,
    /// From the first motion to the end state.
    pub acting_ms: Option<u64>,
    /// How many messages of each kind were received.
    pub counts: Counts,
    /// Whether no bodies overlapped, and that was judged of all modules.
    #[serde(default = "yes")]
    pub collision_free: bool,
    /// Why they were not free of collisions.
    #[serde(default)]
    pub collision_reason: Option<String>,
    /// The modules of which it is not known whether they touched others, as their poses are not exact enough, and for how long.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_judged: Vec<Unjudged>,
}

/// A module of which it is not known whether it touched others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unjudged {
    /// The module.
    pub module: ModuleId,
    /// For how long, in milliseconds.
    pub ms: u64,
}

impl Display for Unjudged {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let tenths = self.ms.div_ceil(100);
        write!(
            formatter,
            "{}, {}.{} s",
            self.module,
            tenths / 10,
            tenths % 10
        )
    }
}

/// The modules that were not judged, in brackets.
#[must_use]
pub fn unjudged_text(not_judged: &[Unjudged]) -> String {
    format!("({})", joined(not_judged, "; "))
}

fn yes() -> bool {
    true
}

/// [`Timings`] in milliseconds since the verifier's start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TimingsReport {
    /// The judged epoch's roster arrived.
    pub roster_known: Option<u64>,
    /// The last of its claims arrived.
    pub last_claim: Option<u64>,
    /// Its first unit reported that it moves.
    pub first_moving: Option<u64>,
    /// The end state was reached.
    pub completed: Option<u64>,
}

/// An [`Agreement`] for programs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AgreementReport {
    /// The epoch.
    pub epoch: Epoch,
    /// Which module is to take which spot, by module.
    pub assignments: Vec<Assignment>,
    /// From the roster to the last claim, in milliseconds.
    pub planning_ms: u64,
    /// What was done wrong, one sentence each.
    pub violations: Vec<String>,
}

impl From<&Verdict> for VerdictReport {
    fn from(verdict: &Verdict) -> Self {
        let timings = &verdict.timings;
        Self {
            outcome: verdict.outcome,
            epoch: verdict.epoch,
            filled_spots: verdict.filled_spots,
            assignments: by_module(&verdict.assignments),
            unassigned: verdict.unassigned.clone(),
            open_spots: verdict.open_spots.clone(),
            blocked_spots: verdict.blocked_spots.clone(),
            violations: sentences(&verdict.violations),
            missing: sentences(&verdict.missing),
            planning_ms: between(timings.roster_known, timings.last_claim),
            acting_ms: between(timings.first_moving, timings.completed),
            timings_ms: timings.into(),
            counts: verdict.counts,
            collision_free: verdict.collision_risk.is_none() && verdict.unjudged.is_empty(),
            collision_reason: verdict.collision_risk.map(|risk| risk.to_string()),
            not_judged: unjudged(verdict),
        }
    }
}

/// The modules that a verdict leaves unjudged.
#[must_use]
pub fn unjudged(verdict: &Verdict) -> Vec<Unjudged> {
    let unjudged = verdict.unjudged.iter();
    unjudged
        .map(|(&module, &time)| Unjudged {
            module,
            ms: milliseconds(time),
        })
        .collect()
}

impl From<&Timings> for TimingsReport {
    fn from(timings: &Timings) -> Self {
        Self {
            roster_known: timings.roster_known.map(milliseconds),
            last_claim: timings.last_claim.map(milliseconds),
            first_moving: timings.first_moving.map(milliseconds),
            completed: timings.completed.map(milliseconds),
        }
    }
}

impl From<&Agreement> for AgreementReport {
    fn from(agreement: &Agreement) -> Self {
        Self {
            epoch: agreement.epoch,
            assignments: by_module(&agreement.assignments),
            planning_ms: milliseconds(agreement.planning),
            violations: sentences(&agreement.violations),
        }
    }
}

/// What is said of a formation whose modules may have run into each other.
pub const NOT_COLLISION_FREE: &str = "not collision-free";

/// The outcome in one line, with the numbers of filled spots, of all spots, and of those that bodies block.
#[must_use]
pub fn outcome_text(outcome: Outcome, filled: usize, spots: usize, blocked: usize) -> String {
    match outcome {
        Outcome::Complete => format!("COMPLETE: all {spots} spots are filled, hole-free"),
        Outcome::Partial if blocked > 0 => format!(
            "PARTIAL: {filled} of {spots} spots are filled, as many connected ones as bodies leave open, hole-free"
        ),
        Outcome::Partial => format!(
            "PARTIAL: {filled} of {spots} spots are filled, as many as there are modules, hole-free"
        ),
        Outcome::NotJudged => format!(
            "NOT_JUDGED: {filled} of {spots} spots are filled, and bodies overlapped by less than the tolerances of their poses"
        ),
        Outcome::Failed if spots == 0 => "FAILED".to_owned(),
        Outcome::Failed => format!("FAILED: {filled} of {spots} spots are filled"),
    }
}

fn by_module(assignments: &BTreeMap<ModuleId, SpotId>) -> Vec<Assignment> {
    let pairs = assignments.iter();
    pairs
        .map(|(&module, &spot)| Assignment { module, spot })
        .collect()
}

fn sentences(entries: &[impl Display]) -> Vec<String> {
    entries.iter().map(ToString::to_string).collect()
}

fn between(from: Option<Duration>, to: Option<Duration>) -> Option<u64> {
    Some(milliseconds(to?.saturating_sub(from?)))
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use formation_model::FormationStage;
    use formation_verify::{CollisionRisk, Missing};

    const EPOCH: Epoch = Epoch {
        number: 2,
        convener: ModuleId(1),
    };

    /// What a program reads; the line is read back as what was written.
    fn read(line: &ReportLine) -> Value {
        let text = serde_json::to_string(line).unwrap();
        assert!(!text.contains('\n'));
        assert_eq!(serde_json::from_str::<ReportLine>(&text).unwrap(), *line);
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn a_verdict_is_one_object() {
        let verdict = Verdict {
            outcome: Outcome::Failed,
            epoch: Some(EPOCH),
            filled_spots: 1,
            open_spots: vec![SpotId(2)],
            blocked_spots: vec![BlockedSpot {
                spot: SpotId(2),
                module: ModuleId(9),
            }],
            assignments: [(ModuleId(4), SpotId(1))].into(),
            unassigned: vec![ModuleId(5)],
            violations: Vec::new(),
            missing: vec![Missing::Spot { spot: SpotId(2) }],
            timings: Timings {
                roster_known: Some(Duration::from_millis(700)),
                last_claim: Some(Duration::from_millis(725)),
                ..Timings::default()
            },
            counts: Counts::default(),
            collision_risk: Some(CollisionRisk {
                epoch: EPOCH,
                first: ModuleId(4),
                second: ModuleId(5),
            }),
            unjudged: BTreeMap::new(),
        };
        assert_eq!(
            read(&ReportLine::Verdict((&verdict).into())),
            json!({"verdict": {
                "outcome": "FAILED",
                "epoch": {"number": 2, "convener": 1},
                "filled_spots": 1,
                "assignments": [{"module": 4, "spot": 1}],
                "unassigned": [5],
                "open_spots": [2],
                "blocked_spots": [{"spot": 2, "module": 9}],
                "violations": [],
                "missing": ["spot 2 is empty"],
                "timings_ms": {"roster_known": 700, "last_claim": 725, "first_moving": null, "completed": null},
                "planning_ms": 25,
                "acting_ms": null,
                "counts": {
                    "claims": 0, "pairs": 0, "evictions": 0, "detached": 0, "epochs": 0, "messages": 0, "dropped": 0,
                    "segments": 0, "missed_states": 0, "unproven": 0,
                },
                "collision_free": false,
                "collision_reason": "module 4 and module 5 overlapped in epoch 2.1",
            }})
        );
    }

    #[test]
    fn what_was_not_judged_names_modules_and_times() {
        let unjudged = |module, ms| Unjudged {
            module: ModuleId(module),
            ms,
        };
        let text = unjudged_text(&[unjudged(3, 4_150), unjudged(7, 90)]);
        assert_eq!(text, "(module 3, 4.2 s; module 7, 0.1 s)");
    }

    #[test]
    fn an_agreement_is_one_object() {
        let agreement = Agreement {
            epoch: EPOCH,
            assignments: [(ModuleId(4), SpotId(1))].into(),
            planning: Duration::from_millis(25),
            violations: Vec::new(),
        };
        assert_eq!(
            read(&ReportLine::Agreement((&agreement).into())),
            json!({"agreement": {
                "epoch": {"number": 2, "convener": 1},
                "assignments": [{"module": 4, "spot": 1}],
                "planning_ms": 25,
                "violations": [],
            }})
        );
    }

    #[test]
    fn progress_leaves_out_an_unknown_number_of_modules() {
        let progress = |expected| {
            ReportLine::Progress(Progress {
                stage: FormationStage::WaitingForTarget,
                epoch: None,
                joined: 1,
                expected,
                planned: 0,
                agreed: 0,
                settled: 0,
                to_fill: 0,
                stopped: false,
                waiting_for: vec![ModuleId(7)],
            })
        };
        assert_eq!(
            read(&progress(None)),
            json!({"progress": {
                "phase": "waiting for a target",
                "epoch": null,
                "joined": 1,
                "planned": 0,
                "agreed": 0,
                "settled": 0,
                "to_fill": 0,
                "waiting_for": [7],
            }})
        );
        assert_eq!(read(&progress(Some(3)))["progress"]["expected"], 3);
    }
}
