//! One policy on one instance.

use std::sync::Arc;
use std::time::{Duration, Instant};

use formation_model::text::joined;
use formation_model::{Decision, PlanningProblem, Scenario};
use formation_motion::PlannedMotion;
use formation_planner::{PlanSize, Planning, Statistics};
use formation_verify::{check_plan, hole_of};
use serde::{Deserialize, Serialize};

use super::contender::{ComparedPolicy, Decides};
use super::instance::ComparedInstance;
use crate::policies::problem_under;
use crate::policy_program;

/// What became of a policy on an instance; the same on every machine, except of a program that draws lots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    pub instance: String,
    pub kind: String,
    pub modules: Option<usize>,
    pub spots: Option<usize>,
    pub seed: Option<u64>,
    pub policy: String,
    pub outcome: RowOutcome,
    /// Why the plan is not complete.
    pub reason: Option<String>,
    /// `None` without a plan.
    pub measures: Option<Measures>,
}

/// Whether there is a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RowOutcome {
    /// It fills all spots that the modules suffice for.
    Complete,
    /// It leaves a hole.
    Hole,
    /// There is no instance.
    NoInstance,
    /// The policy cannot be asked, or would take too long.
    Refused,
    /// The policy gave no plan that keeps its guarantees.
    Failed,
}

impl RowOutcome {
    pub fn name(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Hole => "hole",
            Self::NoInstance => "no_instance",
            Self::Refused => "refused",
            Self::Failed => "failed",
        }
    }
}

/// What a plan costs. Lengths are in units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measures {
    pub filled: usize,
    pub total_utility: f64,
    pub total_distance: f64,
    pub longest_distance: f64,
    pub kept_links: usize,
    pub broken_links: usize,
    pub detached_modules: usize,
    pub port_changes: usize,
    pub evictions: usize,
    pub turns: usize,
    pub messages: usize,
    /// Steps until the last module arrives along paths; `None` without `--motion`, and without paths.
    pub makespan: Option<u32>,
}

/// How long the decision took: of a program, with its start and both texts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Time {
    pub instance: String,
    pub policy: String,
    pub planning_us: Option<u64>,
}

/// Asks a policy for a plan, and has the plan checked independently.
pub fn measure(
    instance: &ComparedInstance,
    loaded: &Result<Scenario, String>,
    contender: &ComparedPolicy,
    with_motion: bool,
) -> (Row, Time) {
    let mut row = Row {
        instance: instance.label(),
        kind: instance.kind(),
        modules: None,
        spots: None,
        seed: instance.seed(),
        policy: contender.label.clone(),
        outcome: RowOutcome::NoInstance,
        reason: None,
        measures: None,
    };
    let mut time = None;
    match loaded {
        Err(reason) => row.reason = Some(reason.clone()),
        Ok(scenario) => {
            row.modules = Some(scenario.problem().modules().len());
            row.spots = Some(scenario.problem().target().spots().len());
            match planned(scenario, contender, with_motion) {
                Ok(planned) => {
                    time = Some(planned.elapsed);
                    row.measures = Some(planned.measures);
                    row.outcome = match planned.hole {
                        None => RowOutcome::Complete,
                        Some(_) => RowOutcome::Hole,
                    };
                    row.reason = planned.hole;
                }
                Err((outcome, reason)) => {
                    row.outcome = outcome;
                    row.reason = Some(reason);
                }
            }
        }
    }
    let time = Time {
        instance: row.instance.clone(),
        policy: row.policy.clone(),
        planning_us: time.map(|time| u64::try_from(time.as_micros()).unwrap_or(u64::MAX)),
    };
    (row, time)
}

struct Planned {
    measures: Measures,
    hole: Option<String>,
    elapsed: Duration,
}

fn planned(
    scenario: &Scenario,
    contender: &ComparedPolicy,
    with_motion: bool,
) -> Result<Planned, (RowOutcome, String)> {
    let mut start = Instant::now();
    let mut asked = None;
    let problem: Arc<PlanningProblem> = match &contender.decides {
        Decides::Policy(policy) => {
            let problem = problem_under(scenario, Some(*policy));
            let problem = problem.map_err(|reason| (RowOutcome::Refused, reason))?;
            let size = PlanSize::of(&problem).check();
            size.map_err(|too_long| (RowOutcome::Refused, too_long.to_string()))?;
            start = Instant::now();
            problem
        }
        Decides::Program(command, limit) => {
            let problem = policy_program::ask(command, scenario.problem(), *limit);
            asked = Some(start.elapsed());
            problem.map_err(|error| (RowOutcome::Failed, error.to_string()))?
        }
    };
    let mut planning = Planning::new(Arc::clone(&problem));
    let decisions = planning.take_all_turns();
    let elapsed = asked.unwrap_or_else(|| start.elapsed());
    let outcome = planning.outcome(decisions);
    let decisions = outcome.decisions.iter();
    let decisions: Vec<Decision> = decisions.map(|(_, decision)| decision.clone()).collect();
    check_plan(&problem, &decisions, &outcome.plan).map_err(|violations| {
        let text = joined(violations, "; ");
        let reason = format!("the plan does not keep its guarantees: {text}");
        (RowOutcome::Failed, reason)
    })?;
    let hole = hole_of(&problem, &outcome.plan);
    let statistics = Statistics::of(&problem, &outcome);
    let makespan = with_motion
        .then(|| PlannedMotion::of(&problem, outcome.plan.clone()).0)
        .and_then(|motion| Some(motion.paths()?.makespan));
    let changes = &statistics.changes;
    Ok(Planned {
        measures: Measures {
            filled: statistics.assignments.len(),
            total_utility: statistics.total_utility,
            total_distance: statistics.total_distance,
            longest_distance: statistics.longest_distance,
            kept_links: changes.kept_links,
            broken_links: changes.broken_links,
            detached_modules: changes.detached_modules,
            port_changes: changes.port_changes,
            evictions: changes.evictions,
            turns: outcome.decisions.len(),
            messages: statistics.messages.samples,
            makespan,
        },
        hole: (!hole.is_empty()).then(|| joined(hole, "; ")),
        elapsed,
    })
}
