//! A plan that is made offline, by the same core as in every agent, and checked.

use std::collections::BTreeMap;
use std::sync::Arc;

use formation_event_log::{Entry, SceneChange};
use formation_model::text::{counted, joined, listed_in_full};
use formation_model::{
    Assignment, Decision, ModuleId, Plan, PlanningProblem, Policy, ScenarioError, SpotId,
};
use formation_motion::PlannedMotion;
use formation_planner::{PlanOutcome, Planning, Statistics, given_by};
use formation_report::{Fact, Subject, Summary, Tone, course_of_plan};
use formation_verify::{Violation, check_plan, check_swapped_plan, hole_of};
use serde::Serialize;
use thiserror::Error;

use crate::motion::{self, MotionSummary};
use crate::spread::WithoutSpread;
use crate::stopwatch::Stopwatch;
use crate::swap::SwapReport;
use crate::table::aligned;

/// The default speed of simulated modules.
pub const SPEED_UNITS_PER_S: f64 = 5.0;

/// A plan that breaks what it guarantees; it is not given out.
#[derive(Debug, Error)]
#[error("the plan does not keep its guarantees: {0}")]
pub struct GuaranteeBroken(String);

/// Why there is no plan by an allocation.
#[derive(Debug, Error)]
pub enum ByAllocationError {
    /// It is none for the problem.
    #[error(transparent)]
    Refused(#[from] ScenarioError),
    /// Its plan does not keep what plans guarantee.
    #[error(transparent)]
    GuaranteeBroken(#[from] GuaranteeBroken),
}

/// How far a plan has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanStage {
    /// The turns that are taken, and those that are left.
    Turns(usize, usize),
    /// The paths are planned, of which no part can be counted.
    Motion,
}

/// A plan that the verifier's checks have passed, except that the policy `paper`, and walls round modules, may leave a hole.
pub struct CheckedPlan {
    /// What was planned for.
    pub problem: Arc<PlanningProblem>,
    /// The plan and its turns.
    pub outcome: PlanOutcome,
    /// What the plan keeps, breaks and costs.
    pub statistics: Statistics,
    /// How the modules move.
    pub motion: PlannedMotion,
    /// How long the allocation took, without acting order and statistics.
    pub planning_us: u64,
    /// What is wrong with the spots that are filled: too few, or apart. Only the policy `paper` leaves such a hole, and walls round modules.
    hole: Option<String>,
}

/// A turn as it is printed as JSON.
#[derive(Debug, Serialize)]
pub struct PlanTurn {
    /// From 0.
    turn: u32,
    claimant: ModuleId,
    modules: Vec<ModuleId>,
    #[serde(flatten)]
    decision: Decision,
    text: String,
}

/// What `formation plan --json` prints.
#[derive(Debug, Serialize)]
pub struct PlanReport {
    /// What the plan keeps, breaks and costs.
    #[serde(flatten)]
    pub statistics: Statistics,
    /// How long the allocation took.
    pub planning_us: u64,
    /// The modules to which walls leave no way to the target.
    pub cut_off: Vec<ModuleId>,
    /// The spots that change hands after the claims, if nothing could carry them out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub swapped: Option<SwapReport>,
    /// What the parameter `spread` gives up; `formation plan` alone prints it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without_spread: Option<WithoutSpread>,
    /// Whether all spots are filled that the modules suffice for; `formation plan` alone prints it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub complete: Option<bool>,
    /// All turns in order; `formation plan` alone prints them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turns: Option<Vec<PlanTurn>>,
    /// How the modules move; `formation plan` alone prints it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<MotionSummary>,
}

/// A check of the verifier's.
type Check = fn(&PlanningProblem, &[Decision], &Plan) -> Result<(), Vec<Violation>>;

fn check(
    problem: &PlanningProblem,
    outcome: &PlanOutcome,
    of: Check,
) -> Result<(), GuaranteeBroken> {
    let decisions = outcome.decisions.iter();
    let decisions: Vec<Decision> = decisions.map(|(_, decision)| decision.clone()).collect();
    of(problem, &decisions, &outcome.plan)
        .map_err(|violations| GuaranteeBroken(joined(violations, "; ")))
}

impl CheckedPlan {
    /// Plans for modules and a target, and has the plan checked independently.
    ///
    /// # Errors
    /// Lists the guarantees that the plan does not keep.
    pub fn of_problem(problem: Arc<PlanningProblem>) -> Result<Self, GuaranteeBroken> {
        Self::with_progress(problem, |_| {})
    }

    /// Like [`Self::of_problem`], and reports how far it has come.
    ///
    /// # Errors
    /// Lists the guarantees that the plan does not keep.
    pub fn with_progress(
        problem: Arc<PlanningProblem>,
        report: impl FnMut(PlanStage),
    ) -> Result<Self, GuaranteeBroken> {
        let start = Stopwatch::start();
        Self::made(Planning::new(problem), start, report)
    }

    /// The plan by which the modules take the spots of an allocation, checked like any other: that of the problem under the
    /// policy `given`. The modules that the allocation tears off their configurations leave them.
    ///
    /// # Errors
    /// Names what is wrong with the allocation, or lists the guarantees that its plan does not keep.
    pub fn by_allocation(
        problem: &PlanningProblem,
        allocation: &[(ModuleId, SpotId)],
    ) -> Result<Self, ByAllocationError> {
        let given = problem.with_given(&given_by(problem, allocation))?;
        Ok(Self::of_problem(Arc::new(given))?)
    }

    fn made(
        mut planning: Planning,
        start: Stopwatch,
        mut report: impl FnMut(PlanStage),
    ) -> Result<Self, GuaranteeBroken> {
        let problem = Arc::clone(planning.problem());
        let decisions =
            planning.take_all_turns_with(|taken, left| report(PlanStage::Turns(taken, left)));
        let planning_us = start.passed_us();
        let mut outcome = planning.outcome(decisions);
        check(&problem, &outcome, check_plan)?;
        let hole = hole_of(&problem, &outcome.plan);
        let hole = (!hole.is_empty()).then(|| joined(hole, "; "));
        report(PlanStage::Motion);
        let (motion, plan) = PlannedMotion::of(&problem, outcome.plan.clone());
        outcome.follow(&problem, plan);
        if outcome.swapped.is_some() {
            check(&problem, &outcome, check_swapped_plan)?;
        }
        Ok(Self {
            statistics: Statistics::of(&problem, &outcome),
            problem,
            outcome,
            motion,
            planning_us,
            hole,
        })
    }

    /// Whether all spots are filled, and connected, that the modules suffice for.
    pub fn is_complete(&self) -> bool {
        self.hole.is_none()
    }

    /// What is wrong with the spots that are filled, and which are open; `None` if nothing is.
    pub fn hole_text(&self) -> Option<String> {
        let hole = self.hole.as_ref()?;
        let open = match self.statistics.open_spots.as_slice() {
            [] => String::new(),
            open => format!("; left open: {}", listed_in_full(open.iter().copied())),
        };
        let reason = match self.cut_off_text() {
            Some(cut_off) => format!("{cut_off}; "),
            None => "as the policy `paper` may leave one: ".to_owned(),
        };
        Some(format!("the plan has a hole, {reason}{hole}{open}"))
    }

    /// The swap after the claims, if there is one.
    fn swapped(&self) -> Option<SwapReport> {
        self.outcome.swapped.as_ref().map(SwapReport::from)
    }

    /// The modules to which walls leave no way.
    fn cut_off_text(&self) -> Option<String> {
        let cut_off = &self.outcome.cut_off;
        let listed = || listed_in_full(cut_off.iter().copied());
        (!cut_off.is_empty()).then(|| format!("no way leads to the target from {}", listed()))
    }

    /// All turns with their decisions.
    pub fn turns(&self) -> Vec<PlanTurn> {
        let turns = self.outcome.decisions.iter();
        turns
            .map(|(turn, decision)| PlanTurn {
                turn: turn.number,
                claimant: turn.claimant,
                modules: turn.modules.clone(),
                decision: decision.clone(),
                text: SceneChange::Turn {
                    turn: turn.number,
                    claimant: turn.claimant,
                    decision,
                }
                .to_string(),
            })
            .collect()
    }

    /// The warnings about the plan itself: those of the planner, of its motion, and of a search that was cut.
    pub fn warnings(&self) -> Vec<String> {
        let planned = self.statistics.warnings.iter().map(ToString::to_string);
        let motion = motion::warning(&self.motion);
        let cut = self.cut_search_text().map(str::to_owned);
        planned.chain(motion).chain(cut).collect()
    }

    /// Says so if a placement is not proven to be the best.
    pub fn cut_search_text(&self) -> Option<&'static str> {
        (!self.statistics.proven).then_some(
            "a search on a graph with cycles was cut at its budget; a better plan may exist",
        )
    }

    /// The object that `formation plan --json` prints.
    pub fn whole_report(&self, without_spread: Option<WithoutSpread>) -> PlanReport {
        PlanReport {
            without_spread,
            complete: Some(self.is_complete()),
            turns: Some(self.turns()),
            motion: Some(MotionSummary::of(&self.motion)),
            ..self.report()
        }
    }

    /// What to print as JSON.
    pub fn report(&self) -> PlanReport {
        PlanReport {
            statistics: self.statistics.clone(),
            planning_us: self.planning_us,
            cut_off: self.outcome.cut_off.clone(),
            swapped: self.swapped(),
            without_spread: None,
            complete: None,
            turns: None,
            motion: None,
        }
    }

    /// Whether the placements of the configurations are proven to be the best, in a sentence.
    pub fn proof_text(&self) -> &'static str {
        match self.statistics.proven {
            true => "every placement of a configuration is proven to be the best",
            false => {
                "not every placement of a configuration is proven to be the best: the search for it ended at its budget"
            }
        }
    }

    /// The plan as it would be carried out by simulated drives.
    pub fn course(&self) -> Vec<Entry> {
        let (problem, outcome) = (&self.problem, &self.outcome);
        course_of_plan(problem, outcome, &self.motion, SPEED_UNITS_PER_S)
    }

    /// What pictures show of a plan with this course; the name in one line.
    pub fn subject(&self, name: &str, course: &[Entry]) -> Subject {
        Subject::of_course(name, &self.problem, &self.outcome, course, None)
            .with_paths(&self.motion)
    }

    /// Why no module would move by this plan, if so.
    pub fn unmovable_text(&self) -> Option<String> {
        if self.statistics.assignments.is_empty()
            && let Some(cut_off) = self.cut_off_text()
        {
            return Some(format!("no module would move: {cut_off}"));
        }
        match &self.motion {
            PlannedMotion::Refused(error) => {
                let cure = error.cure();
                Some(format!("no module would move: {error}; {cure}"))
            }
            PlannedMotion::Paths(_) => None,
        }
    }

    /// The plan as a table under its name in one line, its sums, and how they compare with those of a plan without spread.
    pub fn text(&self, name: &str, without_spread: Option<&WithoutSpread>) -> String {
        let mut parts = Vec::new();
        if !name.is_empty() {
            parts.push(name.to_owned());
        }
        parts.push(self.table());
        let statistics = &self.statistics;
        if !statistics.unassigned.is_empty() {
            let unassigned = listed_in_full(statistics.unassigned.iter().copied());
            parts.push(format!("without a spot: {unassigned}"));
        }
        parts.extend(self.cut_off_text());
        if !statistics.open_spots.is_empty() {
            let open = listed_in_full(statistics.open_spots.iter().copied());
            parts.push(format!("left open: {open}"));
        }
        parts.push(format!(
            "{} kept, {} broken; {} detached; {}; {}",
            counted(statistics.changes.kept_links, "link"),
            statistics.changes.broken_links,
            counted(statistics.changes.detached_modules, "module"),
            counted(statistics.changes.port_changes, "port change"),
            counted(statistics.changes.evictions, "eviction"),
        ));
        parts.push(format!(
            "total utility {:.3}, total distance {:.3} units",
            statistics.total_utility, statistics.total_distance
        ));
        if let Some(plain) = without_spread {
            let spread = self.problem.parameters().spread;
            parts.push(plain.text(spread, &self.outcome));
        }
        parts.extend(self.swapped().map(|swapped| swapped.text()));
        // The other policies ignore that modules are docked.
        let policy = self.problem.parameters().policy;
        let places_blocks = matches!(policy, Policy::Exact | Policy::Paper);
        if places_blocks && !self.problem.configurations().is_empty() {
            parts.push(self.proof_text().to_owned());
        }
        parts.push(motion::line(&self.motion));
        let messages = &statistics.messages;
        parts.push(format!(
            "{} in {} µs; messages: {}, {} deliveries, {} pairs delivered",
            counted(self.outcome.decisions.len(), "turn"),
            self.planning_us,
            counted(messages.samples, "sample"),
            messages.deliveries,
            messages.pairs,
        ));
        parts.join("\n")
    }

    fn table(&self) -> String {
        let order = self.statistics.assembly_order.iter().copied();
        let order: BTreeMap<SpotId, usize> = order.zip(1..).collect();
        let units = self.outcome.plan.assembly.unit_of_each();
        let heads = ["module", "spot", "filled", "distance", "moves with"];
        let row = |assignment: &Assignment| {
            let (module, spot) = (assignment.module, assignment.spot);
            let ends = self
                .problem
                .module(module)
                .zip(self.problem.target().spot(spot));
            let unit = units.get(&module);
            let unit = unit.filter(|unit| unit.placements.len() > 1);
            let distance = ends.map(|(module, spot)| module.pose.distance_to(&spot.pose));
            let or_blank = |cell: Option<String>| cell.unwrap_or_default();
            [
                module.0.to_string(),
                spot.0.to_string(),
                or_blank(order.get(&spot).map(usize::to_string)),
                or_blank(distance.map(|distance| format!("{:.3}", distance.to_units()))),
                or_blank(unit.map(|unit| unit.lead.0.to_string())),
            ]
        };
        aligned(heads, self.statistics.assignments.iter().map(row))
    }

    /// What the page of a plan says besides its film.
    pub fn summary(&self) -> Summary {
        let mut notes = self.statistics.warnings.clone();
        notes.extend(motion::warning(&self.motion));
        Summary {
            outcome: format!(
                "Planned: {} of {} spots get a module{}",
                self.statistics.assignments.len(),
                self.problem.target().spots().len(),
                motion::mark(&self.motion)
            ),
            tone: Tone::Neutral,
            source: format!(
                "Planned offline and not carried out: the film shows the turns of the plan, then its motions, at \
                 {SPEED_UNITS_PER_S} units a second. The clock next to the film counts the motions alone."
            ),
            facts: self.facts(),
            notes,
        }
    }

    /// How many modules and spots there are, and the numbers of the plan, for the page of a report.
    pub fn facts(&self) -> Vec<Fact> {
        let counts = self.counts(&self.statistics).into_iter();
        counts.chain(self.planning_facts()).collect()
    }

    /// How many modules and spots there are, and how many of them are left in the end.
    pub fn counts(&self, end: &Statistics) -> [Fact; 4] {
        [
            Fact::new("modules", self.problem.modules().len()),
            Fact::new("modules without a spot", end.unassigned.len()),
            Fact::new("spots", self.problem.target().spots().len()),
            Fact::new("spots left open", end.open_spots.len()),
        ]
    }

    /// The numbers of the plan.
    pub fn planning_facts(&self) -> Vec<Fact> {
        let statistics = &self.statistics;
        let messages = &statistics.messages;
        let swapped = self
            .swapped()
            .map(|swapped| Fact::new("swapped after the claims", swapped.text()));
        let facts = [
            Fact::new("turns", self.outcome.decisions.len()),
            Fact::new("evictions", statistics.changes.evictions),
            Fact::new("links kept", statistics.changes.kept_links),
            Fact::new("links broken", statistics.changes.broken_links),
            Fact::new("modules detached", statistics.changes.detached_modules),
            Fact::new("port changes", statistics.changes.port_changes),
            Fact::new("total utility", format!("{:.3}", statistics.total_utility)),
            Fact::new(
                "total distance",
                format!("{:.3} units", statistics.total_distance),
            ),
            Fact::new("planned offline in", format!("{} µs", self.planning_us)),
            Fact::new(
                "messages while planning",
                format!(
                    "{} samples, {} deliveries, {} pairs delivered",
                    messages.samples, messages.deliveries, messages.pairs
                ),
            ),
        ];
        facts.into_iter().chain(swapped).collect()
    }
}
