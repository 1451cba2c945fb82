//! What `formation simulate` prints of its runs.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use formation_event_log::milliseconds;
use formation_model::SpotId;
use formation_model::text::{counted, joined};
use formation_sim::{CampaignParameters, Ending, FaultKind, SeedReport};
use serde::Serialize;

use crate::checked_plan::{CheckedPlan, PlanTurn};

/// The most modules of a drawn scenario. Larger clusters are possible, but one run takes minutes.
pub const SIMULATED_MODULES_MAX: usize = 200;

/// The parameters of the runs of `formation simulate`: those of a planned scenario, or of drawn ones of `modules`.
pub fn campaign_parameters(
    faults: FaultKind,
    modules: (usize, usize),
    plan: Option<&CheckedPlan>,
    transcripts: bool,
) -> CampaignParameters {
    CampaignParameters {
        faults,
        modules_min: modules.0,
        modules_max: modules.1,
        problem: plan.map(|plan| Arc::clone(&plan.problem)),
        transcripts,
        ..CampaignParameters::default()
    }
}

/// What `formation simulate --json` prints.
#[derive(Debug, Default, Serialize)]
pub struct Figures {
    first_seed: u64,
    faults: String,
    /// The fewest and the most modules that a run had.
    modules: Option<[usize; 2]>,
    /// Sums over all runs.
    #[serde(flatten)]
    pub sums: Sums,
    /// How many violations there were of each kind.
    violations: BTreeMap<String, u64>,
    failing_seeds: Vec<u64>,
    recovery_ms: Spread,
    elapsed_ms: u64,
    /// The plan of the scenario, if one was given.
    #[serde(flatten)]
    plan: Option<PlanFigures>,
    /// The log of the run, line by line, when there was one seed only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transcript: Option<Vec<String>>,
}

/// What is printed of the plan of a scenario.
#[derive(Debug, Serialize)]
struct PlanFigures {
    /// Whether it fills all spots that the modules suffice for.
    complete: bool,
    /// Whether each placement of a configuration is proven to be the best.
    proven: bool,
    open_spots: Vec<SpotId>,
    turns: Vec<PlanTurn>,
}

impl PlanFigures {
    fn of(plan: &CheckedPlan) -> Self {
        Self {
            complete: plan.is_complete(),
            proven: plan.statistics.proven,
            open_spots: plan.statistics.open_spots.clone(),
            turns: plan.turns(),
        }
    }
}

/// Sums over all runs.
#[derive(Debug, Default, Serialize)]
pub struct Sums {
    /// The runs that were counted.
    pub runs: u64,
    formed: u64,
    waiting_for_quorum: u64,
    messages: u64,
    epochs: u64,
}

/// Median and worst recovery time over the seeds; `null` if no seed has one.
#[derive(Debug, Default, Serialize)]
struct Spread {
    median: Option<u64>,
    worst: Option<u64>,
    /// The lowest seed that took the worst time.
    worst_seed: Option<u64>,
}

impl Spread {
    fn of(times: &mut [(Duration, u64)]) -> Self {
        times.sort_unstable_by_key(|&(time, seed)| (time, Reverse(seed)));
        let middle = times.get(times.len() / 2);
        let worst = times.last();
        Self {
            median: middle.map(|&(time, _)| milliseconds(time)),
            worst: worst.map(|&(time, _)| milliseconds(time)),
            worst_seed: worst.map(|&(_, seed)| seed),
        }
    }

    fn text(&self) -> String {
        let seconds = |millis: Option<u64>| {
            millis.map_or_else(
                || "none".to_owned(),
                |millis| format!("{:.1} s", Duration::from_millis(millis).as_secs_f64()),
            )
        };
        let seed = self.worst_seed;
        let seed = seed.map_or_else(String::new, |seed| format!(" (seed {seed})"));
        format!(
            "median {}, worst {}{seed}",
            seconds(self.median),
            seconds(self.worst)
        )
    }
}

impl Figures {
    /// The figures for people.
    pub fn text(&self) -> String {
        let Self { faults, sums, .. } = self;
        let modules = match self.modules {
            Some([least, most]) if least == most => format!("{least} modules"),
            Some([least, most]) => format!("{least} to {most} modules"),
            None => "no modules".to_owned(),
        };
        let kinds = self.violations.iter();
        let violations = match self.violations.is_empty() {
            true => "none".to_owned(),
            false => joined(kinds.map(|(kind, count)| format!("{kind} {count}")), ", "),
        };
        let from = if faults == "none" {
            "start"
        } else {
            "last fault"
        };
        format!(
            "{} of {modules} with faults: {faults}; {} formed, {} waiting for a quorum\n\
             violations: {violations}\n\
             recovery from the {from} until formed: {}\n\
             {}, {} in {:.1} s",
            counted_u64(sums.runs, "run"),
            sums.formed,
            sums.waiting_for_quorum,
            self.recovery_ms.text(),
            counted_u64(sums.messages, "message"),
            counted_u64(sums.epochs, "epoch"),
            Duration::from_millis(self.elapsed_ms).as_secs_f64()
        )
    }
}

/// A number that may exceed an index, with its noun.
pub fn counted_u64(count: u64, noun: &str) -> String {
    counted(usize::try_from(count).unwrap_or(usize::MAX), noun)
}

/// The runs so far.
pub struct Campaign {
    /// What is printed.
    pub figures: Figures,
    /// The recovery of each run that formed, and its seed.
    recoveries: Vec<(Duration, u64)>,
    /// The runs that violated something.
    pub failing: BTreeMap<u64, SeedReport>,
    keeps_transcript: bool,
}

impl Campaign {
    /// Begins with no run. The transcript is kept of a single run only.
    pub fn new(first_seed: u64, seeds: u64, faults: FaultKind, plan: Option<&CheckedPlan>) -> Self {
        Self {
            figures: Figures {
                first_seed,
                faults: faults.to_string(),
                plan: plan.map(PlanFigures::of),
                ..Figures::default()
            },
            recoveries: Vec::new(),
            failing: BTreeMap::new(),
            keeps_transcript: seeds == 1,
        }
    }

    /// Counts a run.
    pub fn add(&mut self, report: SeedReport) {
        let figures = &mut self.figures;
        let sums = &mut figures.sums;
        sums.runs += 1;
        sums.messages += report.messages;
        sums.epochs += report.epochs;
        match report.ending {
            Ending::Formed => {
                sums.formed += 1;
                self.recoveries.push((report.recovery, report.seed));
            }
            Ending::WaitingForQuorum => sums.waiting_for_quorum += 1,
            Ending::Neither => {}
        }
        let [least, most] = figures.modules.unwrap_or([report.modules; 2]);
        figures.modules = Some([least.min(report.modules), most.max(report.modules)]);
        for violation in &report.violations {
            let kind = figures.violations.entry(violation.kind.to_string());
            *kind.or_default() += 1;
        }
        if self.keeps_transcript {
            let lines = report.transcript.lines().iter();
            figures.transcript = Some(lines.map(ToString::to_string).collect());
        }
        if !report.violations.is_empty() {
            self.failing.insert(report.seed, report);
        }
    }

    /// Computes what only all runs together have; `elapsed` is by a real clock.
    pub fn finish(&mut self, elapsed: Duration) {
        self.figures.failing_seeds = self.failing.keys().copied().collect();
        self.figures.recovery_ms = Spread::of(&mut self.recoveries);
        self.figures.elapsed_ms = milliseconds(elapsed);
    }
}

#[cfg(test)]
mod tests {
    use formation_sim::{BrokenInvariant, Transcript, ViolationKind};

    use super::*;

    fn report(seed: u64, recovery_s: u64, violations: Vec<BrokenInvariant>) -> SeedReport {
        SeedReport {
            seed,
            modules: 5,
            spots: 5,
            running: 4,
            ending: Ending::Formed,
            recovery: Duration::from_secs(recovery_s),
            messages: 10,
            epochs: 2,
            violations,
            reported: Vec::new(),
            transcript: Transcript::default(),
            published: Vec::new(),
        }
    }

    #[test]
    fn violations_are_counted_by_kind_and_recoveries_by_seed() {
        let mut campaign = Campaign::new(0, 3, FaultKind::None, None);
        let violation = BrokenInvariant {
            at: Duration::from_secs(1),
            kind: ViolationKind::Hole,
            detail: "4 of 5 spots are filled".to_owned(),
        };
        campaign.add(report(0, 7, Vec::new()));
        campaign.add(report(2, 9, vec![violation]));
        campaign.add(report(1, 3, Vec::new()));
        campaign.finish(Duration::ZERO);
        let figures = &campaign.figures;
        assert_eq!(figures.failing_seeds, [2]);
        assert_eq!(figures.violations, BTreeMap::from([("hole".to_owned(), 1)]));
        assert_eq!(figures.recovery_ms.median, Some(7_000));
        assert_eq!(figures.recovery_ms.worst, Some(9_000));
        assert_eq!(figures.recovery_ms.worst_seed, Some(2));
    }
}
