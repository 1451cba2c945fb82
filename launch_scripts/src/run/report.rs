//! What came of a run.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, anyhow};
use formation::model::{ModuleId, SpotId};
use formation::planner::Assignment;
use formation_report::Fact;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::conduct::Course;
use super::deaths::Deaths;
use crate::failure::Failure;
use crate::plan::{CheckedPlan, listed};
use crate::table::Table;

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
    unassigned: Vec<ModuleId>,
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
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
struct Taken {
    module: ModuleId,
    spot: SpotId,
}

impl Verdict {
    /// A spot that a dead module held is open. The verifier may have judged before it missed that module.
    fn leave_out(&mut self, deaths: &Deaths) {
        let dead = deaths.modules();
        self.unassigned.retain(|module| !dead.contains(module));
        if self.outcome == Outcome::Agreed {
            return;
        }
        let (lost, held): (Vec<Taken>, Vec<Taken>) = self
            .assignments
            .iter()
            .partition(|taken| dead.contains(&taken.module));
        self.assignments = held;
        for Taken { module, spot } in lost {
            self.filled_spots = self.filled_spots.saturating_sub(1);
            self.open_spots.push(spot);
            self.missing
                .push(format!("{spot} is open, as {module} died there"));
        }
        self.open_spots.sort_unstable();
    }
}

/// What was planned and what was seen.
pub struct RunReport {
    verdict: Verdict,
    differences: Vec<String>,
    /// Who has no spot, other than in the offline plan.
    left_out: Vec<ModuleId>,
    /// The processes that died on the way.
    deaths: Deaths,
    /// How many spots were to be filled, had nobody died.
    to_fill: usize,
    /// What took how many milliseconds.
    timings: Vec<(&'static str, u64)>,
    json: Value,
}

impl RunReport {
    /// Puts together the offline plan and what the verifier saw of the processes.
    ///
    /// What was seen outweighs what was planned; sums and counts are those of the plan, which hold for both as long
    /// as the two do not differ. What the verifier believes of modules that are dead is left out.
    ///
    /// # Errors
    /// The verdict cannot be read.
    pub fn new(plan: &CheckedPlan, verdict: &Value, course: &Course) -> Result<Self, Failure> {
        let deaths = course.deaths.clone();
        let mut seen = Verdict::deserialize(verdict)
            .context("the verifier's verdict cannot be read")
            .map_err(Failure::Failed)?;
        seen.leave_out(&deaths);
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
        if deaths.of_agents() > 0 {
            json["assignments"] = json!(seen.assignments);
            json["unassigned"] = json!(seen.unassigned);
            json["open_spots"] = json!(seen.open_spots);
            json["missing"] = json!(seen.missing);
        }
        json["dead"] = deaths.json();
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
            left_out: left_out(&plan.statistics.assignments, &seen.assignments),
            verdict: seen,
            deaths,
            to_fill: plan.statistics.assignments.len(),
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
        if self.verdict.outcome != Outcome::Failed {
            if self.differences.is_empty() {
                lines.push(plan.text(name));
            } else if self.somebody_died() {
                lines.push(self.placement_text());
            }
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
        lines.extend(self.deaths.iter().map(|death| format!("dead: {death}")));
        lines.push(self.outcome_text());
        lines.join("\n")
    }

    /// Who settled where, when that is not as planned.
    fn placement_text(&self) -> String {
        let mut table = Table::new(["module", "spot"]);
        for taken in &self.verdict.assignments {
            table.row([taken.module.0.to_string(), taken.spot.0.to_string()]);
        }
        let unassigned = &self.verdict.unassigned;
        if unassigned.is_empty() {
            return table.to_string();
        }
        let unassigned = listed("module", unassigned.iter().map(|module| module.0));
        format!("{table}\nwithout a spot: {unassigned}")
    }

    /// Whether others had to take the places of modules.
    fn somebody_died(&self) -> bool {
        self.deaths.of_agents() > 0
    }

    /// The verdict in one line.
    pub fn outcome_text(&self) -> String {
        let filled = self.verdict.filled_spots;
        let spots = filled + self.verdict.open_spots.len();
        match self.verdict.outcome {
            Outcome::Complete => format!("COMPLETE: all {spots} spots are filled, hole-free"),
            Outcome::Partial if filled < self.to_fill => {
                format!("PARTIAL: {filled} of {spots} spots are filled, as many as modules live")
            }
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
        let differences: &[String] = if self.somebody_died() {
            &[]
        } else {
            &self.differences
        };
        let differences = differences
            .iter()
            .map(|difference| format!("other than in the offline plan, {difference}"));
        verdict
            .violations
            .iter()
            .chain(&verdict.missing)
            .cloned()
            .chain(self.deaths.iter().map(ToString::to_string))
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
        if self.somebody_died() {
            // The offline plan is one for all; of it remains that its spots are to be filled.
            let missing = self.to_fill.saturating_sub(verdict.filled_spots);
            if verdict.outcome != Outcome::Agreed && missing > 0 {
                let open = verdict.open_spots.iter().map(|spot| spot.0);
                return Err(Failure::Failed(anyhow!(
                    "the formation has a hole: {} open; {} died, and no spare was left",
                    listed("spot", open),
                    self.deaths.modules_text()
                )));
            }
            return Ok(());
        }
        if !self.differences.is_empty() {
            let advice = if self.left_out.is_empty() {
                String::new()
            } else {
                format!(
                    "; who is not heard before the gathering ends is left out, as {} may have been: on a busy machine, \
                     host several modules in each process with --modules-per-process",
                    listed("module", self.left_out.iter().map(|module| module.0))
                )
            };
            return Err(Failure::Failed(anyhow!(
                "the processes formed another allocation than the offline plan: {}{advice}",
                self.differences.join("; ")
            )));
        }
        Ok(())
    }
}

/// Who was to get a spot and has none.
fn left_out(planned: &[Assignment], seen: &[Taken]) -> Vec<ModuleId> {
    let seated: BTreeSet<ModuleId> = seen.iter().map(|taken| taken.module).collect();
    planned
        .iter()
        .map(|assignment| assignment.module)
        .filter(|module| !seated.contains(module))
        .collect()
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
    use std::os::unix::process::ExitStatusExt;
    use std::process::ExitStatus;
    use std::time::Duration;

    use formation::model::Scenario;

    use super::super::deaths::Death;
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

    /// What is reported when this module died on the way.
    fn report_without(module: u32, verdict: &Value) -> RunReport {
        let mut course = Course::default();
        course.deaths.push(Death {
            name: format!("module_agent of module {module}"),
            modules: vec![ModuleId(module)],
            status: ExitStatus::from_raw(9),
            after: Duration::from_millis(5_230),
        });
        RunReport::new(&plan(), verdict, &course).unwrap()
    }

    #[test]
    fn others_may_take_the_places_of_the_dead() {
        let report = report_without(9, &verdict("COMPLETE", [2, 1]));
        assert!(report.conclusion().is_ok());
        assert_eq!(
            report.text(&plan(), "two"),
            "module  spot\n     7     2\n     8     1\nplanned in 12 ms, acted in 345 ms\n\
             dead: module_agent of module 9 ended with signal: 9 (SIGKILL) after 5.2 s\n\
             COMPLETE: all 2 spots are filled, hole-free"
        );
        assert_eq!(
            report.json()["dead"],
            json!([{
                "process": "module_agent of module 9",
                "modules": [9],
                "ended_with": "signal: 9 (SIGKILL)",
                "after_ms": 5_230,
            }])
        );
    }

    #[test]
    fn a_spot_that_a_dead_module_held_is_open() {
        let mut judged = verdict("FAILED", [1, 2]);
        judged["violations"] = json!([]);
        let report = report_without(8, &judged);
        let json = report.json();
        assert_eq!(json["assignments"], json!([{"module": 7, "spot": 1}]));
        assert_eq!(json["open_spots"], json!([2]));
        assert_eq!(
            report.conclusion().unwrap_err().to_string(),
            "the formation failed: spot 2 is open, as module 8 died there"
        );
        assert!(
            report
                .text(&plan(), "two")
                .ends_with("FAILED: 1 of 2 spots are filled")
        );
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
    fn who_was_left_out_is_named() {
        let mut verdict = verdict("AGREED", [1, 2]);
        verdict["assignments"] = json!([{"module": 8, "spot": 1}]);
        let report = RunReport::new(&plan(), &verdict, &Course::default()).unwrap();
        let failure = report.conclusion().unwrap_err().to_string();
        assert!(
            failure.contains("module 7 took no spot instead of spot 1"),
            "{failure}"
        );
        assert!(
            failure.contains("is left out, as module 7 may have been"),
            "{failure}"
        );
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
