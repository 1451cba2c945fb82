//! The result of a run.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use anyhow::anyhow;
use formation::event_log::milliseconds;
use formation::model::text::listed_in_full;
use formation::model::{Assignment, Epoch, ModuleId, SpotId};
use formation::verify::{Outcome, outcome_text};
use formation_report::Fact;
use ros_runtime::exit::Failure;
use serde::{Serialize, Serializer};

use super::roles::Deaths;
use super::run_loop::{Judgement, Observed};
use crate::checked_plan::{CheckedPlan, PlanReport};
use crate::table::aligned;

/// More differences from the plan are counted only.
const DIFFERENCES_MAX: usize = 8;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum RunOutcome {
    /// With a verdict on the formation.
    Judged(Outcome),
    /// All modules hold one plan, and none was to move.
    #[serde(serialize_with = "agreed")]
    Agreed,
}

fn agreed<S: Serializer>(serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str("AGREED")
}

/// The plan and what the verifier observed, as `formation run --json` prints it.
///
/// Sums and counts are those of the offline plan, which hold for the run too unless the two differ.
#[derive(Debug, Serialize)]
pub struct RunReport {
    verdict: RunOutcome,
    /// The assignments, the modules without a spot and the open spots are those that the verifier observed.
    #[serde(flatten)]
    plan: PlanReport,
    violations: Vec<String>,
    /// `None` where modules only agree.
    missing: Option<Vec<String>>,
    discovery_ms: Option<u64>,
    planning_ms: Option<u64>,
    acting_ms: Option<u64>,
    dead: Deaths,
    #[serde(flatten)]
    participation: Participation,
    /// The time limit, if the run ended because the time was up.
    #[serde(rename = "timed_out", serialize_with = "is_some")]
    time_limit: Option<Duration>,
    #[serde(skip)]
    filled_spots: usize,
    #[serde(skip)]
    planned: Vec<Assignment>,
}

fn is_some<S: Serializer>(limit: &Option<Duration>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bool(limit.is_some())
}

/// How the final roster relates to the modules and the poses of the scenario.
#[derive(Debug, Default, Serialize)]
struct Participation {
    /// Whether the roster is another than the one that the offline plan is for, so that the two plans may differ.
    replanned: bool,
    /// Members that took no spot, because they were retired or their motion failed.
    out_of_service: Vec<ModuleId>,
    /// Modules that are no members, although their processes run.
    left_out: Vec<ModuleId>,
}

impl Participation {
    fn new(plan: &CheckedPlan, epoch: Option<Epoch>, observed: &Observed) -> Self {
        let dead = observed.deaths.modules();
        let Some(roster) = epoch.and_then(|epoch| observed.recording.roster(epoch)) else {
            return Self::default();
        };
        let all = plan.problem.modules().iter().map(|module| module.id);
        Self {
            replanned: roster.problem != Some(plan.problem.digest()),
            out_of_service: roster.out_of_service.to_vec(),
            left_out: all
                .filter(|module| !dead.contains(module) && !roster.modules.contains(module))
                .collect(),
        }
    }
}

impl RunReport {
    /// Combines the offline plan, the verifier's judgement and what the launcher observed of a run with this time limit.
    pub fn new(
        plan: &CheckedPlan,
        judgement: Judgement,
        observed: &Observed,
        time_limit: Duration,
    ) -> Self {
        // The verifier names what is missing when its time is up.
        let (epoch, is_late) = match &judgement {
            Judgement::Verdict(verdict) => (
                verdict.epoch,
                verdict.outcome == Outcome::Failed && !verdict.missing.is_empty(),
            ),
            Judgement::Agreement(agreement) => (Some(agreement.epoch), false),
        };
        let mut report = Self {
            verdict: RunOutcome::Agreed,
            planned: plan.statistics.assignments.clone(),
            plan: plan.report(),
            violations: Vec::new(),
            missing: None,
            discovery_ms: observed.discovery.map(milliseconds),
            planning_ms: None,
            acting_ms: None,
            dead: observed.deaths.clone(),
            participation: Participation::new(plan, epoch, observed),
            time_limit: (is_late || observed.timed_out).then_some(time_limit),
            filled_spots: 0,
        };
        let statistics = &mut report.plan.statistics;
        match judgement {
            Judgement::Verdict(verdict) => {
                report.verdict = RunOutcome::Judged(verdict.outcome);
                report.filled_spots = verdict.filled_spots;
                statistics.assignments = verdict.assignments;
                statistics.unassigned = verdict.unassigned;
                statistics.open_spots = verdict.open_spots;
                report.violations = verdict.violations;
                report.missing = Some(verdict.missing);
                report.planning_ms = verdict.planning_ms;
                report.acting_ms = verdict.acting_ms;
            }
            Judgement::Agreement(agreement) => {
                statistics.assignments = agreement.assignments;
                report.violations = agreement.violations;
                report.planning_ms = Some(agreement.planning_ms);
            }
        }
        report.leave_out_the_dead();
        report
    }

    /// A spot that a dead module held is open. The verifier may have judged before it found the module silent.
    fn leave_out_the_dead(&mut self) {
        let dead = self.dead.modules();
        let statistics = &mut self.plan.statistics;
        statistics
            .unassigned
            .retain(|module| !dead.contains(module));
        let Some(missing) = &mut self.missing else {
            return;
        };
        let (lost, held): (Vec<Assignment>, Vec<Assignment>) = statistics
            .assignments
            .iter()
            .partition(|assignment| dead.contains(&assignment.module));
        statistics.assignments = held;
        for Assignment { module, spot } in lost {
            self.filled_spots = self.filled_spots.saturating_sub(1);
            statistics.open_spots.push(spot);
            missing.push(format!("{spot} is open, as {module} died there"));
        }
        statistics.open_spots.sort_unstable();
    }

    /// How the run ended.
    pub fn outcome(&self) -> RunOutcome {
        self.verdict
    }

    /// Which module settled on which spot, or is to take it.
    pub fn assignments(&self) -> &[Assignment] {
        &self.plan.statistics.assignments
    }

    /// The text for people; the verdict comes last.
    pub fn text(&self, plan: &CheckedPlan, name: &str) -> String {
        let mut lines = Vec::new();
        if self.verdict != RunOutcome::Judged(Outcome::Failed) {
            if self.differences().is_empty() {
                lines.push(plan.text(name));
            } else if self.may_differ() {
                lines.push(self.placement_text());
            }
        }
        let timings: Vec<String> = [
            ("joined", self.discovery_ms),
            ("planned", self.planning_ms),
            ("acted", self.acting_ms),
        ]
        .into_iter()
        .filter_map(|(what, time)| Some(format!("{what} in {} ms", time?)))
        .collect();
        if !timings.is_empty() {
            lines.push(timings.join(", "));
        }
        let violations = self.violations.iter();
        lines.extend(violations.map(|sentence| format!("violation: {sentence}")));
        lines.extend(self.time_was_up());
        let missing = self.missing.iter().flatten();
        lines.extend(missing.map(|sentence| format!("missing: {sentence}")));
        lines.extend(self.dead.iter().map(|death| format!("dead: {death}")));
        lines.push(self.outcome_text());
        lines.join("\n")
    }

    /// Which module settled where, for a run that differs from the plan.
    fn placement_text(&self) -> String {
        let row = |taken: &Assignment| [taken.module.0.to_string(), taken.spot.0.to_string()];
        let table = aligned(["module", "spot"], self.assignments().iter().map(row));
        match self.plan.statistics.unassigned.as_slice() {
            [] => table,
            unassigned => {
                let unassigned = listed_in_full(unassigned.iter().copied());
                format!("{table}\nwithout a spot: {unassigned}")
            }
        }
    }

    /// The verdict in one line.
    pub fn outcome_text(&self) -> String {
        let filled = self.filled_spots;
        let spots = filled + self.plan.statistics.open_spots.len();
        match self.verdict {
            RunOutcome::Judged(Outcome::Partial) if filled < self.planned.len() => {
                let absences = self.absences();
                let by = match absences.is_empty() {
                    true => ", one by each living module".to_owned(),
                    false => format!("; {}", absences.join(", ")),
                };
                format!("PARTIAL: {filled} of {spots} spots are filled{by}")
            }
            RunOutcome::Judged(outcome) => outcome_text(outcome, filled, spots),
            RunOutcome::Agreed => {
                "AGREED: all modules hold the same plan; none has moved".to_owned()
            }
        }
    }

    /// The durations of the parts of the run.
    pub fn facts(&self) -> Vec<Fact> {
        [
            ("all joined after", self.discovery_ms),
            ("from the roster to the last claim", self.planning_ms),
            ("from the first motion to the end", self.acting_ms),
        ]
        .into_iter()
        .filter_map(|(what, time)| Some(Fact::new(what, format!("{} ms", time?))))
        .collect()
    }

    /// All that is wrong, one sentence each.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = self.violations.clone();
        faults.extend(self.time_was_up());
        faults.extend(self.missing.iter().flatten().cloned());
        faults.extend(self.dead.iter().map(ToString::to_string));
        faults.extend(self.absences());
        if !self.may_differ() {
            let differences = self.differences().into_iter();
            faults.extend(
                differences.map(|difference| format!("unlike in the offline plan, {difference}")),
            );
        }
        faults
    }

    /// Whether a plan that differs from the offline plan may be right: it was made for another roster.
    fn may_differ(&self) -> bool {
        self.participation.replanned || self.dead.of_agents() > 0
    }

    /// That the time was up, if it was.
    fn time_was_up(&self) -> Option<String> {
        let limit = self.time_limit?.as_secs_f64();
        Some(format!("the time was up after {limit} s (--timeout)"))
    }

    /// Which living modules took no spot, and why.
    fn absences(&self) -> Vec<String> {
        let Participation {
            out_of_service,
            left_out,
            ..
        } = &self.participation;
        [(out_of_service, "left service"), (left_out, "did not join")]
            .into_iter()
            .filter(|(modules, _)| !modules.is_empty())
            .map(|(modules, what)| format!("{} {what}", listed_in_full(modules.iter().copied())))
            .collect()
    }

    /// Whether the run reached what it was started for.
    ///
    /// # Errors
    /// Says what is wrong with the formation.
    pub fn conclusion(&self) -> Result<(), Failure> {
        let failed = |what: String| Err(Failure::Failed(anyhow!(what)));
        let is_agreed = self.verdict == RunOutcome::Agreed;
        if self.verdict == RunOutcome::Judged(Outcome::Failed)
            || is_agreed && !self.violations.is_empty()
        {
            let missing = self.missing.iter().flatten();
            let reasons = self.violations.iter().chain(missing).cloned();
            let reasons: Vec<String> = self.time_was_up().into_iter().chain(reasons).collect();
            return failed(format!("the formation failed: {}", reasons.join("; ")));
        }
        // The offline plan is made for all modules. With fewer, its spots still have to be filled.
        let filled = match self.verdict {
            RunOutcome::Judged(_) => self.filled_spots,
            RunOutcome::Agreed => self.assignments().len(),
        };
        let has_hole = filled < self.planned.len();
        if self.may_differ() && has_hole && !(is_agreed && self.dead.of_agents() > 0) {
            return failed(self.hole());
        }
        let differences = self.differences();
        if self.may_differ() || differences.is_empty() {
            return Ok(());
        }
        failed(format!(
            "the processes formed another allocation than the offline plan: {}",
            differences.join("; ")
        ))
    }

    /// Which spots are open, and why.
    fn hole(&self) -> String {
        let dead = self.dead.modules();
        let mut causes = Vec::new();
        if !dead.is_empty() {
            causes.push(format!("{} died", listed_in_full(dead)));
        }
        causes.extend(self.absences());
        causes.push("and no spare was left".to_owned());
        let hole = match self.verdict {
            RunOutcome::Judged(_) => {
                let open = self.plan.statistics.open_spots.iter().copied();
                format!("the formation has a hole: {} open", listed_in_full(open))
            }
            RunOutcome::Agreed => "the plan has a hole".to_owned(),
        };
        let time = self.time_was_up().map(|time| format!("; {time}"));
        let advice = match self.participation.left_out.is_empty() {
            true => "",
            false => {
                "; on a busy machine, host several modules in each process with --modules-per-process"
            }
        };
        let time = time.unwrap_or_default();
        format!("{hole}; {}{time}{advice}", causes.join(", "))
    }

    /// Where the run differs from the plan.
    fn differences(&self) -> Vec<String> {
        let by_module = |assignments: &[Assignment]| -> BTreeMap<ModuleId, SpotId> {
            let pairs = assignments.iter();
            pairs.map(|one| (one.module, one.spot)).collect()
        };
        let planned = by_module(&self.planned);
        let seen = by_module(self.assignments());
        let or_none =
            |spot: Option<&SpotId>| spot.map_or("no spot".to_owned(), ToString::to_string);
        let modules: BTreeSet<&ModuleId> = planned.keys().chain(seen.keys()).collect();
        let mut differences: Vec<String> = modules
            .into_iter()
            .map(|module| (module, seen.get(module), planned.get(module)))
            .filter(|(_, seen, planned)| seen != planned)
            .map(|(module, seen, planned)| {
                format!(
                    "{module} took {} instead of {}",
                    or_none(seen),
                    or_none(planned)
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
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;
    use std::process::ExitStatus;

    use formation::event_log::{Entry, Event};
    use formation::model::Scenario;
    use formation::verify::{AgreementReport, VerdictReport};
    use serde_json::{Value, json};

    use super::super::recording::Recording;
    use super::super::roles::Death;
    use super::*;

    const EPOCH: Epoch = Epoch {
        number: 1,
        convener: ModuleId(7),
    };
    const TIMEOUT: Duration = Duration::from_secs(60);

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

    fn assignments(pairs: &[(u32, u32)]) -> Vec<Assignment> {
        let pairs = pairs.iter().map(|&(module, spot)| Assignment {
            module: ModuleId(module),
            spot: SpotId(spot),
        });
        pairs.collect()
    }

    fn verdict(outcome: Outcome, spots: [u32; 2]) -> VerdictReport {
        let violations = match outcome {
            Outcome::Failed => vec!["module 7 moved too early".to_owned()],
            _ => Vec::new(),
        };
        VerdictReport {
            outcome,
            epoch: Some(EPOCH),
            filled_spots: 2,
            assignments: assignments(&[(7, spots[0]), (8, spots[1])]),
            unassigned: Vec::new(),
            open_spots: Vec::new(),
            violations,
            missing: Vec::new(),
            timings_ms: Default::default(),
            planning_ms: Some(12),
            acting_ms: Some(345),
            counts: Default::default(),
        }
    }

    /// An epoch whose roster lists the scenario's modules as they started, but for those out of service.
    fn roster(plan: &CheckedPlan, modules: &[u32], out_of_service: &[u32]) -> Recording {
        let ids = |ids: &[u32]| ids.iter().copied().map(ModuleId).collect::<Vec<_>>();
        let is_whole = modules.len() == 2 && out_of_service.is_empty();
        let mut recording = Recording::default();
        recording.keep(Entry {
            at_ms: 1,
            event: Event::Roster {
                epoch: EPOCH,
                modules: ids(modules),
                out_of_service: ids(out_of_service),
                problem: is_whole.then(|| plan.problem.digest()),
            },
        });
        recording
    }

    fn report(outcome: Outcome, spots: [u32; 2]) -> RunReport {
        let observed = Observed {
            discovery: Some(Duration::from_millis(1_500)),
            ..Observed::default()
        };
        report_on(verdict(outcome, spots), observed, &[7, 8], &[])
    }

    /// The report on a run whose last roster listed these modules.
    fn report_on(
        verdict: VerdictReport,
        observed: Observed,
        modules: &[u32],
        out_of_service: &[u32],
    ) -> RunReport {
        let plan = plan();
        let observed = Observed {
            recording: roster(&plan, modules, out_of_service),
            ..observed
        };
        let judgement = Judgement::Verdict(verdict);
        RunReport::new(&plan, judgement, &observed, TIMEOUT)
    }

    /// A verdict on a formation in which only module 8 has settled, on spot 2.
    fn half(outcome: Outcome) -> VerdictReport {
        VerdictReport {
            filled_spots: 1,
            assignments: assignments(&[(8, 2)]),
            open_spots: vec![SpotId(1)],
            violations: Vec::new(),
            ..verdict(outcome, [1, 2])
        }
    }

    /// The report on a run during which this module died.
    fn report_without(module: u32, verdict: VerdictReport) -> RunReport {
        let mut observed = Observed::default();
        observed.deaths.push(Death {
            name: format!("module_agent of module {module}"),
            modules: vec![ModuleId(module)],
            status: ExitStatus::from_raw(9),
            after: Duration::from_millis(5_230),
        });
        report_on(verdict, observed, &[7, 8], &[])
    }

    fn json_of(report: &RunReport) -> Value {
        serde_json::to_value(report).unwrap()
    }

    #[test]
    fn other_modules_may_take_the_places_of_the_dead() {
        let report = report_without(9, verdict(Outcome::Complete, [2, 1]));
        assert!(report.conclusion().is_ok());
        assert_eq!(
            report.text(&plan(), "two"),
            "module  spot\n     7     2\n     8     1\nplanned in 12 ms, acted in 345 ms\n\
             dead: module_agent of module 9 ended with signal: 9 (SIGKILL) after 5.2 s\n\
             COMPLETE: all 2 spots are filled, hole-free"
        );
        assert_eq!(
            json_of(&report)["dead"],
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
        let mut judged = verdict(Outcome::Failed, [1, 2]);
        judged.violations.clear();
        let report = report_without(8, judged);
        let json = json_of(&report);
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
        let report = report(Outcome::Complete, [1, 2]);
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
    }

    #[test]
    fn programs_read_the_plan_and_the_run_in_one_object() {
        let mut json = json_of(&report(Outcome::Complete, [1, 2]));
        let plan = serde_json::to_value(plan().report()).unwrap();
        assert!(json["planning_us"].is_u64());
        json["planning_us"] = plan["planning_us"].clone();
        let mut expected = plan.as_object().unwrap().clone();
        let run = json!({
            "verdict": "COMPLETE",
            "violations": [],
            "missing": [],
            "discovery_ms": 1_500,
            "planning_ms": 12,
            "acting_ms": 345,
            "dead": [],
            "replanned": false,
            "out_of_service": [],
            "left_out": [],
            "timed_out": false,
        });
        expected.extend(run.as_object().unwrap().clone());
        assert_eq!(json, Value::Object(expected));
    }

    #[test]
    fn another_allocation_than_planned_is_found_wrong() {
        let report = report(Outcome::Complete, [2, 1]);
        let failure = report.conclusion().unwrap_err();
        assert_eq!(
            failure.to_string(),
            "the processes formed another allocation than the offline plan: module 7 took spot 2 instead of spot 1; \
             module 8 took spot 1 instead of spot 2"
        );
        assert_eq!(json_of(&report)["assignments"][0]["spot"], 2);
    }

    #[test]
    fn another_plan_for_another_roster_is_no_fault() {
        // Module 7 was out of reach for a while: it has moved since the start.
        let observed = Observed {
            recording: {
                let mut recording = roster(&plan(), &[7, 8], &[]);
                let mut later = recording.entries()[0].clone();
                if let Event::Roster { problem, .. } = &mut later.event {
                    *problem = None;
                }
                recording.keep(later);
                recording
            },
            ..Observed::default()
        };
        let judgement = Judgement::Verdict(verdict(Outcome::Complete, [2, 1]));
        let report = RunReport::new(&plan(), judgement, &observed, TIMEOUT);
        assert!(report.conclusion().is_ok());
        assert_eq!(json_of(&report)["replanned"], true);
        assert_eq!(report.faults(), Vec::<String>::new());
        let text = report.text(&plan(), "two");
        assert!(text.starts_with("module  spot\n     7     2\n"), "{text}");
    }

    #[test]
    fn a_module_that_left_service_is_named_and_no_other_plan() {
        let partial = report_on(half(Outcome::Partial), Observed::default(), &[7, 8], &[7]);
        assert_eq!(
            partial.conclusion().unwrap_err().to_string(),
            "the formation has a hole: spot 1 open; module 7 left service, and no spare was left"
        );
        assert_eq!(
            partial.outcome_text(),
            "PARTIAL: 1 of 2 spots are filled; module 7 left service"
        );
        assert_eq!(json_of(&partial)["out_of_service"], json!([7]));
        let complete = report_on(
            verdict(Outcome::Complete, [2, 1]),
            Observed::default(),
            &[7, 8, 9],
            &[9],
        );
        assert!(complete.conclusion().is_ok());
    }

    #[test]
    fn a_time_that_was_up_is_named_with_what_was_missing() {
        let mut late = half(Outcome::Failed);
        late.missing = vec!["spot 1 is open".to_owned()];
        let report = report_on(late, Observed::default(), &[7, 8], &[]);
        assert_eq!(
            report.conclusion().unwrap_err().to_string(),
            "the formation failed: the time was up after 60 s (--timeout); spot 1 is open"
        );
        let text = report.text(&plan(), "two");
        assert!(
            text.contains("\nthe time was up after 60 s (--timeout)\nmissing: spot 1 is open\n"),
            "{text}"
        );
        assert_eq!(json_of(&report)["timed_out"], true);
        let observed = Observed {
            timed_out: true,
            ..Observed::default()
        };
        let report = report_on(half(Outcome::Partial), observed, &[8], &[]);
        assert_eq!(
            report.conclusion().unwrap_err().to_string(),
            "the formation has a hole: spot 1 open; module 7 did not join, and no spare was left; the time was up after \
             60 s (--timeout); on a busy machine, host several modules in each process with --modules-per-process"
        );
        assert_eq!(
            report.outcome_text(),
            "PARTIAL: 1 of 2 spots are filled; module 7 did not join"
        );
    }

    #[test]
    fn modules_that_were_left_out_are_named() {
        let agreement = AgreementReport {
            epoch: EPOCH,
            assignments: assignments(&[(8, 1)]),
            planning_ms: 12,
            violations: Vec::new(),
        };
        let judgement = Judgement::Agreement(agreement);
        let observed = Observed {
            recording: roster(&plan(), &[8], &[]),
            ..Observed::default()
        };
        let report = RunReport::new(&plan(), judgement, &observed, TIMEOUT);
        let failure = report.conclusion().unwrap_err().to_string();
        assert!(
            failure.starts_with(
                "the plan has a hole; module 7 did not join, and no spare was left; on a busy machine"
            ),
            "{failure}"
        );
        let json = json_of(&report);
        assert_eq!(json["verdict"], "AGREED");
        assert_eq!(json["left_out"], json!([7]));
        assert_eq!(json["missing"], Value::Null);
        assert_eq!(json["acting_ms"], Value::Null);
    }

    #[test]
    fn a_failed_formation_says_why() {
        let report = report(Outcome::Failed, [1, 2]);
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
}
