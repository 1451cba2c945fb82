//! What came of a run.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, anyhow};
use formation::id::{ModuleId, SpotId};
use formation::statistics::Assignment;
use formation_report::Fact;
use serde::Deserialize;
use serde_json::{Value, json};

use super::conduct::Course;
use crate::failure::Failure;
use crate::plan::CheckedPlan;

/// More differences than these say nothing more.
const DIFFERENCES_MAX: usize = 8;

/// The verifier's judgement, as far as the launcher needs it.
#[derive(Clone, Debug, Deserialize)]
pub struct Verdict {
    outcome: Outcome,
    #[serde(default)]
    filled_spots: usize,
    assignments: Vec<Taken>,
    #[serde(default)]
    open_spots: Vec<SpotId>,
    violations: Vec<String>,
    #[serde(default)]
    missing: Vec<String>,
    planning_ms: Option<u64>,
    acting_ms: Option<u64>,
}

/// How the formation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Outcome {
    Complete,
    Partial,
    Failed,
    /// All hold one plan, and none was to move.
    Agreed,
}

/// Who settled where.
#[derive(Clone, Copy, Debug, Deserialize)]
struct Taken {
    module: ModuleId,
    spot: SpotId,
}

/// What was planned and what was seen.
pub struct RunReport {
    verdict: Verdict,
    differences: Vec<String>,
    /// What took how many milliseconds.
    timings: Vec<(&'static str, u64)>,
    json: Value,
}

impl RunReport {
    /// Puts together the offline plan and what the verifier saw of the processes.
    ///
    /// What was seen outweighs what was planned; sums and counts are those of the plan, which hold for both as long
    /// as the two do not differ.
    ///
    /// # Errors
    /// The verdict cannot be read.
    pub fn new(plan: &CheckedPlan, verdict: &Value, course: &Course) -> Result<Self, Failure> {
        let seen = Verdict::deserialize(verdict)
            .context("the verifier's verdict cannot be read")
            .map_err(Failure::Failed)?;
        let mut json = serde_json::to_value(plan.report())
            .context("cannot put the report together")
            .map_err(Failure::Failed)?;
        for key in [
            "assignments",
            "unassigned",
            "open_spots",
            "violations",
            "missing",
            "planning_ms",
            "acting_ms",
        ] {
            // Where modules only agree, the plan itself says what would be left over.
            if !verdict[key].is_null() || json[key].is_null() {
                json[key] = verdict[key].clone();
            }
        }
        let discovery_ms = course
            .discovery
            .map(|time| u64::try_from(time.as_millis()).unwrap_or(u64::MAX));
        json["verdict"] = verdict["outcome"].clone();
        json["discovery_ms"] = json!(discovery_ms);
        let timings = [
            ("joined", discovery_ms),
            ("planned", seen.planning_ms),
            ("acted", seen.acting_ms),
        ]
        .into_iter()
        .filter_map(|(what, time)| Some((what, time?)))
        .collect();
        Ok(Self {
            differences: differences(&plan.statistics.assignments, &seen.assignments),
            verdict: seen,
            timings,
            json,
        })
    }

    /// The object that `--json` prints.
    pub fn json(&self) -> &Value {
        &self.json
    }

    /// What people get to read; the verdict comes last.
    pub fn text(&self, plan: &CheckedPlan, name: &str) -> String {
        let mut lines = Vec::new();
        if self.verdict.outcome != Outcome::Failed && self.differences.is_empty() {
            lines.push(plan.text(name));
        }
        let timings: Vec<String> = self
            .timings
            .iter()
            .map(|(what, time)| format!("{what} in {time} ms"))
            .collect();
        if !timings.is_empty() {
            lines.push(timings.join(", "));
        }
        for (what, sentences) in [
            ("violation", &self.verdict.violations),
            ("missing", &self.verdict.missing),
        ] {
            lines.extend(
                sentences
                    .iter()
                    .map(|sentence| format!("{what}: {sentence}")),
            );
        }
        lines.push(self.outcome_text());
        lines.join("\n")
    }

    /// The verdict in one line.
    pub fn outcome_text(&self) -> String {
        let filled = self.verdict.filled_spots;
        let spots = filled + self.verdict.open_spots.len();
        match self.verdict.outcome {
            Outcome::Complete => format!("COMPLETE: all {spots} spots are filled, hole-free"),
            Outcome::Partial => format!(
                "PARTIAL: {filled} of {spots} spots are filled, as many as there are modules, hole-free"
            ),
            Outcome::Agreed => "AGREED: all modules hold the same plan; none has moved".to_owned(),
            Outcome::Failed => format!("FAILED: {filled} of {spots} spots are filled"),
        }
    }

    /// Whether the modules were only to agree.
    pub fn nothing_moved(&self) -> bool {
        self.verdict.outcome == Outcome::Agreed
    }

    /// Who settled where, as the verifier saw it.
    pub fn assignments(&self) -> impl Iterator<Item = (ModuleId, SpotId)> + '_ {
        let taken = self.verdict.assignments.iter();
        taken.map(|taken| (taken.module, taken.spot))
    }

    /// How long everything took.
    pub fn facts(&self) -> Vec<Fact> {
        let name = |what| match what {
            "joined" => "all joined after",
            "planned" => "from the roster to the last claim",
            _ => "from the first motion to the end",
        };
        self.timings
            .iter()
            .map(|&(what, time)| Fact::new(name(what), format!("{time} ms")))
            .collect()
    }

    /// All that is wrong, one sentence each.
    pub fn reproaches(&self) -> impl Iterator<Item = String> + '_ {
        let verdict = &self.verdict;
        let differences = self
            .differences
            .iter()
            .map(|difference| format!("other than in the offline plan, {difference}"));
        verdict
            .violations
            .iter()
            .chain(&verdict.missing)
            .cloned()
            .chain(differences)
    }

    /// Whether all is well.
    ///
    /// # Errors
    /// Says what is wrong with the formation.
    pub fn conclusion(&self) -> Result<(), Failure> {
        let verdict = &self.verdict;
        let broken = verdict.outcome == Outcome::Agreed && !verdict.violations.is_empty();
        if verdict.outcome == Outcome::Failed || broken {
            let reasons: Vec<&str> = verdict
                .violations
                .iter()
                .chain(&verdict.missing)
                .map(String::as_str)
                .collect();
            return Err(Failure::Failed(anyhow!(
                "the formation failed: {}",
                reasons.join("; ")
            )));
        }
        if !self.differences.is_empty() {
            return Err(Failure::Failed(anyhow!(
                "the processes formed another allocation than the offline plan: {}",
                self.differences.join("; ")
            )));
        }
        Ok(())
    }
}

/// Where what was seen differs from what was planned.
fn differences(planned: &[Assignment], seen: &[Taken]) -> Vec<String> {
    let planned: BTreeMap<ModuleId, SpotId> = planned
        .iter()
        .map(|assignment| (assignment.module, assignment.spot))
        .collect();
    let seen: BTreeMap<ModuleId, SpotId> = seen
        .iter()
        .map(|taken| (taken.module, taken.spot))
        .collect();
    let or_none = |spot: Option<&SpotId>| spot.map_or("no spot".to_owned(), ToString::to_string);
    let modules: BTreeSet<&ModuleId> = planned.keys().chain(seen.keys()).collect();
    let mut differences: Vec<String> = modules
        .into_iter()
        .filter(|module| planned.get(module) != seen.get(module))
        .map(|module| {
            format!(
                "{module} took {} instead of {}",
                or_none(seen.get(module)),
                or_none(planned.get(module))
            )
        })
        .collect();
    if differences.len() > DIFFERENCES_MAX {
        let more = differences.len() - DIFFERENCES_MAX;
        differences.truncate(DIFFERENCES_MAX);
        differences.push(format!("and {more} more"));
    }
    differences
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use formation::scenario::Scenario;

    use super::*;

    fn plan() -> CheckedPlan {
        let scenario = Scenario::from_yaml(
            "
target: {spots: [{id: 1, x: 0.0, y: 0.0}, {id: 2, x: 1.0, y: 0.0}], edges: [[1, 2]]}
singletons: [{id: 7, x: 0.0, y: 1.0}, {id: 8, x: 1.0, y: 1.0}]
",
        )
        .unwrap();
        CheckedPlan::of(&scenario).unwrap()
    }

    fn verdict(outcome: &str, spots: [u32; 2]) -> Value {
        json!({
            "outcome": outcome,
            "filled_spots": 2,
            "assignments": [{"module": 7, "spot": spots[0]}, {"module": 8, "spot": spots[1]}],
            "unassigned": [],
            "open_spots": [],
            "violations": if outcome == "FAILED" { vec!["module 7 moved too early"] } else { Vec::new() },
            "missing": [],
            "planning_ms": 12,
            "acting_ms": 345,
            "counts": {"claims": 2},
        })
    }

    fn report(outcome: &str, spots: [u32; 2]) -> RunReport {
        let course = Course {
            discovery: Some(Duration::from_millis(1_500)),
            ..Course::default()
        };
        RunReport::new(&plan(), &verdict(outcome, spots), &course).unwrap()
    }

    #[test]
    fn a_complete_formation_ends_with_hole_free() {
        let report = report("COMPLETE", [1, 2]);
        assert!(report.conclusion().is_ok());
        let text = report.text(&plan(), "two");
        assert!(
            text.ends_with("\nCOMPLETE: all 2 spots are filled, hole-free"),
            "{text}"
        );
        assert!(
            text.contains("joined in 1500 ms, planned in 12 ms, acted in 345 ms"),
            "{text}"
        );
        let json = report.json();
        assert_eq!(json["verdict"], "COMPLETE");
        assert_eq!(json["discovery_ms"], 1_500);
        assert_eq!(json["planning_ms"], 12);
        assert_eq!(json["acting_ms"], 345);
        assert_eq!(json["assignments"][1], json!({"module": 8, "spot": 2}));
        assert!(json["planning_us"].is_u64());
    }

    #[test]
    fn another_allocation_than_planned_is_found_wrong() {
        let report = report("COMPLETE", [2, 1]);
        let failure = report.conclusion().unwrap_err();
        assert_eq!(
            failure.to_string(),
            "the processes formed another allocation than the offline plan: module 7 took spot 2 instead of spot 1; \
             module 8 took spot 1 instead of spot 2"
        );
        assert_eq!(report.json()["assignments"][0]["spot"], 2);
    }

    #[test]
    fn a_failed_formation_says_why() {
        let report = report("FAILED", [1, 2]);
        assert_eq!(
            report.conclusion().unwrap_err().to_string(),
            "the formation failed: module 7 moved too early"
        );
        let text = report.text(&plan(), "two");
        assert!(
            text.contains("violation: module 7 moved too early"),
            "{text}"
        );
    }

    #[test]
    fn a_verdict_that_cannot_be_read_is_an_error() {
        let odd = json!({"outcome": "SPLENDID"});
        assert!(RunReport::new(&plan(), &odd, &Course::default()).is_err());
    }
}
