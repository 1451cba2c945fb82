//! The result of a run.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use anyhow::anyhow;
use formation_event_log::milliseconds;
use formation_model::text::{joined, listed_in_full};
use formation_model::{Assignment, BlockedSpot, Epoch, ModuleId, SpotId};
use formation_motion::WorldReport;
use formation_offline::{CheckedPlan, PlanReport, aligned};
use formation_report::Fact;
use formation_verifier_lines::{NOT_COLLISION_FREE, Unjudged, outcome_text, unjudged_text};
use formation_verify::Outcome;
use ros_runtime::exit::{Failure, one_line};
use serde::{Serialize, Serializer};

use super::roles::Deaths;
use super::run_loop::{Judgement, Observed};

/// More differences from the plan are counted only.
const DIFFERENCES_MAX: usize = 8;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum RunOutcome {
    /// All modules hold one plan, and none was to move.
    #[serde(rename = "AGREED")]
    Agreed,
    /// With a verdict on the formation.
    #[serde(untagged)]
    Judged(Outcome),
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
    /// `None` with `--plan-only`.
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
    /// Whether no bodies overlapped; `None` where modules only agree.
    collision_free: Option<bool>,
    collision_reason: Option<String>,
    /// The modules of which it is not known whether they touched others, and for how long.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    not_judged: Vec<Unjudged>,
    /// The spots that bodies block, by the verdict.
    blocked_spots: Vec<BlockedSpot>,
    /// What the physical world counted, if there was one.
    #[serde(skip_serializing_if = "Option::is_none")]
    world: Option<WorldReport>,
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
            collision_free: None,
            collision_reason: None,
            not_judged: Vec::new(),
            blocked_spots: Vec::new(),
            world: observed.world.clone(),
        };
        let statistics = &mut report.plan.statistics;
        match judgement {
            Judgement::Verdict(verdict) => {
                report.verdict = RunOutcome::Judged(verdict.outcome);
                report.filled_spots = verdict.filled_spots;
                statistics.assignments = verdict.assignments;
                statistics.unassigned = verdict.unassigned;
                statistics.open_spots = verdict.open_spots;
                report.blocked_spots = verdict.blocked_spots;
                report.violations = verdict.violations;
                report.missing = Some(verdict.missing);
                report.planning_ms = verdict.planning_ms;
                report.acting_ms = verdict.acting_ms;
                report.collision_free = Some(verdict.collision_free);
                report.collision_reason = verdict.collision_reason;
                report.not_judged = verdict.not_judged;
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

    /// The modules whose processes died.
    pub fn dead_modules(&self) -> BTreeSet<ModuleId> {
        self.dead.modules()
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
            if self.may_differ() {
                lines.push(self.placement_text());
            } else if self.differences().is_empty() {
                lines.push(plan.text(&one_line(name), None));
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
        lines.extend(self.left_open());
        lines.extend(self.dead.iter().map(|death| format!("dead: {death}")));
        let blocked = self.blocked_spots.iter();
        lines.extend(blocked.map(|blocked| format!("blocked: {blocked}")));
        lines.extend(self.collision_note());
        let world = self.world.iter();
        lines.extend(world.map(|world| format!("world: {world}")));
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

    /// The open spots of a formation that has ended as planned and yet failed: the plan had a hole.
    fn left_open(&self) -> Option<String> {
        let is_failed = self.verdict == RunOutcome::Judged(Outcome::Failed);
        let is_ended = self.missing.as_ref().is_some_and(Vec::is_empty);
        let open = self.plan.statistics.open_spots.iter().copied();
        (is_failed && is_ended && open.len() > 0)
            .then(|| format!("left open: {}", listed_in_full(open)))
    }

    /// Why the motion was not free of collisions, if it was not.
    fn collision_note(&self) -> Option<String> {
        let reason = self.collision_reason.as_ref();
        reason.map(|reason| format!("{NOT_COLLISION_FREE}: {reason}"))
    }

    /// The verdict in one line.
    pub fn outcome_text(&self) -> String {
        let text = self.outcome_alone();
        match self.collision_reason {
            Some(_) => format!("{text}, {NOT_COLLISION_FREE}"),
            None => text,
        }
    }

    fn outcome_alone(&self) -> String {
        let filled = self.filled_spots;
        let spots = filled + self.plan.statistics.open_spots.len();
        match self.verdict {
            RunOutcome::Judged(Outcome::Partial)
                if filled < self.planned.len() && self.blocked_spots.is_empty() =>
            {
                let absences = self.absences();
                let by = match absences.is_empty() {
                    true => ", one by each living module".to_owned(),
                    false => format!("; {}", absences.join(", ")),
                };
                format!("PARTIAL: {filled} of {spots} spots are filled{by}")
            }
            RunOutcome::Judged(outcome) => {
                outcome_text(outcome, filled, spots, self.blocked_spots.len())
            }
            RunOutcome::Agreed => {
                "AGREED: all modules hold the same plan; none has moved".to_owned()
            }
        }
    }

    /// The durations of the parts of the run, what the physical world counted, how many modules and spots there are, and the
    /// numbers of the plan, unless the modules may have made another one.
    pub fn facts(&self, plan: &CheckedPlan) -> Vec<Fact> {
        let of_plan = match self.may_differ() {
            true => Vec::new(),
            false => plan.planning_facts(),
        };
        let times = [
            ("all joined after", self.discovery_ms),
            ("from the roster to the last claim", self.planning_ms),
            ("from the first motion to the end", self.acting_ms),
        ]
        .into_iter()
        .filter_map(|(what, time)| Some(Fact::new(what, format!("{} ms", time?))));
        let world = self.world.iter();
        times
            .chain(world.map(|world| Fact::new("in the physical world", world.to_string())))
            .chain(plan.counts(&self.plan.statistics))
            .chain(of_plan)
            .collect()
    }

    /// All that is wrong, one sentence each.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = self.violations.clone();
        faults.extend(self.collision_note());
        faults.extend(self.time_was_up());
        faults.extend(self.missing.iter().flatten().cloned());
        faults.extend(self.dead.iter().map(ToString::to_string));
        faults.extend(self.blocked_spots.iter().map(ToString::to_string));
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
            let reasons = reasons.chain(self.left_open());
            let reasons = joined(self.time_was_up().into_iter().chain(reasons), "; ");
            return failed(format!("the formation failed: {reasons}"));
        }
        if self.verdict == RunOutcome::Judged(Outcome::NotJudged) {
            let not_judged = unjudged_text(&self.not_judged);
            return Err(Failure::NotJudged(format!(
                "NOT_JUDGED {not_judged}: bodies overlapped by less than the tolerances of their poses"
            )));
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
        causes.extend(self.blocked_spots.iter().map(ToString::to_string));
        if self.blocked_spots.is_empty() && self.plan.statistics.unassigned.is_empty() {
            causes.push("and no spare was left".to_owned());
        }
        let hole = match self.verdict {
            RunOutcome::Judged(_) => {
                let open = self.plan.statistics.open_spots.iter().copied();
                format!("not all spots are filled: {} open", listed_in_full(open))
            }
            RunOutcome::Agreed => "the plan has a hole".to_owned(),
        };
        let time = self.time_was_up().map(|time| format!("; {time}"));
        let time = time.unwrap_or_default();
        format!("{hole}; {}{time}{}", causes.join(", "), self.advice())
    }

    /// What an operator can do about a hole.
    fn advice(&self) -> String {
        let mut advice = String::new();
        if !self.participation.left_out.is_empty() {
            advice.push_str(
                "; on a busy machine, host several modules in each process with --modules-per-process",
            );
        }
        if !self.blocked_spots.is_empty() {
            advice.push_str("; once a body is taken away, report that with `formation remove`");
        }
        advice
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
mod tests;
