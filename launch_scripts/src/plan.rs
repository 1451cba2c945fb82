//! `formation plan`: the same core as in every agent, offline.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::anyhow;
use formation::model::{Decision, ModuleId, PlanningProblem, Scenario, SpotId};
use formation::planner::{PlanOutcome, Planning, Statistics};
use formation::verify::check_plan;
use serde::Serialize;

use crate::check::{self, counted};
use crate::failure::Failure;
use crate::report::ReportDirectory;
use crate::table::Table;
use crate::{console, scenario_file};

/// A plan that the verifier's checks have passed.
pub struct CheckedPlan {
    /// What was planned for.
    pub problem: Arc<PlanningProblem>,
    /// The plan and its turns.
    pub outcome: PlanOutcome,
    /// What there is to report of it.
    pub statistics: Statistics,
    /// How long the allocation took, without acting order and statistics.
    pub planning_us: u64,
}

/// What `formation plan --json` prints.
#[derive(Serialize)]
pub struct PlanReport<'a> {
    #[serde(flatten)]
    statistics: &'a Statistics,
    planning_us: u64,
}

/// Plans a scenario file and prints the plan.
///
/// # Errors
/// Names what is wrong with the file, or with the plan, or why the report cannot be written.
pub fn run(path: &Path, report: Option<&Path>, json: bool) -> Result<(), Failure> {
    let scenario = scenario_file::load(path)?;
    check::warn(path, &scenario);
    let report = report.map(ReportDirectory::create).transpose()?;
    let plan = CheckedPlan::of(&scenario)?;
    plan.warn(path);
    if let Some(directory) = report {
        directory.write_plan(&plan, scenario.name())?;
    }
    if json {
        console::result_json(&plan.report())
    } else {
        console::result_line(&plan.text(scenario.name()))
    }
}

impl CheckedPlan {
    /// Plans a scenario and has the plan checked independently.
    ///
    /// # Errors
    /// Says what is wrong with the plan.
    pub fn of(scenario: &Scenario) -> Result<Self, Failure> {
        let problem = Arc::new(scenario.problem().clone());
        let start = Instant::now();
        let mut planning = Planning::new(Arc::clone(&problem));
        let decisions = planning.take_all_turns();
        let planning_us = u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX);
        let outcome = planning.outcome(decisions);
        let decisions: Vec<Decision> = outcome
            .decisions
            .iter()
            .map(|(_, decision)| decision.clone())
            .collect();
        check_plan(&problem, &decisions, &outcome.plan).map_err(|violations| {
            let named: Vec<String> = violations.iter().map(ToString::to_string).collect();
            Failure::Failed(anyhow!(
                "the plan breaks its own promises: {}",
                named.join("; ")
            ))
        })?;
        Ok(Self {
            statistics: Statistics::of(&problem, &outcome),
            problem,
            outcome,
            planning_us,
        })
    }

    /// What to print as JSON.
    pub fn report(&self) -> PlanReport<'_> {
        PlanReport {
            statistics: &self.statistics,
            planning_us: self.planning_us,
        }
    }

    /// Prints what people should know before anything moves.
    pub fn warn(&self, path: &Path) {
        for warning in &self.statistics.warnings {
            console::note(&format!("warning: {}: {warning}", path.display()));
        }
        if !self.statistics.proven {
            console::note(&format!(
                "warning: {}: a search on a graph with cycles was cut at its budget; a better plan may exist",
                path.display()
            ));
        }
    }

    /// The plan as a table, and its sums.
    pub fn text(&self, name: &str) -> String {
        let mut parts = Vec::new();
        if !name.is_empty() {
            parts.push(crate::failure::one_line(name));
        }
        parts.push(self.table().to_string());
        let statistics = &self.statistics;
        if !statistics.unassigned.is_empty() {
            parts.push(format!(
                "without a spot: {}",
                listed(
                    "module",
                    statistics.unassigned.iter().map(|module| module.0)
                )
            ));
        }
        if !statistics.open_spots.is_empty() {
            parts.push(format!(
                "left open: {}",
                listed("spot", statistics.open_spots.iter().map(|spot| spot.0))
            ));
        }
        parts.push(format!(
            "{} kept, {} broken; {} detached; {}; {}",
            counted(statistics.kept_links, "link"),
            statistics.broken_links,
            counted(statistics.detached_modules, "module"),
            counted(statistics.port_changes, "port change"),
            counted(statistics.evictions, "eviction"),
        ));
        parts.push(format!(
            "total utility {:.3}, total distance {:.3} units",
            statistics.total_utility, statistics.total_distance
        ));
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

    fn table(&self) -> Table {
        let order: BTreeMap<SpotId, usize> = self
            .statistics
            .assembly_order
            .iter()
            .copied()
            .zip(1..)
            .collect();
        let leads: BTreeMap<ModuleId, ModuleId> = self
            .outcome
            .plan
            .assembly
            .units
            .iter()
            .filter(|unit| unit.placements.len() > 1)
            .flat_map(|unit| {
                unit.placements
                    .iter()
                    .map(|&(module, _)| (module, unit.lead))
            })
            .collect();
        let mut table = Table::new(["module", "spot", "filled", "way", "moves with"]);
        for assignment in &self.statistics.assignments {
            let (module, spot) = (assignment.module, assignment.spot);
            let way = self
                .problem
                .module(module)
                .zip(self.problem.target().spot(spot))
                .map(|(module, spot)| module.pose.distance_to(&spot.pose));
            table.row([
                module.0.to_string(),
                spot.0.to_string(),
                order.get(&spot).map(usize::to_string).unwrap_or_default(),
                way.map(|way| format!("{:.3}", way.to_units()))
                    .unwrap_or_default(),
                leads
                    .get(&module)
                    .map(|lead| lead.0.to_string())
                    .unwrap_or_default(),
            ]);
        }
        table
    }
}

/// Identifiers in words, such as `spots 3, 7`.
pub fn listed(noun: &str, ids: impl Iterator<Item = u32>) -> String {
    let ids: Vec<String> = ids.map(|id| id.to_string()).collect();
    let plural = if ids.len() == 1 { "" } else { "s" };
    format!("{noun}{plural} {}", ids.join(", "))
}
