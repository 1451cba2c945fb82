//! The end of the observation, for programs and for people.

use formation_model::text::listed_in_full;
use formation_verifier_lines::{
    AgreementReport, NOT_COLLISION_FREE, ReportLine, VerdictReport, outcome_text, unjudged_text,
};
use formation_verify::Outcome;
use ros_runtime::exit::{STATUS_DONE, STATUS_FAILED, STATUS_NOT_JUDGED};

use crate::verification::End;

/// The final line for programs, as JSON.
#[must_use]
pub fn end_line(end: &End) -> ReportLine {
    match end {
        End::Judged(verdict) => ReportLine::Verdict(verdict.into()),
        End::Agreed(agreement) => ReportLine::Agreement(agreement.into()),
    }
}

/// The end in a few lines for people.
#[must_use]
pub fn end_text(end: &End) -> String {
    match end {
        End::Judged(verdict) => verdict_text(&verdict.into()),
        End::Agreed(agreement) => agreement_text(&agreement.into()),
    }
}

fn verdict_text(verdict: &VerdictReport) -> String {
    let mut lines = vec![outcome_text(
        verdict.outcome,
        verdict.filled_spots,
        verdict.filled_spots + verdict.open_spots.len(),
        verdict.blocked_spots.len(),
    )];
    if verdict.outcome == Outcome::NotJudged {
        let unjudged = unjudged_text(&verdict.not_judged);
        lines.insert(0, format!("NOT_JUDGED {unjudged}"));
    }
    if verdict.outcome == Outcome::Partial {
        let open = listed_in_full(verdict.open_spots.iter().copied());
        lines.push(format!("left open: {open}"));
    }
    let blocked = verdict.blocked_spots.iter();
    lines.extend(blocked.map(|blocked| format!("blocked: {blocked}")));
    if !verdict.unassigned.is_empty() {
        let unassigned = listed_in_full(verdict.unassigned.iter().copied());
        lines.push(format!("without a spot: {unassigned}"));
    }
    let reason = verdict.collision_reason.iter();
    lines.extend(reason.map(|reason| format!("{NOT_COLLISION_FREE}: {reason}")));
    lines.extend(violations(&verdict.violations));
    let missing = verdict.missing.iter();
    lines.extend(missing.map(|sentence| format!("missing: {sentence}")));
    let timings = [
        ("planned", verdict.planning_ms),
        ("acted", verdict.acting_ms),
    ];
    lines.extend(
        timings
            .into_iter()
            .filter_map(|(what, time)| Some(format!("{what} in {} ms", time?))),
    );
    lines.join("\n")
}

fn agreement_text(agreement: &AgreementReport) -> String {
    let mut lines = vec![format!(
        "AGREED: all members hold the same plan of {}, which gives {} modules a spot\nplanned in {} ms",
        agreement.epoch,
        agreement.assignments.len(),
        agreement.planning_ms
    )];
    lines.extend(violations(&agreement.violations));
    lines.join("\n")
}

fn violations(sentences: &[String]) -> impl Iterator<Item = String> + '_ {
    let sentences = sentences.iter();
    sentences.map(|sentence| format!("violation: {sentence}"))
}

/// The exit status of an end.
#[must_use]
pub fn end_status(end: &End) -> u8 {
    let is_good = match end {
        End::Judged(verdict) if verdict.outcome == Outcome::NotJudged => return STATUS_NOT_JUDGED,
        End::Judged(verdict) => verdict.outcome != Outcome::Failed,
        End::Agreed(agreement) => agreement.violations.is_empty(),
    };
    if is_good { STATUS_DONE } else { STATUS_FAILED }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use formation_model::{Epoch, ModuleId, SpotId};
    use formation_verify::{Agreement, Counts, Missing, Timings, Verdict, Violation};

    use super::*;

    fn failed() -> Verdict {
        Verdict {
            outcome: Outcome::Failed,
            epoch: None,
            filled_spots: 1,
            open_spots: vec![SpotId(2)],
            blocked_spots: Vec::new(),
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
            collision_risk: None,
            unjudged: std::collections::BTreeMap::new(),
        }
    }

    #[test]
    fn an_agreement_is_good_without_violations() {
        let mut agreement = Agreement {
            epoch: Epoch {
                number: 1,
                convener: ModuleId(1),
            },
            assignments: [(ModuleId(4), SpotId(1))].into(),
            planning: Duration::from_millis(25),
            violations: Vec::new(),
        };
        assert_eq!(end_status(&End::Agreed(agreement.clone())), STATUS_DONE);
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
        let mut verdict = failed();
        assert_eq!(
            end_text(&End::Judged(verdict.clone())),
            "FAILED: 1 of 2 spots are filled\nwithout a spot: module 5\nmissing: spot 2 is empty\nplanned in 25 ms"
        );
        verdict.outcome = Outcome::Partial;
        let text = end_text(&End::Judged(verdict));
        assert!(text.contains("hole-free\nleft open: spot 2\n"), "{text}");
    }
}
