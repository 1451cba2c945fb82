//! Simulated runs.

use std::time::{Duration, Instant};

use formation_offline::{Campaign, SIMULATED_MODULES_MAX, campaign_parameters};
use formation_sim::{CampaignParameters, Ending, FaultKind, SeedReport, run_seeds};
use pyo3::prelude::*;
use serde::Serialize;

use crate::errors::{json, motion_refused, option_refused};
use crate::plan::NativePlan;

/// After this many seeds it is looked whether the user interrupts.
const SEEDS_BETWEEN_SIGNALS: u64 = 8;

/// Runs, each from a seed.
#[pyclass(frozen, module = "formation._native")]
pub struct NativeSimulation {
    campaign: Campaign,
    runs: Vec<Run>,
    /// The transcript of a single run: seconds, and the normalised event.
    events: Vec<(f64, String)>,
}

/// One run.
#[derive(Serialize)]
struct Run {
    seed: u64,
    modules: usize,
    spots: usize,
    running: usize,
    ending: &'static str,
    recovery_s: f64,
    messages: u64,
    epochs: u64,
    violations: Vec<Violation>,
}

#[derive(Serialize)]
struct Violation {
    at_s: f64,
    kind: String,
    detail: String,
}

impl Run {
    fn of(report: &SeedReport) -> Self {
        let violations = report.violations.iter();
        Self {
            seed: report.seed,
            modules: report.modules,
            spots: report.spots,
            running: report.running,
            ending: match report.ending {
                Ending::Formed => "formed",
                Ending::WaitingForQuorum => "waiting_for_quorum",
                Ending::Neither => "neither",
            },
            recovery_s: report.recovery.as_secs_f64(),
            messages: report.messages,
            epochs: report.epochs,
            violations: violations
                .map(|one| Violation {
                    at_s: one.at.as_secs_f64(),
                    kind: one.kind.to_string(),
                    detail: one.detail.clone(),
                })
                .collect(),
        }
    }
}

impl NativeSimulation {
    fn add(&mut self, report: SeedReport) {
        let lines = report.transcript.lines().iter();
        let lines = lines.map(|line| (line.at.as_secs_f64(), line.event.clone()));
        self.events.extend(lines);
        self.runs.push(Run::of(&report));
        self.campaign.add(report);
    }

    /// Runs the seeds in parts, so that an interruption ends it soon.
    fn run(
        &mut self,
        py: Python<'_>,
        parameters: &CampaignParameters,
        first: u64,
        end: u64,
    ) -> PyResult<()> {
        let start = Instant::now();
        let mut next = first;
        while next < end {
            let part = next..end.min(next.saturating_add(SEEDS_BETWEEN_SIGNALS));
            next = part.end;
            let ran = py.detach(|| run_seeds(parameters, part, |report| self.add(report)));
            ran.map_err(|error| {
                option_refused(py, &format!("no scenario could be drawn: {error}"))
            })?;
            py.check_signals()?;
        }
        self.runs.sort_by_key(|run| run.seed);
        self.finish(start.elapsed());
        Ok(())
    }

    fn finish(&mut self, elapsed: Duration) {
        self.campaign.finish(elapsed);
    }
}

#[pymethods]
impl NativeSimulation {
    /// The object that `formation simulate --json` prints.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        json(py, &self.campaign.figures)
    }

    /// What `formation simulate` prints.
    fn text(&self) -> String {
        self.campaign.figures.text()
    }

    /// The runs in the order of their seeds, as JSON.
    fn runs_json(&self, py: Python<'_>) -> PyResult<String> {
        json(py, &self.runs)
    }

    /// The number of events that were kept.
    fn event_count(&self) -> usize {
        self.events.len()
    }

    /// An event: the second at which it happened, and its words.
    fn event(&self, index: usize) -> Option<(f64, &str)> {
        let (at, event) = self.events.get(index)?;
        Some((*at, event))
    }
}

/// Runs seeds with the modules and target of a plan, or with drawn ones.
#[pyfunction]
#[pyo3(signature = (plan, modules, first_seed, seeds, faults))]
pub fn simulate(
    py: Python<'_>,
    plan: Option<&NativePlan>,
    modules: (usize, usize),
    first_seed: u64,
    seeds: u64,
    faults: &str,
) -> PyResult<NativeSimulation> {
    let faults: FaultKind = faults
        .parse()
        .map_err(|error: String| option_refused(py, &format!("faults: {error}")))?;
    let end = first_seed.checked_add(seeds).ok_or_else(|| {
        option_refused(
            py,
            &format!("seed {first_seed}: {seeds} seeds from there on exceed the highest seed"),
        )
    })?;
    let (least, most) = modules;
    if !(1 <= least && least <= most && most <= SIMULATED_MODULES_MAX) {
        let reason = format!(
            "modules: must be a range such as (5, 40), from 1 to {SIMULATED_MODULES_MAX}, got ({least}, {most})"
        );
        return Err(option_refused(py, &reason));
    }
    let plan = plan.map(|plan| plan.formable(py)).transpose()?;
    if let Some(reason) = plan.and_then(|plan| plan.unmovable_text()) {
        return Err(motion_refused(py, &reason));
    }
    let parameters = campaign_parameters(faults, modules, plan, seeds == 1);
    let mut simulation = NativeSimulation {
        campaign: Campaign::new(first_seed, seeds, faults, plan),
        runs: Vec::new(),
        events: Vec::new(),
    };
    simulation.run(py, &parameters, first_seed, end)?;
    Ok(simulation)
}

/// The names of the kinds of faults.
#[pyfunction]
pub fn fault_kinds() -> Vec<&'static str> {
    FaultKind::NAMED.iter().map(|(name, _)| *name).collect()
}
