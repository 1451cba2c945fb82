//! A verdict and the progress towards it, for programs and for people.

use std::collections::BTreeMap;
use std::fmt::{self, Display};
use std::time::Duration;

use formation::event_log::Entry;
use formation::model::{Epoch, ModuleId, SpotId};
use formation::verify::{Agreement, Outcome, Progress, Verdict};
use serde_json::{Value, json};

use crate::verification::End;
use ros_runtime::outcome::{STATUS_DONE, STATUS_FAILED};

/// What a verifier tells programs, one line each.
#[derive(Clone, Copy, Debug)]
pub enum JsonLine<'a> {
    /// `{"progress": ...}`
    Progress(&'a Progress),
    /// `{"entry": ...}`
    Entry(&'a Entry),
    /// `{"verdict": ...}` or `{"agreement": ...}`
    End(&'a End),
}

impl Display for JsonLine<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let object = match self {
            Self::Progress(progress) => json!({"progress": progress_json(progress)}),
            Self::Entry(entry) => json!({"entry": entry}),
            Self::End(End::Judged(verdict)) => json!({"verdict": verdict_json(verdict)}),
            Self::End(End::Agreed(agreement)) => json!({"agreement": agreement_json(agreement)}),
        };
        object.fmt(formatter)
    }
}

/// The progress as one JSON object.
#[must_use]
pub fn progress_json(progress: &Progress) -> Value {
    let mut object = json!({
        "phase": progress.stage.to_string(),
        "epoch": progress.epoch.as_ref().map(epoch_json),
        "joined": progress.joined,
        "planned": progress.planned,
        "agreed": progress.agreed,
        "settled": progress.settled,
        "to_fill": progress.to_fill,
        "waiting_for": ids(&progress.waiting_for),
    });
    if let Some(expected) = progress.expected {
        object["expected"] = expected.into();
    }
    object
}

/// The verdict as one JSON object; times are milliseconds since the verifier's start.
#[must_use]
pub fn verdict_json(verdict: &Verdict) -> Value {
    let timings = &verdict.timings;
    let counts = &verdict.counts;
    json!({
        "outcome": verdict.outcome.to_string(),
        "epoch": verdict.epoch.as_ref().map(epoch_json),
        "filled_spots": verdict.filled_spots,
        "assignments": assignments_json(&verdict.assignments),
        "unassigned": ids(&verdict.unassigned),
        "open_spots": verdict.open_spots.iter().map(|spot| spot.0).collect::<Vec<_>>(),
        "violations": sentences(&verdict.violations),
        "missing": sentences(&verdict.missing),
        "timings_ms": {
            "roster_known": timings.roster_known.map(milliseconds),
            "last_claim": timings.last_claim.map(milliseconds),
            "first_moving": timings.first_moving.map(milliseconds),
            "completed": timings.completed.map(milliseconds),
        },
        "planning_ms": between(timings.roster_known, timings.last_claim),
        "acting_ms": between(timings.first_moving, timings.completed),
        "counts": {
            "claims": counts.claims,
            "pairs": counts.pairs,
            "evictions": counts.evictions,
            "detached": counts.detached,
            "epochs": counts.epochs,
            "messages": counts.messages,
            "dropped": counts.dropped,
        },
    })
}

fn verdict_text(verdict: &Verdict) -> String {
    let filled = verdict.filled_spots;
    let spots = filled + verdict.open_spots.len();
    let mut text = match verdict.outcome {
        Outcome::Complete => format!("COMPLETE: hole-free, all {spots} spots are filled"),
        Outcome::Partial => format!(
            "PARTIAL: {filled} of {spots} spots are filled and connected, as many as there are modules; open: {}",
            listed(verdict.open_spots.iter().map(|spot| spot.0))
        ),
        Outcome::Failed if spots == 0 => "FAILED".to_owned(),
        Outcome::Failed => format!("FAILED: {filled} of {spots} spots are filled"),
    };
    if !verdict.unassigned.is_empty() {
        text.push_str("\nwithout a spot: modules ");
        text.push_str(&listed(verdict.unassigned.iter().map(|module| module.0)));
    }
    for sentence in sentences(&verdict.violations) {
        text.push_str("\nviolation: ");
        text.push_str(&sentence);
    }
    for sentence in sentences(&verdict.missing) {
        text.push_str("\nmissing: ");
        text.push_str(&sentence);
    }
    let timings = &verdict.timings;
    for (what, milliseconds) in [
        ("planned", between(timings.roster_known, timings.last_claim)),
        ("acted", between(timings.first_moving, timings.completed)),
    ] {
        if let Some(milliseconds) = milliseconds {
            text.push_str(&format!("\n{what} in {milliseconds} ms"));
        }
    }
    text
}

/// The agreement as one JSON object.
#[must_use]
pub fn agreement_json(agreement: &Agreement) -> Value {
    json!({
        "epoch": epoch_json(&agreement.epoch),
        "assignments": assignments_json(&agreement.assignments),
        "planning_ms": milliseconds(agreement.planning),
        "violations": sentences(&agreement.violations),
    })
}

/// How watching ended, in a few lines for people.
#[must_use]
pub fn end_text(end: &End) -> String {
    match end {
        End::Judged(verdict) => verdict_text(verdict),
        End::Agreed(agreement) => {
            let mut text = format!(
                "AGREED: all members hold the same plan of {}, which gives {} modules a spot\nplanned in {} ms",
                agreement.epoch,
                agreement.assignments.len(),
                milliseconds(agreement.planning)
            );
            for sentence in sentences(&agreement.violations) {
                text.push_str("\nviolation: ");
                text.push_str(&sentence);
            }
            text
        }
    }
}

/// The exit status that an end calls for.
#[must_use]
pub fn end_status(end: &End) -> u8 {
    let is_good = match end {
        End::Judged(verdict) => verdict.outcome != Outcome::Failed,
        End::Agreed(agreement) => agreement.violations.is_empty(),
    };
    if is_good { STATUS_DONE } else { STATUS_FAILED }
}

fn assignments_json(assignments: &BTreeMap<ModuleId, SpotId>) -> Value {
    assignments
        .iter()
        .map(|(module, spot)| json!({"module": module.0, "spot": spot.0}))
        .collect()
}

fn epoch_json(epoch: &Epoch) -> Value {
    json!({"number": epoch.number, "convener": epoch.convener.0})
}

fn ids(modules: &[ModuleId]) -> Vec<u32> {
    modules.iter().map(|module| module.0).collect()
}

fn sentences(entries: &[impl Display]) -> Vec<String> {
    entries.iter().map(ToString::to_string).collect()
}

fn listed(numbers: impl Iterator<Item = u32>) -> String {
    let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
    numbers.join(", ")
}

fn milliseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_millis()).unwrap_or(u64::MAX)
}

fn between(from: Option<Duration>, to: Option<Duration>) -> Option<u64> {
    Some(milliseconds(to?.saturating_sub(from?)))
}

#[cfg(test)]
mod tests {
    use formation::verify::{Counts, Missing, Timings, Violation};

    use super::*;

    fn failed() -> Verdict {
        Verdict {
            outcome: Outcome::Failed,
            epoch: Some(Epoch {
                number: 2,
                convener: ModuleId(1),
            }),
            filled_spots: 1,
            open_spots: vec![SpotId(2)],
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
        }
    }

    #[test]
    fn programs_read_one_line_of_json() {
        let line = JsonLine::End(&End::Judged(failed())).to_string();
        assert!(!line.contains('\n'));
        let verdict = &serde_json::from_str::<Value>(&line).unwrap()["verdict"];
        assert_eq!(verdict["outcome"], "FAILED");
        assert_eq!(verdict["assignments"], json!([{"module": 4, "spot": 1}]));
        assert_eq!(verdict["unassigned"], json!([5]));
        assert_eq!(verdict["missing"], json!(["spot 2 is empty"]));
        assert_eq!(verdict["planning_ms"], 25);
        assert_eq!(verdict["acting_ms"], Value::Null);
    }

    #[test]
    fn an_agreement_is_good_unless_a_promise_was_broken() {
        let mut agreement = Agreement {
            epoch: Epoch {
                number: 1,
                convener: ModuleId(1),
            },
            assignments: [(ModuleId(4), SpotId(1))].into(),
            planning: Duration::from_millis(25),
            violations: Vec::new(),
        };
        let end = End::Agreed(agreement.clone());
        assert_eq!(end_status(&end), STATUS_DONE);
        assert_eq!(
            serde_json::from_str::<Value>(&JsonLine::End(&end).to_string()).unwrap(),
            json!({"agreement": {
                "epoch": {"number": 1, "convener": 1},
                "assignments": [{"module": 4, "spot": 1}],
                "planning_ms": 25,
                "violations": [],
            }})
        );
        agreement.violations.push(Violation::MovedWithoutPlan {
            module: ModuleId(4),
        });
        let end = End::Agreed(agreement);
        assert_eq!(end_status(&end), STATUS_FAILED);
        assert!(end_text(&end).contains("\nviolation: module 4 "));
        assert_eq!(end_status(&End::Judged(failed())), STATUS_FAILED);
    }

    #[test]
    fn people_read_what_is_wrong() {
        let text = end_text(&End::Judged(failed()));
        assert_eq!(
            text,
            "FAILED: 1 of 2 spots are filled\nwithout a spot: modules 5\nmissing: spot 2 is empty\nplanned in 25 ms"
        );
    }

    #[test]
    fn an_unknown_number_of_modules_is_left_out() {
        let progress = |expected| Progress {
            stage: formation::model::FormationStage::Gathering,
            epoch: None,
            joined: 1,
            expected,
            planned: 0,
            agreed: 0,
            settled: 0,
            to_fill: 0,
            waiting_for: vec![ModuleId(7)],
        };
        assert_eq!(progress_json(&progress(Some(3)))["expected"], 3);
        assert!(progress_json(&progress(None)).get("expected").is_none());
        assert_eq!(progress_json(&progress(None))["waiting_for"], json!([7]));
    }
}
